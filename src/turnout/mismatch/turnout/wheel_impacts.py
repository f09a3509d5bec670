r"""Impacts that wheels cause at one position, or those of one train: a loose part, a short defect, or a bad wheel.

Waves of the surface shorter than the contact patch do not move a wheel, so that rolling causes little above some
1.7 kHz. Steel that collides with steel does, for a millisecond, whenever a wheel passes. No law of it is needed. With E
the energy of a bin of time at a sensor,

.. math:: \ln E = a_{passage} + b_{sensor} + g(\text{distance of the nearest wheel}) + e

by medians, so that each passage is compared with the rest of itself, and each sensor with itself. A wheel at a position
counts with the quieter one of the two sensors next to it: a fault of a channel is in one. The level of a position is
what the fifth loudest wheel exceeds there, each in its loudest passage. A flat belongs to one wheel, and its impacts
are anywhere, also while other wheels of its train are at a position. So impacts belong to a train if its wheels alone
have that level, and those of the other trains have none anywhere; else they belong to the position. Bins in which any
wheel is near a joint, a nose or a blade of the track file do not count at any position.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.ambiguity import Ambiguity
from turnout.mismatch.turnout.defect_priors import IMPACTS
from turnout.signal.filters import band_pass

if TYPE_CHECKING:
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.mismatch.turnout.passage_observation import AlignedPassage

EXPLANATIONS = "a part that rattles, a loose fastening, or a joint or short defect of the running surface"


@dataclass(frozen=True)
class ImpactSignal:
    """Logarithm of the energy of one passage in bins of time, above the rolling of wheels.

    ``level`` is (n_sensor, n_bin), ``sensors`` their names, ``positions`` their positions [m]; ``wheels`` (n_bin,
    n_wheel) are the positions of the wheels, and ``lag`` that of an impact behind its cause, positive with it [m].
    ``is_free`` (n_bin,) where no wheel is near a known irregularity.
    """

    train: str
    level: np.ndarray
    sensors: tuple[str, ...]
    positions: np.ndarray
    wheels: np.ndarray
    lag: float
    is_free: np.ndarray

    def distances(self) -> np.ndarray:
        """(n_sensor, n_bin) distance of the nearest wheel from each sensor. [m]"""
        return np.min(np.abs(self.wheels[None] - self.positions[:, None, None]), axis=2)


@dataclass(frozen=True)
class ImpactLevels:
    """Levels over those of rolling, logarithms of energy, at ``positions`` (n,) along the track [m].

    ``of_all`` (n,) is what several wheels exceed, ``common`` (n,) the same whichever train is left out, and ``own``
    train -> (n,) the same for the wheels of this train alone. ``mean`` (n,) is that of all wheels.
    """

    positions: np.ndarray
    common: np.ndarray
    of_all: np.ndarray
    own: dict[str, np.ndarray]
    mean: np.ndarray

    def evidence(self) -> float:
        """Evidence for impacts of wheels, of any trains, at one of the positions. [nats]"""
        return _evidence(self.of_all)

    def train(self) -> str | None:
        """The train whose wheels alone cause the impacts. None if several trains cause them at one position."""
        loudest = max(self.own, key=lambda train: float(np.max(self.own[train])))
        return loudest if _evidence(self.common) <= 0.0 < _evidence(self.own[loudest]) else None

    def position(self) -> float:
        """Where the mean of all wheels is loudest. [m]"""
        return float(self.positions[np.argmax(self.mean)])


def _evidence(levels: np.ndarray) -> float:
    """Evidence for impacts at one of the positions, all equally probable before, by their ``levels`` (n,). [nats]"""
    z, ratio = np.maximum(levels - IMPACTS.level, 0.0), (IMPACTS.impact_sd / IMPACTS.level_sd) ** 2
    nats = 0.5 * (z / IMPACTS.level_sd) ** 2 * ratio / (1.0 + ratio) - 0.5 * np.log1p(ratio)
    return float(np.logaddexp.reduce(nats) - np.log(nats.size))


def wheel_impacts(case: TrackCase) -> Ambiguity | None:
    """Impacts that the wheels of all fitted passages cause at one position, or those of one train alone.

    Parameters
    ----------
    case : TrackCase
        The case.

    Returns
    -------
    Ambiguity or None
        None without enough wheels and sensors, in the panel of a switch, or where intact track is likelier.
    """
    levels = impact_levels(impact_signals(case))
    if levels is None or not levels.evidence() > 0.0:  # nan where a channel has none
        return None
    train = levels.train()
    return _at_position(levels) if train is None else _of_train(levels, train)


def _at_position(levels: ImpactLevels) -> Ambiguity:
    position = levels.position()
    words = f"wheels cause impacts there: {_excess_in_words(levels)}. The cause may be {EXPLANATIONS}"
    measurement = "the running surface there, and look for loose parts of fastenings and guard rail"
    low, high = position - IMPACTS.position_error, position + IMPACTS.position_error
    return Ambiguity(levels.evidence(), words, measurement, "place", f"{position:.2f} m", low, high)


def _of_train(levels: ImpactLevels, train: str) -> Ambiguity:
    others = "and those of no other train do" if len(levels.own) > 1 else "and no other train was used"
    near = f"near {levels.position():.1f} m"
    words = (
        f"wheels of {train} cause impacts, {others}: {_excess_in_words(levels)}. "
        f"The cause may be a defect of a wheel, or {near} "
    )
    measurement = f"the wheels of {train}, and look for loose parts {near}"
    return Ambiguity(levels.evidence(), words + EXPLANATIONS, measurement, "train", train)


def _excess_in_words(levels: ImpactLevels) -> str:
    """The highest level over that of rolling, in words."""
    decibels = 10.0 / np.log(10.0) * float(np.max(levels.of_all))
    return f"their level above {1e-3 * IMPACTS.low_frequency:.1f} kHz exceeds that of rolling by {decibels:.0f} dB"


def impact_signals(case: TrackCase) -> list[ImpactSignal]:
    """Signals of the fitted passages.

    Parameters
    ----------
    case : TrackCase
        The case.

    Returns
    -------
    list of ImpactSignal
        [] in the panel of a switch, where a blade takes over every wheel. Passages whose sampling rate is too low or
        that fewer than two sensors recorded are left out.
    """
    turnout = case.predictor.zone.turnout
    if any(t.blade is not None for t in (turnout.track, *turnout.tracks.values())):
        return []
    accepted = case.accepted.terms({n.name: n.mean for n in case.accepted.nuisances})
    signals = []
    for aligned in case.fitted_passages():
        surfaces = turnout.surfaces(aligned.passage.route)
        stretches = list(_known_stretches([*itertools.chain(*surfaces), *accepted]))
        top = IMPACTS.max_frequency_share * aligned.passage.recording.rate
        if top >= IMPACTS.least_width * IMPACTS.low_frequency and len(aligned.sensors) > 1:
            signals.append(_signal(aligned, min(top, IMPACTS.high_frequency), stretches))
    return signals


def impact_levels(signals: Sequence[ImpactSignal]) -> ImpactLevels | None:
    """Levels of impacts along the track.

    Parameters
    ----------
    signals : sequence of ImpactSignal
        Signals of passages.

    Returns
    -------
    ImpactLevels or None
        None for fewer wheels than must agree.
    """
    sensors = sorted({x for s in signals for x in s.positions.tolist()})
    if not sensors:
        return None
    grid = np.arange(sensors[0] - IMPACTS.margin, sensors[-1] + IMPACTS.margin, IMPACTS.position_step)
    loudest: dict[tuple[str, int], np.ndarray] = {}
    levels = [_wheel_levels(s, excess, grid) for s, excess in zip(signals, _excess_levels(signals))]
    for signal, rows in zip(signals, levels):
        for wheel, row in enumerate(rows):
            key = signal.train, wheel
            loudest[key] = np.maximum(loudest.get(key, row), row)
    if len(loudest) < IMPACTS.min_wheels:
        return None
    by_train: dict[str, list[np.ndarray]] = {}
    for (train, _), row in sorted(loudest.items(), key=lambda item: item[0]):
        by_train.setdefault(train, []).append(row)
    without = [[row for other in by_train if other != train for row in by_train[other]] for train in by_train]
    return ImpactLevels(
        grid,
        np.min([_level_of_fifth(rows, grid.size) for rows in without], axis=0),
        _level_of_fifth(list(loudest.values()), grid.size),
        {train: _level_of_fifth(rows, grid.size) for train, rows in by_train.items()},
        np.concatenate(levels).mean(axis=0),
    )


def _level_of_fifth(rows: Sequence[np.ndarray], n_position: int) -> np.ndarray:
    """(n_position,) levels that as many wheels exceed as must agree, or all if they are fewer; 0, rolling, of none."""
    return np.sort(rows, axis=0)[-min(IMPACTS.min_wheels, len(rows))] if rows else np.zeros(n_position)


def _signal(aligned: AlignedPassage, top: float, stretches: Iterable[tuple[float, float]]) -> ImpactSignal:
    recording = aligned.passage.recording
    rows = [recording.index(s.name) for s in aligned.sensors]
    fold = max(1, round(IMPACTS.bin_time * recording.rate))
    samples = recording.samples[rows].astype(float)
    power = band_pass(samples, IMPACTS.low_frequency, top, recording.rate, zero_phase=True) ** 2
    n = power.shape[1] // fold
    energy = power[:, : n * fold].reshape(len(rows), n, fold).mean(axis=2)
    sign = 1.0 if aligned.passage.direction == "facing" else -1.0
    wheels = aligned.positions((np.arange(n) + 0.5) * fold / recording.rate).T
    is_free = np.ones(n, dtype=bool)
    for low, high in stretches:
        first, last = (low, high) if sign > 0.0 else (-high, -low)
        is_near = (sign * wheels > first - IMPACTS.before_known) & (sign * wheels < last + IMPACTS.behind_known)
        is_free &= ~np.any(is_near, axis=1)
    names, positions = tuple(s.name for s in aligned.sensors), np.array([s.place for s in aligned.sensors])
    return ImpactSignal(aligned.train, np.log(energy + 1e-12), names, positions, wheels, sign * IMPACTS.lag, is_free)


def _known_stretches(shapes: Iterable[Any]) -> Iterator[tuple[float, float]]:
    """(first, last) position of each joint, dip, nose or other shape that the track file or an accepted effect has."""
    for shape in shapes:
        if hasattr(shape, "places"):
            yield min(shape.places), max(shape.places)
        elif isinstance(getattr(shape, "place", None), (int, float)):
            yield shape.place, shape.place


def _excess_levels(signals: Sequence[ImpactSignal]) -> list[np.ndarray]:
    """(n_sensor, n_bin) levels of each signal over those of its passage, its sensors and the distance of its wheels."""
    edges = np.array(IMPACTS.distances)
    bins = [np.digitize(s.distances(), edges) - 1 for s in signals]
    counts = [(b < edges.size - 1) & s.is_free for b, s in zip(bins, signals)]
    passage, rolling = np.zeros(len(signals)), np.zeros(edges.size)
    sensor = {name: 0.0 for s in signals for name in s.sensors}

    def excess(k: int) -> np.ndarray:
        s = signals[k]
        return s.level - passage[k] - np.array([sensor[n] for n in s.sensors])[:, None] - rolling[bins[k]]

    for _ in range(IMPACTS.n_sweeps):
        for k, count in enumerate(counts):
            passage[k] += _median(excess(k)[count])
        levels = [excess(k) for k in range(len(signals))]
        for name in sensor:
            rows = [(k, s.sensors.index(name)) for k, s in enumerate(signals) if name in s.sensors]
            sensor[name] += _median(np.concatenate([levels[k][i, counts[k][i]] for k, i in rows]))
        levels = [excess(k) for k in range(len(signals))]
        for distance in range(edges.size - 1):
            values = [level[count & (b == distance)] for level, count, b in zip(levels, counts, bins)]
            rolling[distance] += _median(np.concatenate(values))
    return [excess(k) for k in range(len(signals))]


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if values.size else 0.0


def _wheel_levels(signal: ImpactSignal, excess: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """(n_wheel, n_position) mean excess while a wheel is at a position, of the quieter of the two sensors beside it.

    That of rolling, 0, where it is never there.
    """
    ratio, levels = np.exp(excess), np.zeros((signal.wheels.shape[1], grid.size))
    for i, position in enumerate(grid):
        beside = np.argsort(np.abs(signal.positions - position))[:2]
        is_there = (np.abs(signal.wheels - signal.lag - position) < IMPACTS.half_window) & signal.is_free[:, None]
        n = is_there.sum(axis=0)
        mean = np.min(ratio[beside] @ is_there, axis=0) / np.maximum(n, 1)
        levels[:, i] = np.where(n > 0, np.log(np.maximum(mean, 1e-12)), 0.0)
    return levels
