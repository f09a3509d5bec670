"""Search the known train and its speed: combs of all rows of vehicles are fitted, and the likeliest row is taken.

A row is rejected where the sensors record as much before or behind it as along it: the train is longer than the row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np

from turnout.passage.axle_patterns import Pattern, offsets
from turnout.passage.comb import Comb, evidence, explained, profiles_at, teeth_of
from turnout.passage.kinematics import Motion
from turnout.passage.vehicle_sequence import likeliest_row

NEAR, FAR = 5.0, 27.0  # m beyond the last wheel, where wheels of a further vehicle would be
# Share of the mean amplitude along the row above which a further vehicle runs there. In 68 simulated cases of one
# sensor it is at most 0.21 without one; the bogies of a locomotive have at least 0.75 of the amplitude of coaches.
AS_LOUD = 0.6


def goes_on(heard, motion, first: float, length: float) -> bool:
    """Whether the sensors record more than ``MIN_BEYOND_AMPLITUDE`` times the row's own amplitude beyond either end.

    A row that is a part of the train fits that part as well as the train's own row does. It fits better where the
    remaining vehicles sound different: coaches without their locomotive.

    Parameters
    ----------
    envelopes : SensorEnvelopes
    motion : Motion
    first : float
        The row's first axle, in the motion's own coordinate. [m]
    length : float
        From the first axle to the last one. [m]
    """
    stretches = np.array([[0.0, length], [-FAR, -NEAR], [length + NEAR, length + FAR]]) + first
    own, before, behind = np.mean([_amplitudes(heard, i, motion, stretches) for i in range(len(heard.positions))], 0)
    return bool(max(before, behind) > AS_LOUD * own)


def _amplitudes(heard, i, motion, stretches):
    """(n_stretch,) mean amplitude of sensor ``i`` above its quiet level; 0 where nothing was recorded."""
    amplitude, step = heard.levels.amplitude[i], heard.levels.step
    above = np.clip(amplitude - np.quantile(amplitude, 0.05), 0.0, None)
    total = np.concatenate([[0.0], np.cumsum(above)]) * step
    times = motion.passing(stretches, heard.positions[i])
    inside = np.interp(times, np.arange(total.size) * step, total)
    return np.diff(inside, axis=1)[:, 0] / np.maximum(np.diff(times, axis=1)[:, 0], step)


KMH = 3.6
FINE = 0.003  # relative step between the speeds that are tried
LOOSE = 0.5  # m, error of the first search over the length of the row
OUTSIDE = 75.0  # m, most that is audible before the first and behind the last axle together
BEND = 0.15  # m, step of the middle against the ends between accelerations; also its limit in m/s²
CLOSE = 2.0  # m by which a row may exceed the audible length
KEPT = 3  # rows of a type that are refined


@dataclass(frozen=True)
class Fitted:
    """A row of vehicles fitted to the sensor envelopes.

    ``share`` is explained, ``evidence`` [nat] its log Bayes factor. ``start`` [m] is the first axle behind the
    beginning of the audible part. ``motion`` belongs to it, and ``vehicles`` of the ``pattern``.
    """

    pattern: Pattern
    vehicles: tuple
    comb: Comb
    motion: Motion
    start: float
    share: float
    evidence: float
    choices: float = 0.0


@lru_cache(maxsize=4)
def even_rows(patterns) -> tuple:
    """(pattern, vehicles, comb) of every row in which each group has vehicles of one type only."""
    found = {}
    for pattern in patterns:
        groups = []
        for g in pattern.groups:
            counts = range(max(g.minimum, 1), g.maximum + 1)
            groups.append([()] * (g.minimum == 0) + [(v,) * n for n in counts for v in g.vehicles])
        for parts in product(*groups):
            row = tuple(v for part in parts for v in part)
            if sum(len(v.axles) for v in row) >= 4:
                found[pattern.type, tuple((v.length, v.axles) for v in row)] = (pattern, row)
    return tuple((pattern, row, Comb.of(offsets(row))) for pattern, row in found.values())


def at_all_speeds(begin: float, settings) -> list[Motion]:
    """Motions at all speeds of trains, ``SPEED_STEP`` apart, with the first axle at 0 at the time ``begin`` [s]."""
    slow, fast = settings.speed_minimum / KMH, settings.speed_maximum / KMH
    return [Motion(float(v), begin) for v in np.geomspace(slow, fast, int(np.log(fast / slow) / FINE))]


def choices_of(pattern, row) -> float:
    """Logarithm of the largest number of rows with as many vehicles that the pattern allows."""
    kinds = max(len(g.vehicles) for g in pattern.groups)
    return float(np.log(kinds) * len(row)) if len({v.name for v in row}) > 2 else float(np.log(kinds))


def likeliest(heard, motions, patterns) -> dict[str, Fitted]:
    """Type -> its likeliest row of vehicles, out of ``motions`` in order of their speed, ``SPEED_STEP`` apart.

    A row is left out where the train continues beyond its ends.
    """
    profiles = profiles_at(heard, motions)
    n_sensor, first = len(heard.positions), {}
    for pattern, row, comb in even_rows(patterns):
        span = comb.offsets[-1]
        near = np.flatnonzero((profiles.length > span - CLOSE) & (profiles.length < span + OUTSIDE))
        near = near[:: max(int(LOOSE / span / FINE), 1)]
        if not near.size:
            continue
        share, starts = explained(profiles, comb, near, every=4)
        worth = evidence(share.max(axis=1), profiles.length[near], n_sensor) - choices_of(pattern, row)
        k = int(np.argmax(worth))
        start = float(starts[int(np.argmax(share[k]))])
        found = Fitted(pattern, row, comb, profiles.motions[near[k]], start, float(share[k].max()), float(worth[k]))
        first.setdefault(pattern.type, []).append(found)
    best = {}
    for type_, rows in first.items():
        rows = sorted(rows, key=lambda f: -f.evidence)[:KEPT]
        close = [f for f in (closely(heard, f) for f in rows) if not goes_on(heard, f.motion, *_ends(heard, f))]
        if close:
            best[type_] = max(close, key=lambda f: f.evidence)
    return best


def closely(heard, fitted: Fitted, passes: int = 3) -> Fitted:
    """The row with refined speed and, where the pattern allows a choice, refined vehicles, in turn."""
    fitted = sharper(heard, fitted, 0.006)
    for _ in range(passes):
        better = _other_vehicles(heard, fitted)
        better = sharper(heard, better, 0.004) if better is not fitted else fitted
        if better.evidence <= fitted.evidence:
            break
        fitted = better
    return fitted


def _ends(heard, fitted: Fitted) -> tuple[float, float]:
    """The row's first axle in its motion's own coordinate, and its length. [m]"""
    place = fitted.motion.direction * float(np.mean(heard.positions))
    return float(fitted.motion.way(heard.begin)) - place + fitted.start, float(fitted.comb.offsets[-1])


def about_middle(heard, fitted: Fitted) -> Motion:
    """The motion relative to the row's middle: ``start`` when it passes the middle of the sensors, ``speed`` then."""
    motion, place = fitted.motion, fitted.motion.direction * float(np.mean(heard.positions))
    first, length = _ends(heard, fitted)
    middle = float(motion.time(first + 0.5 * length + place))
    return replace(motion, speed=float(motion.speed_at(middle)), start=middle)


