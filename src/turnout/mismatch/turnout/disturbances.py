"""Detect passages in which another source shakes the sensors, from the signal before and after the train.

The mean square of a quiet segment in a band of width W over a time T is chi-squared with 2 W T degrees of freedom, so
that the ratio of one passage to the others follows Fisher's F. Half of the sensors must show it: a single noisy channel
is another matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import binom, f

from turnout.mismatch.turnout.priors import DISTURBANCE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from turnout.mismatch.turnout.passage_observation import AlignedPassage


@dataclass(frozen=True)
class Disturbance:
    """A disturbed passage: its segment ``when`` "before" or "after" the train exceeds the others by ``excess`` [dB].

    ``p`` is the probability of that by chance, over all segments tested.
    """

    name: str
    when: str
    excess: float
    p: float


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
        Passages in which another source shook the sensors.
    """
    events: list[Disturbance] = []
    segments: dict[str, dict[str, tuple[dict[str, float], float]]] = {"before": {}, "after": {}}
    for aligned in (*passages.values(), *(unmatched or {}).values()):
        for when, (start, stop) in _quiet_segments(aligned).items():
            if when == "after" and aligned.name in (unmatched or {}):
                start += DISTURBANCE.car_length / aligned.speed
            if stop - start >= DISTURBANCE.min_quiet_time:
                segments[when][aligned.name] = _level(aligned, start, stop)
    n_segments = sum(len(s) for s in segments.values() if len(s) > 2)
    for when, levels in segments.items():
        for name in levels if len(levels) > 2 else ():
            excess, p = excess_over(*_shared_levels(levels, name))
            if excess > DISTURBANCE.min_excess and p * n_segments < DISTURBANCE.max_chance:
                events.append(Disturbance(name, when, excess, min(1.0, p * n_segments)))
    return events


def _quiet_segments(aligned: AlignedPassage) -> dict[str, tuple[float, float]]:
    """(start, stop) of the segments with every wheel far from every sensor [s]."""
    train = np.ptp([s.place for s in aligned.sensors]) + aligned.passage.vehicle.wheel_positions[-1]
    clear_time = DISTURBANCE.min_wheel_distance / aligned.speed
    end = aligned.passage.recording.duration
    return {
        "before": (DISTURBANCE.record_margin, aligned.reference - clear_time),
        "after": (aligned.reference + train / aligned.speed + clear_time, end - DISTURBANCE.record_margin),
    }


def _shared_levels(
    levels: Mapping[str, tuple[dict[str, float], float]], name: str
) -> tuple[tuple[np.ndarray, float], list[tuple[np.ndarray, float]]]:
    """Level of a passage and those of the others, for the sensors that it shares; nan where another lacks one."""
    own_levels, freedom = levels[name]
    remaining = [level for passage, level in levels.items() if passage != name]
    sensors = [s for s in own_levels if any(s in power for power, _ in remaining)]
    reference = [(np.array([power.get(s, np.nan) for s in sensors]), n) for power, n in remaining]
    return (np.array([own_levels[s] for s in sensors]), freedom), reference


def _level(aligned: AlignedPassage, start: float, stop: float) -> tuple[dict[str, float], float]:
    """Mean square in the band by sensor, and its degrees of freedom."""
    recording = aligned.passage.recording
    rows = [recording.index(s.name) for s in aligned.sensors]
    first, last = int(start * recording.rate), int(stop * recording.rate)
    level, freedom = band_level(recording.samples[rows][:, first:last], recording.rate)
    return {s.name: float(v) for s, v in zip(aligned.sensors, level)}, freedom


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
    tail = float(f.sf(middle, freedom, np.median([n for _, n in reference])))
    return 10.0 * float(np.log10(max(middle, 1e-300))), float(binom.sf(ratio.size - rank - 1, ratio.size, tail))
