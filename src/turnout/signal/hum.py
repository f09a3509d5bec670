"""Remove hum from the channels of a recording: mains or traction current that most of them share.

Where nothing excites the track it does not vibrate. A steady line at a frequency of the mains is no vibration there,
and its phase goes on through the impact or the train.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.records import Recording, Rejection
from turnout.signal.converter import converter_step
from turnout.signal.drop_outs import drop_outs

if TYPE_CHECKING:
    from collections.abc import Container

MAINS = (50.0 / 3.0, 25.0, 50.0, 60.0)  # Hz: EN 50163:2004, and grids and railways of North America
MAINS_DEVIATION = 0.1  # Hz: the European grid keeps 0.05 Hz in ordinary operation
LINE_RATE = 1000.0  # Hz: to about which samples are averaged before a line is sought
BLOCK = 0.005  # s: over which the level of a channel is measured
QUIET_QUANTILE, QUIET_FACTOR = 0.1, 2.0  # quiet blocks are at most this factor above this quantile of all
MIN_WINDOW, MAX_WINDOWS = 0.02, 8  # s: of a quiet time that is used; how many of them, the longest ones
STEP_TURNS, REFINEMENT = 0.1, 20  # between trial frequencies, in turns over the quiet times; parts of a step
FREQUENCY_ERROR = 0.1  # of a line in turns over the quiet times: three standard errors at a tenth of noise, 10 samples
MIN_PERIODS = 2.0  # of a line in all quiet times together
LEAST_SHARE = 0.1  # of any channel, beside what still rings: with less there is no hum
HUM_SHARE = 0.5  # least share of a channel's power in its quiet times, and least share of the channels
MIN_EXTREME_RUN = 3  # equal samples at the top or bottom of a channel that count as clipped, if it has two such runs
MIN_HELD_TIME = 0.05  # s: equal samples at an end of a recording that count as a lost sensor
NOTABLE_STRENGTH = 0.02  # of hum, as a share of the peak: less is subtracted without a row in a table


@dataclass(frozen=True)
class _Line:
    """A line in the quiet times: its frequency [Hz], the share of the power of each channel that it explains, and
    whether its frequency is one of the mains.
    """

    frequency: float
    shares: np.ndarray
    is_mains: bool


def without_hum(recording: Recording, names: Container[str] | None = None) -> tuple[Recording, tuple[Rejection, ...]]:
    r"""The recording without its hum, and the finding.

    A recording hums if a line within 0.1 Hz of 16.7, 25, 50 or 60 Hz explains half of the power below some 500 Hz of
    half of its channels, in their quiet times: where they change by at most twice as much from sample to sample as in
    their quietest tenth. The line is fitted to the quiet times by least squares, beside a straight line for each, and
    subtracted from the whole of every channel that has it. Channels that are clipped, lost, or have a drop-out stay, so
    that later checks find this. Harmonics stay, and so does the hum of one channel of many.

    .. math:: x(t) = a \sin(2 \pi f t) + b \cos(2 \pi f t) + c_k + d_k t

    Parameters
    ----------
    recording : Recording
        Any recording.
    names : container of str, optional
        Of the channels that are searched, by default all; others stay as they are.

    Returns
    -------
    recording : Recording
        The same object where nothing is removed.
    findings : tuple of Rejection
        One finding "mains_hum", or none. Its value is the largest amplitude as a share of the peak of its channel.
    """
    rows = [
        i
        for i, (channel, x) in enumerate(zip(recording.channels, recording.samples))
        if (names is None or channel.name in names) and np.isfinite(x).all() and np.ptp(x) > 0.0
    ]
    line_in_windows = _common_line(recording.samples[rows], recording.rate) if rows else None
    if line_in_windows is None:
        return recording, ()
    line, windows = line_in_windows
    samples, time = recording.samples.copy(), np.arange(recording.n_sample) / recording.rate
    of_line = _line_columns(time, line.frequency)
    amplitudes, strength = {}, 0.0
    for i, share, parts in zip(rows, line.shares, _amplitudes(samples[rows], of_line, windows).T):
        if share >= HUM_SHARE and not _holds_a_value(samples[i], recording.rate):
            step = converter_step(samples[i])  # later checks need the steps of the converter
            samples[i] = step * (np.round(samples[i] / step) - np.round(of_line @ parts / step))
            amplitude = float(np.hypot(*parts))
            amplitudes[recording.channels[i].name] = amplitude
            strength = max(strength, amplitude / float(np.max(np.abs(samples[i]))))
    if not amplitudes:
        return recording, ()
    listed = ", ".join(f"{name} {amplitude:.3g}" for name, amplitude in amplitudes.items())
    text = f"line of {line.frequency:.1f} Hz subtracted, amplitudes: {listed}"
    finding = Rejection("mains_hum", strength, NOTABLE_STRENGTH, text)
    return replace(recording, samples=samples), (finding,)


def _common_line(samples: np.ndarray, rate: float) -> tuple[_Line, list[tuple[int, int]]] | None:
    """The line of the mains that most channels have, and the quiet times; None without one.

    What still rings after an impact, at low frequencies, is louder there than beside the line. Such times are left out.
    """
    size = max(1, round(BLOCK * rate))
    is_quiet = _is_low(_levels(np.diff(samples, axis=1, append=samples[:, -1:]), size))
    line = _strongest_line(samples, rate, windows := _windows(is_quiet, size, rate), beside=False)
    if line is None:
        return None
    of_line = _line_columns(np.arange(samples.shape[1]) / rate, line.frequency)
    remainder = samples - (of_line @ _amplitudes(samples, of_line, windows)).T
    is_quiet[is_quiet] = _is_low(_levels(remainder, size)[:, is_quiet])
    line = _strongest_line(samples, rate, windows := _windows(is_quiet, size, rate))
    return (line, windows) if line and line.is_mains and np.mean(line.shares >= HUM_SHARE) >= HUM_SHARE else None


def _levels(signals: np.ndarray, size: int) -> np.ndarray:
    """(n_channel, n_block) root mean square of each block."""
    n = signals.shape[1] // size
    return np.sqrt(np.mean(signals[:, : n * size].reshape(len(signals), n, size) ** 2, axis=2))


def _is_low(levels: np.ndarray) -> np.ndarray:
    """(n_block,) whether most channels are little louder than in their quietest blocks."""
    if not levels.size:
        return np.zeros(levels.shape[1], dtype=bool)
    limits = QUIET_FACTOR * np.quantile(levels, QUIET_QUANTILE, axis=1, keepdims=True)
    return np.median(levels / np.maximum(limits, 1e-300), axis=0) <= 1.0


def _windows(is_quiet: np.ndarray, size: int, rate: float) -> list[tuple[int, int]]:
    """(first, end) of the longest quiet times."""
    edges = np.flatnonzero(np.diff(is_quiet.astype(int), prepend=0, append=0)) * size
    windows = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2]) if b - a >= MIN_WINDOW * rate]
    return sorted(sorted(windows, key=lambda w: w[0] - w[1])[:MAX_WINDOWS])


def _strongest_line(
    samples: np.ndarray, rate: float, windows: list[tuple[int, int]], beside: bool = True
) -> _Line | None:
    """The line near a frequency of the mains that explains most of the quiet times, None without or if they are short.

    Frequencies ``beside`` those of the mains are tried too: there, a line that is none of the mains explains more.
    """
    size = max(1, int(rate / LINE_RATE))
    coarse = [(-(-a // size), b // size) for a, b in windows]  # whole blocks alone
    quiet = np.concatenate([np.arange(*w) for w in coarse]) if coarse else np.zeros(0, dtype=int)
    nominal = [f for f in MAINS if quiet.size * size / rate >= MIN_PERIODS / f and rate / size >= 4.0 * f]
    if not nominal:
        return None
    n = samples.shape[1] // size
    means = samples[:, : n * size].reshape(len(samples), n, size).mean(axis=2)[:, quiet].T  # (n_quiet, n_channel)
    time = (quiet * size + 0.5 * (size - 1)) / rate
    drift = np.linalg.qr(_drift_columns(coarse))[0]
    means -= drift @ (drift.T @ means)
    turn = 1.0 / np.ptp(time)
    reach = MAINS_DEVIATION
    if beside:  # in a single quiet time, a line farther off does not look like one of the mains
        reach += rate / size / max(b - a for a, b in coarse)
    deviations = np.linspace(-reach, reach, 2 * int(np.ceil(reach / (STEP_TURNS * turn))) + 1)
    trials = np.concatenate([f + deviations for f in nominal])
    shares = _shares(means, time, drift, trials)
    k = int(np.argmax(np.sum(shares, axis=1)))
    if np.max(shares[k]) < LEAST_SHARE:
        return None
    trials = trials[k] + STEP_TURNS * turn * np.linspace(-1.0, 1.0, 2 * REFINEMENT + 1)
    shares = _shares(means, time, drift, trials)
    k = int(np.argmax(np.sum(shares, axis=1)))
    is_mains = min(abs(trials[k] - f) for f in nominal) <= MAINS_DEVIATION + FREQUENCY_ERROR * turn
    return _Line(float(trials[k]), shares[k], is_mains)


def _shares(signals: np.ndarray, time: np.ndarray, drift: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """(n_frequency, n_channel) share of the power of signals (n_time, n_channel) that a line explains beside a drift.

    The line is made orthogonal to the drift, whose columns are orthonormal; then the normal equations of its two
    components are solved.
    """
    phase = 2.0 * np.pi * np.outer(time, frequencies)
    sine, cosine = (x - drift @ (drift.T @ x) for x in (np.sin(phase), np.cos(phase)))
    ss, cc, sc = (np.sum(x * y, axis=0)[:, None] for x, y in ((sine, sine), (cosine, cosine), (sine, cosine)))
    by_sine, by_cosine = sine.T @ signals, cosine.T @ signals
    explained = (cc * by_sine**2 - 2.0 * sc * by_sine * by_cosine + ss * by_cosine**2) / (ss * cc - sc**2)
    return explained / np.maximum(np.sum(signals**2, axis=0), 1e-300)


def _amplitudes(samples: np.ndarray, of_line: np.ndarray, windows: list[tuple[int, int]]) -> np.ndarray:
    """(2, n_channel) amplitudes of sine and cosine by least squares in the quiet times, beside the drift of each."""
    quiet = np.concatenate([np.arange(*w) for w in windows])
    columns = np.column_stack([of_line[quiet], _drift_columns(windows)])
    return np.linalg.lstsq(columns, samples[:, quiet].T, rcond=None)[0][:2]


def _holds_a_value(samples: np.ndarray, rate: float) -> bool:
    """Whether a channel repeats one value where it should move: clipped, in a drop-out, or at an end."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(samples)) + 1, [samples.size]])
    values, lengths = samples[edges[:-1]], np.diff(edges)
    is_long = lengths >= MIN_EXTREME_RUN
    n_extreme = max(np.sum(is_long & (values == x)) for x in (samples.min(), samples.max()))
    is_lost = max(lengths[0], lengths[-1]) >= MIN_HELD_TIME * rate
    return bool(n_extreme >= 2 or is_lost or drop_outs(samples).size)


def _line_columns(time: np.ndarray, frequency: float) -> np.ndarray:
    """(n_time, 2) sine and cosine of a frequency."""
    phase = 2.0 * np.pi * frequency * time
    return np.column_stack([np.sin(phase), np.cos(phase)])


def _drift_columns(windows: list[tuple[int, int]]) -> np.ndarray:
    """(n_quiet, 2 n_window) constant and straight line of each window."""
    columns = np.zeros((sum(b - a for a, b in windows), 2 * len(windows)))
    start = 0
    for k, (a, b) in enumerate(windows):
        columns[start : start + b - a, 2 * k] = 1.0
        columns[start : start + b - a, 2 * k + 1] = np.linspace(-1.0, 1.0, b - a)
        start += b - a
    return columns