def sharper(heard, fitted: Fitted, reach: float) -> Fitted:
    """The same row at the best speed within ``reach`` (relative) and the best acceleration near its own."""
    middle = about_middle(heard, fitted)
    bend = 16.0 * BEND / (fitted.comb.offsets[-1] / middle.speed) ** 2
    bends = middle.acceleration + min(bend, BEND) * np.arange(-2, 3)
    speeds = middle.speed * (1.0 + np.linspace(-reach, reach, 9))
    motions = [replace(middle, speed=v, acceleration=a) for a in bends for v in speeds]
    profiles = profiles_at(heard, motions)
    share, starts = explained(profiles, fitted.comb, np.arange(len(motions)))
    k, s = np.unravel_index(int(np.argmax(share)), share.shape)
    worth = evidence(share[k, s], profiles.length[k], len(heard.positions))
    worth -= choices_of(fitted.pattern, fitted.vehicles)
    if worth <= fitted.evidence:
        return fitted
    return replace(fitted, motion=motions[k], start=float(starts[s]), share=float(share[k, s]), evidence=float(worth))


def _other_vehicles(heard, fitted):
    """The row that fits best with the tooth of this one; unchanged where the pattern allows no choice."""
    if fitted.pattern.only_row() is not None:
        return fitted
    profiles = profiles_at(heard, [fitted.motion])
    teeth, _ = teeth_of(profiles, fitted.comb, fitted.start)
    found = likeliest_row(profiles, teeth, fitted.pattern, fitted.start)
    if found is None or found[0] == fitted.vehicles or sum(len(v.axles) for v in found[0]) < 4:
        return fitted
    comb = Comb.of(offsets(found[0]))
    share, starts = explained(profiles, comb, np.arange(1))
    k = int(np.argmax(share[0]))
    worth = evidence(share[0, k], profiles.length[0], len(heard.positions))
    worth -= choices_of(fitted.pattern, found[0])
    return Fitted(fitted.pattern, found[0], comb, fitted.motion, float(starts[k]), float(share[0, k]), float(worth))
