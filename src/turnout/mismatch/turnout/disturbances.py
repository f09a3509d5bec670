"""Detect passages in which another source shakes the sensors, from the signal before and after the train.

A train shakes the sensors also from afar, the more the nearer and the rougher its wheels are. So stretches with the
nearest wheel equally far away are compared, and their level relative to that while the same train passes as well. The
mean square of a stretch in a band of width W over a time T is chi-squared with 2 W T degrees of freedom, so that the
ratio of one passage to the others follows Fisher's F. Half of the sensors must show it: a single noisy channel is
another matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.mismatch.turnout.priors import DISTURBANCE

if TYPE_CHECKING:
    from turnout.mismatch.turnout.passage_observation import AlignedPassage


@dataclass(frozen=True)
class Disturbance:
    """A disturbed passage: a stretch ``when`` "before" or "after" the train exceeds the others by ``excess`` [dB].

    ``p`` is the probability of that by chance, over all stretches tested. ``train`` is its type or number.
    """

    name: str
    when: str
    excess: float
    p: float
    train: str = ""


def independent_of_trains(events: Sequence[Disturbance]) -> tuple[Disturbance, ...]:
    """The disturbed passages, if they show a source that no train carries with it; else none.

    One passage alone may be louder for a reason of its own: its train rings for longer, or is longer than its file. So
    two trains are needed. Beyond what trains differ by, two passages of one train are enough, or one passage in which
    the sensors shake before any wheel arrives.

    Parameters
    ----------
    events : sequence of Disturbance
        All disturbed passages.

    Returns
    -------
    tuple of Disturbance
        All of them, or none.

    Examples
    --------
    >>> after = [Disturbance("p1", "after", 5.0, 1e-9, "ic3"), Disturbance("p2", "after", 6.0, 1e-9, "ic3")]
    >>> len(independent_of_trains(after)), len(independent_of_trains([*after, Disturbance("p3", "after", 4, 0, "re")]))
    (0, 3)
    """
    plain = [e for e in events if e.excess > DISTURBANCE.train_difference]
    is_shared = len({e.train or e.name for e in events}) > 1 or len(plain) > 1
    return tuple(events) if is_shared or any(e.when == "before" for e in plain) else ()


# One stretch of one passage: mean square by sensor, the same over that while the train passes, degrees of freedom.
Level = tuple[dict[str, float], dict[str, float], float]


def disturbances(
    passages: Mapping[str, AlignedPassage], unmatched: Mapping[str, AlignedPassage] | None = None
) -> list[Disturbance]:
    """Disturbance of every passage in which another source shook the sensors; ``passages`` by name.

    ``unmatched`` passages do not match their vehicle file, maybe for that reason. Their trains may be longer by a car.

    Parameters
    ----------
    passages : mapping
        Passages that match their vehicle file, by name.
    unmatched : mapping or None
        Passages that do not, maybe for that reason.

    Returns
    -------
    list of Disturbance
        Passages in which another source shook the sensors, each with the stretch that shows it most.
    """
    stretches: dict[tuple[str, float], dict[str, Level]] = {}
    aligned_passages = {a.name: a for a in (*passages.values(), *(unmatched or {}).values())}
    for aligned in aligned_passages.values():
        extra = DISTURBANCE.car_length if aligned.name in (unmatched or {}) else 0.0
        for stretch, (start, stop) in _quiet_stretches(aligned, extra).items():
            if stop - start >= DISTURBANCE.min_quiet_time:
                stretches.setdefault(stretch, {})[aligned.name] = _level(aligned, start, stop)
    compared = {stretch: levels for stretch, levels in stretches.items() if len(levels) > 2}
    n_tests = sum(len(levels) for levels in compared.values())
    strongest: dict[str, Disturbance] = {}
    for (when, _), levels in compared.items():
        for name in levels:
            excess, p = _excess_of(levels, name)
            event = Disturbance(name, when, excess, min(1.0, p * n_tests), aligned_passages[name].train)
            is_disturbed = excess > DISTURBANCE.min_excess and event.p < DISTURBANCE.max_chance
            if is_disturbed and (name not in strongest or excess > strongest[name].excess):
                strongest[name] = event
    return list(strongest.values())


def _quiet_stretches(aligned: AlignedPassage, extra: float) -> dict[tuple[str, float], tuple[float, float]]:
    """{(when, least distance of a wheel from the sensors [m]): (start, stop) [s]}; ``extra`` [m] behind the train."""
    train = np.ptp([s.place for s in aligned.sensors]) + aligned.passage.vehicle.wheel_positions[-1] + extra
    first, last = DISTURBANCE.record_margin, aligned.passage.recording.duration - DISTURBANCE.record_margin
    speed, begin, end = aligned.speed, aligned.reference, aligned.reference + train / aligned.speed
    stretches = {}
    for near, far in pairwise((*DISTURBANCE.wheel_distances, np.inf)):
        stretches["before", near] = (max(first, begin - far / speed), min(last, begin - near / speed))
        stretches["after", near] = (max(first, end + near / speed), min(last, end + far / speed))
    return stretches


def _excess_of(levels: Mapping[str, Level], name: str) -> tuple[float, float]:
    """Excess of a passage over others [dB] and its chance: in level, or relative to its train, whichever is less."""
    absolute = {passage: (level, freedom) for passage, (level, _, freedom) in levels.items()}
    relative = {passage: (level, freedom) for passage, (_, level, freedom) in levels.items()}
    outcomes = [excess_over(*_shared_levels(values, name)) for values in (absolute, relative)]
    return min(excess for excess, _ in outcomes), max(p for _, p in outcomes)


def _shared_levels(
    levels: Mapping[str, tuple[dict[str, float], float]], name: str
) -> tuple[tuple[np.ndarray, float], list[tuple[np.ndarray, float]]]:
    """Level of a passage and those of the others, for the sensors that it shares; nan where another lacks one."""
    own_levels, freedom = levels[name]
    remaining = [level for passage, level in levels.items() if passage != name]
    sensors = [s for s in own_levels if any(s in power for power, _ in remaining)]
    reference = [(np.array([power.get(s, np.nan) for s in sensors]), n) for power, n in remaining]
    return (np.array([own_levels[s] for s in sensors]), freedom), reference


def _level(aligned: AlignedPassage, start: float, stop: float) -> Level:
    """Mean square in the band by sensor, alone and over that while the train passes, and its degrees of freedom."""
    recording = aligned.passage.recording
    rows = [recording.index(s.name) for s in aligned.sensors]
    leaves = aligned.reference + aligned.passage.vehicle.wheel_positions[-1] / aligned.speed

    def mean_square(start: float, stop: float) -> tuple[np.ndarray, float]:
        first, last = int(max(0.0, start) * recording.rate), int(stop * recording.rate)
        return band_level(recording.samples[rows][:, first:last], recording.rate)

    (level, freedom), (passing, _) = mean_square(start, stop), mean_square(aligned.reference, leaves)
    names = [s.name for s in aligned.sensors]
    relative = level / np.maximum(passing, 1e-300)
    return dict(zip(names, level.tolist())), dict(zip(names, relative.tolist())), freedom


def band_level(samples: np.ndarray, rate: float) -> tuple[np.ndarray, float]:
    """Mean square of rows of ``samples`` within ``DISTURBANCE.band`` per line (n,), and its degrees of freedom.

    A Hann window keeps the strong low frequencies at the end of the segment out. It correlates neighbouring lines by
    2/3 and 1/6, so that two degrees per line become 2 / (1 + 2 (4/9 + 1/36)) (Welch 1967).

    Parameters
    ----------
    samples : (n, n_sample) array of float
        Signals of a segment, one per row.
    rate : float
        Samples per second. [Hz]

    Returns
    -------
    level : (n,) array of float
        Mean square per line, of each row.
    freedom : float
        Its degrees of freedom.
    """
    n = samples.shape[1]
    window = np.hanning(n)
    spectrum = np.fft.rfft((samples - samples.mean(axis=1, keepdims=True)) * window, axis=1)
    grid = np.fft.rfftfreq(n, 1.0 / rate)
    inside = (grid >= DISTURBANCE.band[0]) & (grid <= DISTURBANCE.band[1])
    level = np.mean(np.abs(spectrum[:, inside]) ** 2, axis=1) / np.sum(window**2)
    return level, 2.0 * inside.sum() / DISTURBANCE.hann_correlation


def excess_over(level: tuple[np.ndarray, float], reference: Sequence[tuple[np.ndarray, float]]) -> tuple[float, float]:
    """Excess of a segment over others, and the probability of that by chance.

    The excess is the lower median over the sensors of the ratio to the median of the others. The probability is
    binomial, that as many sensors exceed the F ratio at that rank.

    Parameters
    ----------
    level : ((n,) array of float, float)
        Mean square of each sensor, and its degrees of freedom.
    reference : sequence of the same
        The other segments.

    Returns
    -------
    excess : float
        Over the others. [dB]
    p : float
        Probability of that by chance.
    """
    power, freedom = level
    if power.size < 2:  # one channel alone may be noisy
        return 0.0, 1.0
    usual = np.nanmedian([p for p, _ in reference], axis=0)
    ratio = np.sort(power / np.maximum(usual, 1e-300))
    rank = (ratio.size - 1) // 2
    middle = float(ratio[rank])
    tail = float(scipy.stats.f.sf(middle, freedom, np.median([n for _, n in reference])))
    return 10.0 * float(np.log10(max(middle, 1e-300))), float(
        scipy.stats.binom.sf(ratio.size - rank - 1, ratio.size, tail)
    )
