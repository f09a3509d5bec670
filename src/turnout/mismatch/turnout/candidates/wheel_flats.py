r"""Find wheels with a flat by their impacts in the sound level of passages, then size them by their signal in the band.

A flat causes an impact at each turn. Below 100 Hz it is hidden by the roughness of the other wheels. Above 250 Hz it is
10 to 30 dB above their noise at the moment of the impact, in all sensors near the wheel. A single impact may have any
cause. A row of impacts one turn apart, each loudest near one wheel, is a flat on that wheel. The datum is the loudest
moment z around each expected impact, one per sensor; with x the distance from impact to sensor

.. math:: \Lambda = \sum \ln \frac{(1-\epsilon) N(z; m, 1 + m/4) + \epsilon U}
          {(1-\epsilon) N(z; 0, 1) + \epsilon U}, \quad m = \max(A - \beta x, 0)

Impacts scatter, on a sleeper or between two. The outlier term limits the evidence of a single impact, whatever its
cause, to :math:`\ln(1/\epsilon U)`.

The length of a flat is common to all passages of the train; the angle at which the wheel arrives is not, so that every
passage has its own phase. The impacts give it to some centimetres; the simulation, with loss of contact, gives the
rest.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from turnout import physics
from turnout.constants import MAD_TO_SD
from turnout.errors import SimulationError
from turnout.mismatch.turnout.candidates.catalogue import candidate_of, rival_axles
from turnout.mismatch.turnout.defect_priors import FLATS
from turnout.mismatch.turnout.passage_band import limit_band
from turnout.physics.hypothesis import Hypothesis

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage

Phases: TypeAlias = tuple[tuple[str, float], ...]  # (recording, rolling distance to the first impact [m])
RADIUS_CHANGES = np.arange(*FLATS.radius_changes)  # relative to the file: a wheel is turned down in service


@dataclass(frozen=True)
class FlatEvidence:
    """Evidence [nats] that a wheel (0 first) of a train has a flat.

    ``radius`` is that of the wheel [m], ``phases`` (recording, rolling distance to the first impact [m]).
    """

    nats: float
    train: str
    wheel: int
    radius: float
    phases: Phases


def robust_band_level(samples: np.ndarray, rate: float, start: float, stop: float) -> tuple[np.ndarray, np.ndarray]:
    """Loudest moment around each time, in robust deviations from the background.

    Parameters
    ----------
    samples : (n_channel, n_sample) array of float
        Signals.
    rate : float
        Samples per second. [Hz]
    start : float
        [s]
    stop : float
        [s]

    Returns
    -------
    time : (n,) array of float
        [s]
    level : (n_channel, n) array of float
        [deviations]
    """
    fold = max(1, round(FLATS.bin_time * rate))
    power = (
        limit_band(
            samples, rate, low=FLATS.low_frequency, high=min(FLATS.high_frequency, FLATS.max_frequency_share * rate)
        )
        ** 2
    )
    n = power.shape[1] // fold
    level = np.log(power[:, : n * fold].reshape(-1, n, fold).mean(axis=2) + 1e-12)
    time = (np.arange(n) + 0.5) * fold / rate
    keep = (time > start) & (time < stop)
    time, level = time[keep], level[:, keep]
    half = max(1, round(FLATS.impact_time * rate / fold))
    loudest = np.max(_shifted_copies(level, np.arange(-half, half + 1)), axis=0)
    background = np.median(
        _shifted_copies(
            loudest,
            np.arange(
                -round(FLATS.background_time / FLATS.bin_time), round(FLATS.background_time / FLATS.bin_time) + 1, 4
            ),
        ),
        axis=0,
    )
    excess = loudest - background
    spread = MAD_TO_SD * np.median(np.abs(excess - np.median(excess, axis=1, keepdims=True)), axis=1, keepdims=True)
    return time, excess / np.maximum(spread, 1e-6)


def _shifted_copies(rows: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """(n_step, n_row, n) copies of rows (n_row, n) shifted by steps, with constant ends."""
    index = np.clip(np.arange(rows.shape[1]) + np.asarray(steps)[:, None], 0, rows.shape[1] - 1)
    return np.moveaxis(rows[:, index], 1, 0)


def log_density(deviations: np.ndarray, expected: np.ndarray | float) -> np.ndarray:
    """Log density of ``deviations`` for an impact of ``expected`` deviations; 0 for none.

    Parameters
    ----------
    deviations : (...) array of float
        Recorded levels. [deviations]
    expected : float or (...) array of float
        Levels of an impact there, broadcast against ``deviations``. [deviations]

    Returns
    -------
    (...) array of float
        [nats]
    """
    spread = 1.0 + FLATS.impact_scatter * expected
    normal = np.exp(-0.5 * ((deviations - expected) / spread) ** 2) / (np.sqrt(2.0 * np.pi) * spread)
    return np.log((1.0 - FLATS.outlier_share) * normal + FLATS.outlier_share * FLATS.outlier_density)


def band_excess(aligned: AlignedPassage) -> tuple[np.ndarray, np.ndarray]:
    """Band level of the sensors, without the level that all wheels share.

    Parameters
    ----------
    aligned : AlignedPassage
        The passage.

    Returns
    -------
    time : (n,) array of float
        [s]
    excess : (n_sensor, n) array of float
        [deviations]
    """
    recording = aligned.passage.recording
    rows = [recording.index(s.name) for s in aligned.sensors]
    time, excess = robust_band_level(recording.samples[rows], recording.rate, aligned.time[0], aligned.time[-1])
    return time, excess - _common_excess(aligned, time, excess)


def _common_excess(aligned: AlignedPassage, time: np.ndarray, excess: np.ndarray) -> np.ndarray:
    """(n_sensor, n) level that all wheels have at a position, for the position of any wheel at these times.

    It is the median over the wheels, 0 where that is noise. Where all of them cause impacts, at a nose or a joint, the
    cause is in the rail. Of an even number of wheels it is the lower median, so that a flat of one of two wheels stays.
    One wheel alone gives no such level.
    """
    behind = aligned.passage.vehicle.wheel_positions[:, None]
    if len(behind) < 2:
        return np.zeros_like(excess)
    distance = np.arange(
        -FLATS.max_sensor_distance,
        np.ptp([s.place for s in aligned.sensors]) + FLATS.max_sensor_distance,
        FLATS.comparison_step,
    )  # from the first sensor
    passed = aligned.reference + (distance + behind) / aligned.speed
    each = np.array(
        [np.sort([np.interp(t, time, row) for t in passed], axis=0)[(len(behind) - 1) // 2] for row in excess]
    )
    common = np.where(each > FLATS.min_common, each, 0.0)
    rolled = (time - aligned.reference) * aligned.speed - behind
    return np.array([np.max(np.interp(rolled, distance, row, 0.0, 0.0), axis=0) for row in common])


def best_flat_on_wheel(
    passages: Sequence[AlignedPassage], excesses: Sequence[tuple[np.ndarray, np.ndarray]], wheel: int
) -> tuple[float, float, Phases]:
    """The flat on one wheel that explains the band levels of one train best.

    Parameters
    ----------
    passages : sequence of AlignedPassage
        Those of the train.
    excesses : sequence of ((n,) array, (n_sensor, n) array)
        Their ``band_excess``.
    wheel : int
        0 first.

    Returns
    -------
    nats : float
        Its evidence.
    radius : float
        Of the wheel. [m]
    phases : tuple
        (recording, rolling distance to the first impact [m]).
    """
    radius, fits = passages[0].passage.vehicle.wheel_values("radius")[wheel], []
    for share in 1.0 + RADIUS_CHANGES:
        circumference = 2.0 * np.pi * radius * share
        ratios = [_log_ratios(m, *excess, wheel, circumference) for m, excess in zip(passages, excesses)]
        total = sum(_log_mean(r, axis=0) for r in ratios)  # (n_strength * n_decay,)
        fits.append((total, share, ratios))
    totals = np.array([total for total, *_ in fits])
    nats, best_index = _log_mean(totals.ravel(), axis=0), np.unravel_index(int(np.argmax(totals)), totals.shape)
    _, share, ratios = fits[best_index[0]]
    phases = tuple((m.name, float(FLATS.phase_step * np.argmax(r[:, best_index[1]]))) for m, r in zip(passages, ratios))
    return float(nats), float(share * radius), phases


def _log_mean(ratio: np.ndarray, axis: int) -> np.ndarray:
    """Logarithm of the mean of likelihoods, which integrates out the parameter of this axis."""
    top = np.max(ratio, axis=axis)
    return top + np.log(np.mean(np.exp(ratio - np.expand_dims(top, axis)), axis=axis))


def _log_ratios(
    aligned: AlignedPassage, time: np.ndarray, excess: np.ndarray, wheel: int, circumference: float
) -> np.ndarray:
    """(n_phase, n_strength * n_decay) log ratios of one passage."""
    phases = np.arange(0.0, circumference, FLATS.phase_step)
    sign = 1.0 if aligned.passage.direction == "facing" else -1.0
    sensors = np.array([s.place for s in aligned.sensors])
    first = sign * np.min(sign * sensors)
    turns = np.arange(
        np.floor((sensors.min() - FLATS.max_sensor_distance) / circumference) - 1,
        np.ceil((sensors.max() + FLATS.max_sensor_distance) / circumference) + 1,
    )
    position = phases[:, None] + circumference * turns  # (n_phase, n_impact)
    when = (
        aligned.reference + (sign * (position - first) + aligned.passage.vehicle.wheel_positions[wheel]) / aligned.speed
    )
    distance = np.abs(position[..., None] - sensors)
    is_audible = ((when > time[0]) & (when < time[-1]))[..., None] & (distance < FLATS.max_sensor_distance)
    observed = np.stack([np.interp(when, time, row) for row in excess], axis=-1)[is_audible]
    without_impact, heard_from = log_density(observed, 0.0), distance[is_audible]
    ratios, ratio = [], np.zeros(distance.shape)
    for strength in FLATS.strengths:
        for decay in FLATS.decays:
            ratio[is_audible] = log_density(observed, np.maximum(strength - decay * heard_from, 0.0)) - without_impact
            ratios.append(FLATS.sensor_weight * np.sum(ratio, axis=(1, 2)))
    return np.array(ratios).T


def flat_evidence(case: TrackCase) -> list[FlatEvidence]:
    """``FlatEvidence`` of every wheel of every train of a case, the likeliest first.

    Parameters
    ----------
    case : TrackCase
        The case.

    Returns
    -------
    list of FlatEvidence
        The likeliest first.
    """
    evidence = []
    for train in case.trains:
        names = [o.name for o in case.observations if o.name in case.aligned_passages]
        passages = [m for m in (case.aligned_passages[n] for n in names) if m.conditions["train"] == train]
        if not passages:
            continue
        excesses = [band_excess(m) for m in passages]
        for wheel in range(len(passages[0].passage.vehicle.wheels)):
            nats, radius, phases = best_flat_on_wheel(passages, excesses, wheel)
            evidence.append(FlatEvidence(nats, train, wheel, radius, phases))
    return sorted(evidence, key=lambda s: -s.nats)


PHASE_OFFSETS = np.arange(*FLATS.phase_offsets)  # m, trial phases about that of the impacts


def flat_candidates(case: TrackCase, fit: Fit) -> tuple[Candidate, ...]:
    """Candidates of the wheels that most likely have a flat.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        A fit of the case.

    Returns
    -------
    tuple of Candidate
        The likeliest first.
    """
    evidence, explained_trains = (
        flat_evidence(case),
        {c.where.get("train") for c in fit.candidates if "axle" in c.where},
    )
    likely = [
        s for s in evidence if s.nats > FLATS.min_evidence + np.log(len(evidence)) and s.train not in explained_trains
    ]
    likely = [s for s in likely if s.nats > likely[0].nats - FLATS.max_evidence_gap]
    return tuple(_candidate(case, fit, s, evidence) for s in likely[: FLATS.max_wheels])


def _candidate(case: TrackCase, fit: Fit, flat: FlatEvidence, evidence: Sequence[FlatEvidence]) -> Candidate:
    length, phases, gain = _fit_flat(case, fit, flat)
    of_train = {s.wheel: s.nats for s in evidence if s.train == flat.train}
    scanned = len(evidence) * (1.0 + np.ptp(PHASE_OFFSETS) / FLATS.phase_resolution) ** len(phases)
    hypothesis = Hypothesis(
        starts=((length,),),
        fixed={"wheel": flat.wheel, "radius": flat.radius, "train": flat.train, "phases": phases},
        where={"train": flat.train, "axle": flat.wheel + 1},
        n_scanned=scanned,
        promise=float(gain + flat.nats - np.log(scanned)),
        external_evidence=flat.nats,
        rival_axles=rival_axles(of_train, flat.wheel),
    )
    return candidate_of(physics.WheelFlat, hypothesis)


def _fit_flat(case: TrackCase, fit: Fit, flat: FlatEvidence) -> tuple[float, Phases, float]:
    """(length [m], phases, nats) at which the simulated flat explains most of the band, with loss of contact."""
    phases = _fit_phases(case, fit, flat, flat.phases, PHASE_OFFSETS, FLATS.medium_length)
    length, gain = _fit_length(case, fit, flat, phases)
    if gain > 0.0:  # else a flat of no length explains anything
        phases = _fit_phases(case, fit, flat, phases, FLATS.fine_phase_offsets, length)
        length, gain = _fit_length(case, fit, flat, phases)
    return length, phases, max(gain, 0.0)


def _fit_phases(
    case: TrackCase, fit: Fit, flat: FlatEvidence, phases: Phases, offsets: Iterable[float], length: float
) -> Phases:
    """The phases shifted to where a flat of this length explains most."""
    best_phases = []
    for name, phase in phases:
        trials = [
            (_explained_nats(case, fit, flat, name, phase + offset, length), float(phase + offset))
            for offset in offsets
        ]
        best_phases.append((name, max(trials)[1]))
    return tuple(best_phases)


def _fit_length(case: TrackCase, fit: Fit, flat: FlatEvidence, phases: Phases) -> tuple[float, float]:
    """(length, nats) of the length that explains most at these phases."""
    sizes = [(sum(_explained_nats(case, fit, flat, *at, length) for at in phases), length) for length in FLATS.lengths]
    gain, length = max(sizes)
    return length, gain


def _explained_nats(case: TrackCase, fit: Fit, flat: FlatEvidence, name: str, phase: float, length: float) -> float:
    """Nats that a flat explains in one passage, all else as fitted."""
    k = next(i for i, o in enumerate(case.observations) if o.name == name)
    o = case.observations[k]
    term = physics.WheelFlat(flat.wheel, length, flat.radius, phase, flat.train)
    try:
        (predicted,) = case.predict(fit.values, (*fit.terms, term), [o])
    except SimulationError:
        return -np.inf
    before, after = (float(np.sum(o.whiten(o.data - p) ** 2)) for p in (fit.predictions[k], predicted))
    return 0.5 * o.effective / fit.scale[o.data_type] * (before - after)
