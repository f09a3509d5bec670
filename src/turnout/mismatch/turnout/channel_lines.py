"""Lines that a channel shows where no wheel is near: the mains, and any other steady source.

A steady line beside the train is there during the train as well. Whatever its law, it is an error of that channel: the
track does not vibrate there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.ambiguity import Ambiguity
from turnout.mismatch.turnout.priors import PASSAGE

if TYPE_CHECKING:
    from turnout.mismatch.turnout.case import TrackCase


@dataclass(frozen=True)
class SteadyLine:
    """Line of one channel in one recording: ``frequency`` [Hz], ``rms`` [m/s²] and ``evidence`` for it [nats]."""

    frequency: float
    rms: float
    evidence: float


def mains_lines(samples: np.ndarray, time: np.ndarray, nominal: float) -> list[tuple[float, float]]:
    r"""Frequency and phase of the line of the mains in each signal: the most probable ones.

    A line :math:`\sin(2\pi f t + \varphi)` beside a constant is fitted by least squares, with a normal prior of f about
    the nominal frequency.

    Parameters
    ----------
    samples : (n_channel, n) array of float
        Signals.
    time : (n,) array of float
        Times of the samples, also with gaps. [s]
    nominal : float
        Nominal frequency. [Hz]

    Returns
    -------
    list of (float, float)
        For each signal: frequency [Hz], phase at t = 0 between -π and π [rad].
    """
    most = PASSAGE.mains_range * PASSAGE.mains_sd
    n = int(np.ceil(most * PASSAGE.mains_steps * np.ptp(time)))
    deviations = np.linspace(-most, most, 2 * n + 1)
    fits = [_fit_line(samples, time, nominal + d) for d in deviations]
    squares = np.array([residual for _, residual in fits])  # (n_deviation, n_channel)
    variance = np.maximum(np.min(squares, axis=0), 1e-300) / max(time.size - 3, 1)
    likeliest = np.argmin(squares / variance + (deviations / PASSAGE.mains_sd)[:, None] ** 2, axis=0)
    return [(nominal + float(deviations[k]), float(fits[k][0][channel])) for channel, k in enumerate(likeliest)]


def _fit_line(samples: np.ndarray, time: np.ndarray, frequency: float) -> tuple[np.ndarray, np.ndarray]:
    """Phase [rad] of a line in each signal by least squares, and the sum of squares that it leaves."""
    turns = 2.0 * np.pi * frequency * time
    columns = np.column_stack([np.sin(turns), np.cos(turns), np.ones(time.size)])
    amplitudes = np.linalg.lstsq(columns, samples.T, rcond=None)[0]
    return np.arctan2(amplitudes[1], amplitudes[0]), np.sum((samples.T - columns @ amplitudes) ** 2, axis=0)


def strongest_lines(stretches: Sequence[np.ndarray], step: float, high: float) -> list[SteadyLine]:
    r"""Strongest line of each channel below a frequency: that with the largest mean power over several stretches.

    A line that has the share R of the power in a band of width B about it, over the time T, has the evidence
    :math:`-B T \ln(1 - R) - \ln n` for n trial frequencies.

    Parameters
    ----------
    stretches : sequence of (n_channel, n) array of float
        Signals without a wheel nearby.
    step : float
        Between samples. [s]
    high : float
        Highest frequency. [Hz]

    Returns
    -------
    list of SteadyLine
        For each channel; none for stretches that are too short for a line below that frequency.
    """
    shortest = step * min(s.shape[1] for s in stretches)
    frequencies = np.arange(PASSAGE.line_periods / shortest, high, PASSAGE.line_step)
    if not frequencies.size:
        return []
    power = np.mean([_line_power(s, step, frequencies) for s in stretches], axis=0)
    lines = []
    for row, k in zip(power, np.argmax(power, axis=1)):
        near = np.abs(frequencies - frequencies[k]) <= PASSAGE.line_band
        band_power = max(float(np.sum(row[near])) * PASSAGE.line_step * shortest, 1e-300)  # Parseval
        share = min(float(row[k]) / band_power, PASSAGE.most_explained)
        freedom = np.count_nonzero(near) * PASSAGE.line_step * step * sum(s.shape[1] for s in stretches)
        evidence = -freedom * np.log1p(-share) - np.log(frequencies.size)
        lines.append(SteadyLine(float(frequencies[k]), float(np.sqrt(row[k])), float(evidence)))
    return lines


def _line_power(signals: np.ndarray, step: float, frequencies: np.ndarray) -> np.ndarray:
    """(n_channel, n_frequency) mean square of a line at each frequency."""
    centred, n = signals - signals.mean(axis=1, keepdims=True), signals.shape[1]
    spectrum = centred @ np.exp(-2j * np.pi * step * np.outer(np.arange(n), frequencies))
    return 2.0 * np.abs(spectrum / n) ** 2


def line_without_wheel(case: TrackCase) -> Ambiguity | None:
    """A channel in which a steady line makes up a clear part of the response in most passages, also without a wheel.

    It has the same frequency in these passages. Passages count whose band contains it.

    Parameters
    ----------
    case : TrackCase

    Returns
    -------
    Ambiguity or None
        That of the channel with the most evidence.
    """
    of_channels = (_line_of_channel(case, sensor.name) for sensor in case.predictor.site.sensors)
    return max((a for a in of_channels if a is not None), key=lambda ambiguity: ambiguity.nats, default=None)


def _line_of_channel(case: TrackCase, channel: str) -> Ambiguity | None:
    lines = []  # (upper end of the band, line, share of the response)
    for o in case.observations:
        aligned = case.aligned_passages.get(o.name)
        if aligned is not None and channel in aligned.steady_lines:
            line = aligned.steady_lines[channel]
            row = o.data.reshape(o.rows, -1)[[s.name for s in aligned.sensors].index(channel)]
            lines.append((aligned.high, line, line.rms / max(float(np.std(row)), 1e-300)))
    if not lines:
        return None
    strongest = max((line for _, line, _ in lines), key=lambda line: line.rms)
    shares, evidence = [], 0.0
    for high, line, share in lines:
        is_same = abs(line.frequency - strongest.frequency) <= 2.0 * PASSAGE.line_step
        if high > strongest.frequency:
            shares.append(share if is_same else 0.0)
            evidence += line.evidence if is_same else 0.0
    if np.median(shares) <= PASSAGE.clear_share:
        return None
    words = (
        f"channel {channel} shows a line at {strongest.frequency:.0f} Hz of {np.sqrt(2.0) * strongest.rms:.2g} m/s² "
        "also where no wheel is near"
    )
    return Ambiguity(evidence, words, "a recording of this channel without a train", "sensor", channel)
