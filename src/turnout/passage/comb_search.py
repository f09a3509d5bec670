"""Search the known train and its speed: combs of all rows of vehicles are fitted, and the likeliest row is taken.

A row is rejected where the sensors record as much before or behind it as along it: the train is longer than the row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import KMH
from turnout.passage.axle_patterns import Pattern, offsets
from turnout.passage.comb import Comb, evidence, explained_share, profiles_at, teeth_of
from turnout.passage.kinematics import Motion
from turnout.passage.vehicle_sequence import likeliest_row

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.passage import PassageSettings
    from turnout.passage.axle_patterns import Vehicle
    from turnout.passage.sensor_envelopes import SensorEnvelopes

BEYOND_START, BEYOND_END = 5.0, 27.0  # m beyond the last wheel, where wheels of a further vehicle would be
# Share of the mean amplitude along the row above which a further vehicle runs there. In 68 simulated cases of one
# sensor it is at most 0.21 without one; the bogies of a locomotive have at least 0.75 of the amplitude of coaches.
MIN_BEYOND_AMPLITUDE = 0.6


def continues_beyond(envelopes: SensorEnvelopes, motion: Motion, first: float, length: float) -> bool:
    """Whether the sensors record more than ``MIN_BEYOND_AMPLITUDE`` times the row's own amplitude beyond either end.

    A row that is a part of the train fits that part as well as the train's own row does. It fits better where the
    remaining vehicles vibrate differently: coaches without their locomotive.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the row.
    first : float
        The row's first axle, in the motion's own coordinate. [m]
    length : float
        From the first axle to the last one. [m]

    Returns
    -------
    bool
        True where the row is a part of a longer train.
    """
    stretches = (
        np.array([[0.0, length], [-BEYOND_END, -BEYOND_START], [length + BEYOND_START, length + BEYOND_END]]) + first
    )
    along, before, behind = np.mean(
        [_mean_amplitudes(envelopes, i, motion, stretches) for i in range(len(envelopes.positions))], 0
    )
    return bool(max(before, behind) > MIN_BEYOND_AMPLITUDE * along)


def _mean_amplitudes(envelopes: SensorEnvelopes, i: int, motion: Motion, stretches: np.ndarray) -> np.ndarray:
    """(n_stretch,) mean amplitude of sensor ``i`` above its quiet level; 0 where nothing was recorded."""
    amplitude, step = envelopes.levels.amplitude[i], envelopes.levels.step
    above = np.clip(amplitude - np.quantile(amplitude, 0.05), 0.0, None)
    total = np.concatenate([[0.0], np.cumsum(above)]) * step
    times = motion.passing(stretches, envelopes.positions[i])
    inside = np.interp(times, np.arange(total.size) * step, total)
    return np.diff(inside, axis=1)[:, 0] / np.maximum(np.diff(times, axis=1)[:, 0], step)


SPEED_STEP = 0.003  # relative step between the speeds that are tried
COARSE_ERROR = 0.5  # m, error of the first search over the length of the row
MAX_ENVELOPE_MARGIN = 75.0  # m, most that is audible before the first and behind the last axle together
BEND_STEP = 0.15  # m, step of the middle against the ends between accelerations; also its limit in m/s²
MAX_EXCESS_LENGTH = 2.0  # m by which a row may exceed the audible length
MAX_PASSES = 3  # of the refinement of a row
N_REFINED = 3  # rows of a type that are refined


@dataclass(frozen=True)
class FittedRow:
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
def uniform_rows(patterns: tuple[Pattern, ...]) -> tuple:
    """(pattern, vehicles, comb) of every row in which each group has vehicles of one type only.

    Parameters
    ----------
    patterns : tuple of Pattern
        Axle patterns of known trains.

    Returns
    -------
    tuple of (Pattern, tuple of Vehicle, Comb)
        Rows of four axles or more, each once.
    """
    rows = {}
    for pattern in patterns:
        groups = []
        for g in pattern.groups:
            counts = range(max(g.minimum, 1), g.maximum + 1)
            groups.append([()] * (g.minimum == 0) + [(v,) * n for n in counts for v in g.vehicles])
        for selection in product(*groups):
            row = tuple(v for members in selection for v in members)
            if sum(len(v.axles) for v in row) >= 4:
                rows[pattern.type, tuple((v.length, v.axles) for v in row)] = (pattern, row)
    return tuple((pattern, row, Comb.of(offsets(row))) for pattern, row in rows.values())


def motions_at_all_speeds(begin: float, settings: PassageSettings) -> list[Motion]:
    """Motions at all speeds of trains, ``SPEED_STEP`` apart, with the first axle at 0 at the time ``begin`` [s].

    Parameters
    ----------
    begin : float
        Time at which the first axle is at the origin. [s]
    settings : PassageSettings
        Slowest and fastest train.

    Returns
    -------
    list of Motion
        Steady motions, the slowest first.
    """
    slow, fast = settings.speed_minimum / KMH, settings.speed_maximum / KMH
    return [Motion(float(v), begin) for v in np.geomspace(slow, fast, int(np.log(fast / slow) / SPEED_STEP))]


def choices_of(pattern: Pattern, row: tuple[Vehicle, ...]) -> float:
    """Logarithm of the largest number of rows with as many vehicles that the pattern allows.

    Parameters
    ----------
    pattern : Pattern
        Axle pattern of a type of train.
    row : tuple of Vehicle
        A row of the pattern.

    Returns
    -------
    float
        Logarithm of the number of rows. [nat]
    """
    n_choices = max(len(g.vehicles) for g in pattern.groups)
    return float(np.log(n_choices) * len(row)) if len({v.name for v in row}) > 2 else float(np.log(n_choices))


def likeliest_rows(
    envelopes: SensorEnvelopes, motions: Sequence[Motion], patterns: tuple[Pattern, ...]
) -> dict[str, FittedRow]:
    """Type -> its likeliest row of vehicles, out of ``motions`` in order of their speed, ``SPEED_STEP`` apart.

    A row is left out where the train continues beyond its ends.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motions : sequence of Motion
        Motions that are tried, in order of their speed.
    patterns : tuple of Pattern
        Axle patterns of known trains.

    Returns
    -------
    dict
        Type -> FittedRow.
    """
    profiles = profiles_at(envelopes, motions)
    n_sensor = len(envelopes.positions)
    coarse: dict[str, list[FittedRow]] = {}
    for pattern, row, comb in uniform_rows(patterns):
        span = comb.offsets[-1]
        indices = np.flatnonzero(
            (profiles.length > span - MAX_EXCESS_LENGTH) & (profiles.length < span + MAX_ENVELOPE_MARGIN)
        )
        indices = indices[:: max(int(COARSE_ERROR / span / SPEED_STEP), 1)]
        if not indices.size:
            continue
        share, starts = explained_share(profiles, comb, indices, stride=4)
        log_evidence = evidence(share.max(axis=1), profiles.length[indices], n_sensor) - choices_of(pattern, row)
        k = int(np.argmax(log_evidence))
        start = float(starts[int(np.argmax(share[k]))])
        fitted = FittedRow(
            pattern, row, comb, profiles.motions[indices[k]], start, float(share[k].max()), float(log_evidence[k])
        )
        coarse.setdefault(pattern.type, []).append(fitted)
    likeliest_by_type = {}
    for type_, rows in coarse.items():
        rows = sorted(rows, key=lambda f: -f.evidence)[:N_REFINED]
        refined = [
            f
            for f in (refine_row(envelopes, f) for f in rows)
            if not continues_beyond(envelopes, f.motion, *_row_extent(envelopes, f))
        ]
        if refined:
            likeliest_by_type[type_] = max(refined, key=lambda f: f.evidence)
    return likeliest_by_type


def refine_row(envelopes: SensorEnvelopes, fitted: FittedRow) -> FittedRow:
    """The row with refined speed and, where the pattern allows a choice, refined vehicles, in turn.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    fitted : FittedRow
        The row of vehicles.

    Returns
    -------
    FittedRow
        With at least the evidence of ``fitted``.
    """
    fitted = refine_motion(envelopes, fitted, 0.006)
    for _ in range(MAX_PASSES):
        better = _refine_vehicles(envelopes, fitted)
        better = refine_motion(envelopes, better, 0.004) if better is not fitted else fitted
        if better.evidence <= fitted.evidence:
            break
        fitted = better
    return fitted


def _row_extent(envelopes: SensorEnvelopes, fitted: FittedRow) -> tuple[float, float]:
    """The row's first axle in its motion's own coordinate, and its length. [m]"""
    centre = fitted.motion.direction * float(np.mean(envelopes.positions))
    return float(fitted.motion.distance(envelopes.begin)) - centre + fitted.start, float(fitted.comb.offsets[-1])


def motion_at_middle(envelopes: SensorEnvelopes, fitted: FittedRow) -> Motion:
    """The motion relative to the row's middle: ``start`` when it passes the middle of the sensors, ``speed`` then.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    fitted : FittedRow
        The row of vehicles.

    Returns
    -------
    Motion
        The same motion with its speed and origin at the middle of the train.
    """
    motion, centre = fitted.motion, fitted.motion.direction * float(np.mean(envelopes.positions))
    first, length = _row_extent(envelopes, fitted)
    middle = float(motion.time(first + 0.5 * length + centre))
    return replace(motion, speed=float(motion.speed_at(middle)), start=middle)


def refine_motion(envelopes: SensorEnvelopes, fitted: FittedRow, reach: float) -> FittedRow:
    """The same row at the best speed within ``reach`` (relative) and the best acceleration near its own.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    fitted : FittedRow
        The row of vehicles.
    reach : float
        Largest relative change of the speed. [-]

    Returns
    -------
    FittedRow
        ``fitted`` itself where nothing is better.
    """
    middle = motion_at_middle(envelopes, fitted)
    acceleration_step = 16.0 * BEND_STEP / (fitted.comb.offsets[-1] / middle.speed) ** 2
    accelerations = middle.acceleration + min(acceleration_step, BEND_STEP) * np.arange(-2, 3)
    speeds = middle.speed * (1.0 + np.linspace(-reach, reach, 9))
    motions = [replace(middle, speed=v, acceleration=a) for a in accelerations for v in speeds]
    profiles = profiles_at(envelopes, motions)
    share, starts = explained_share(profiles, fitted.comb, np.arange(len(motions)))
    k, s = np.unravel_index(int(np.argmax(share)), share.shape)
    log_evidence = evidence(share[k, s], profiles.length[k], len(envelopes.positions))
    log_evidence -= choices_of(fitted.pattern, fitted.vehicles)
    if log_evidence <= fitted.evidence:
        return fitted
    return replace(
        fitted, motion=motions[k], start=float(starts[s]), share=float(share[k, s]), evidence=float(log_evidence)
    )


def _refine_vehicles(envelopes: SensorEnvelopes, fitted: FittedRow) -> FittedRow:
    """The row that fits best with the tooth of this one; unchanged where the pattern allows no choice."""
    if fitted.pattern.fixed_row() is not None:
        return fitted
    profiles = profiles_at(envelopes, [fitted.motion])
    teeth, _ = teeth_of(profiles, fitted.comb, fitted.start)
    better = likeliest_row(profiles, teeth, fitted.pattern, fitted.start)
    if better is None or better[0] == fitted.vehicles or sum(len(v.axles) for v in better[0]) < 4:
        return fitted
    comb = Comb.of(offsets(better[0]))
    share, starts = explained_share(profiles, comb, np.arange(1))
    k = int(np.argmax(share[0]))
    log_evidence = evidence(share[0, k], profiles.length[0], len(envelopes.positions))
    log_evidence -= choices_of(fitted.pattern, better[0])
    return FittedRow(
        fitted.pattern, better[0], comb, fitted.motion, float(starts[k]), float(share[0, k]), float(log_evidence)
    )
