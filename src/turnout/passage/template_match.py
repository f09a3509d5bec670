"""Match a known train to the envelopes of one or two sensors.

Its comb must explain more than any other's, and no other shape of its vehicles may explain much more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import stats

from turnout.passage.axle_features import AxleFinding
from turnout.passage.comb import ALIKE, evidence, explained, profiles_at, reshaped
from turnout.passage.comb_search import Fitted, about_middle, likeliest
from turnout.passage.train_type import UNKNOWN, TypeFinding

CLEAR = 10.0  # nat, least log Bayes factor of a comb against no train
# Largest gain by another shape of the vehicles, as a share of the evidence, less what free numbers gain by chance.
# Simulated trains with a template gain 0.08 at most, similar trains without one at least 0.22.
RESHAPED = 0.14
SPEEDS = np.linspace(-0.012, 0.012, 49)  # relative speeds around the best one
BEND = 0.2  # m, step of the train's middle against its ends between accelerations
STEADY, STEADY_SHARE = 0.02, 0.8  # m/s², sd of a steady train; share of trains that pass a turnout at a steady speed


def known_train(heard, motions, patterns, settings):
    """(motion, AxleFinding, TypeFinding) of the train of ``patterns`` in the envelopes, None where none is certain.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Of one sensor or more.
    motions : sequence of Motion
        Candidates, in order of their speed.
    patterns : sequence of Pattern
        Known trains; their rows are tried with one vehicle type per group, then vehicle by vehicle.
    settings : PassageSettings
        Least probability of a type, prior of trains without template, limit of the acceleration.
    """
    types = likeliest(heard, motions, tuple(patterns)) if patterns else {}
    if not types:
        return None
    best = max(types.values(), key=lambda f: f.evidence)
    # here a train without template explains no more than noise; its shape is tested below
    log = {name: f.evidence + np.log((1 - settings.unknown_prior) / len(types)) for name, f in types.items()}
    log[UNKNOWN] = CLEAR + np.log(settings.unknown_prior)
    top = max(log.values())
    total = sum(np.exp(value - top) for value in log.values())
    posterior = {name: float(np.exp(value - top) / total) for name, value in sorted(log.items())}
    if posterior[best.pattern.type] < settings.type_probability or best.evidence < CLEAR:
        return None
    profiles = profiles_at(heard, [best.motion])
    shape, before, after = reshaped(profiles, best.vehicles, best.comb.offsets, best.start)
    n, length = len(heard.positions), float(profiles.length[0])
    free = sum(len(axles) for axles in {v.name: v.axles for v in best.vehicles}.values())
    gain = evidence(after, length, n) - evidence(before, length, n) - 0.5 * free * np.log(n * length / ALIKE)
    if gain > RESHAPED * best.evidence:
        return None
    speed, speed_se, acceleration, acceleration_se, fitted = speed_of(heard, best, settings)
    offsets = fitted.comb.offsets
    half = 0.5 * offsets[-1] / speed
    residual = float(np.std(shape - best.comb.offsets))
    # the axles' residuals may be systematic: they move a straight line through the axles by that much
    speed_se = float(np.hypot(speed_se, speed * residual / np.sqrt(np.sum((offsets - offsets.mean()) ** 2))))
    found = TypeFinding(
        best.pattern.type,
        posterior[best.pattern.type],
        posterior,
        best.vehicles,
        offsets,
        residual,
        speed - acceleration * half,
        float(np.hypot(speed_se, acceleration_se * half)),
        acceleration,
        acceleration_se,
        speed,
        speed_se,
    )
    origin = float(profiles_at(heard, [fitted.motion]).origin[0])
    offer = AxleFinding(origin + fitted.start + offsets, np.ones(offsets.size), 1.0 / (1.0 - best.share), "comb")
    return fitted.motion, offer, found


def speed_of(heard, fitted: Fitted, settings):
    """(speed halfway [m/s], its standard error, acceleration [m/s²], its standard error, the likeliest fit).

    Posterior means of both, from the comb's evidence. Most trains pass a turnout at a steady speed: 0.8 of the prior of
    the acceleration is 0 ± 0.02 m/s², the remainder 0 ± a quarter of the limit.
    """
    lasted = fitted.comb.offsets[-1] / fitted.motion.speed
    step = 16.0 * BEND / lasted**2
    most = max(min(settings.acceleration_limit, 6.0 * step), step)
    bends = np.linspace(-most, most, 13)
    middle = about_middle(heard, fitted)
    speeds = middle.speed * (1.0 + SPEEDS)
    motions = [replace(middle, speed=v, acceleration=a) for a in bends for v in speeds]
    profiles = profiles_at(heard, motions)
    share, starts = explained(profiles, fitted.comb, np.arange(len(motions)))
    # sensors record the same wheels: their residuals are not independent, so they count as one
    log = evidence(share.max(axis=1), profiles.length, 1).reshape(13, -1)
    edges = np.append(bends - 0.5 * (bends[1] - bends[0]), bends[-1] + 0.5 * (bends[1] - bends[0]))
    steady = np.diff(stats.norm.cdf(edges / STEADY))
    other = np.diff(stats.norm.cdf(edges / (0.25 * settings.acceleration_limit)))
    log = log + np.log(STEADY_SHARE * steady + (1 - STEADY_SHARE) * other + 1e-12)[:, None]
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    by_speed, by_bend = weight.sum(axis=0), weight.sum(axis=1)
    speed, acceleration = float(by_speed @ speeds), float(by_bend @ bends)
    # the grid is no finer: add a twelfth of its step squared
    speed_se = np.sqrt(by_speed @ (speeds - speed) ** 2 + (speeds[1] - speeds[0]) ** 2 / 12)
    acceleration_se = np.sqrt(by_bend @ (bends - acceleration) ** 2 + min(STEADY, bends[1] - bends[0]) ** 2)
    k = int(np.argmax(log))  # index over all motions
    start = float(starts[int(np.argmax(share[k]))])
    best = replace(fitted, motion=motions[k], start=start, share=float(share[k].max()))
    return speed, float(speed_se), acceleration, float(acceleration_se), best
