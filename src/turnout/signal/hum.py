"""Remove hum from the accelerations of a recording: mains or traction current that most channels share.

Where nothing excites the track it does not vibrate. A steady line at a frequency of the mains is no vibration there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from turnout.counts import count_of
from turnout.records import Recording, Rejection
from turnout.signal.converter import converter_step
from turnout.signal.drop_outs import drop_outs

if TYPE_CHECKING:
    from collections.abc import Container

MAINS = (50.0 / 3.0, 25.0, 50.0, 60.0)  # Hz: EN 50163:2004, and grids and railways of North America
MAINS_DEVIATION = 0.1  # Hz: the European grid keeps 0.05 Hz in ordinary operation
LINE_RATE = 1000.0  # Hz: to about which samples are averaged before a line is sought
BLOCK = 0.02  # s: over which the level of a channel is measured, a period of 50 Hz
QUIET_QUANTILE, QUIET_FACTOR = 0.1, 2.0  # quiet blocks are at most this factor above this quantile of all
QUIET_CHANNELS = 0.9  # share of the channels that must be quiet at a time: sensors may lie far apart
MAX_WINDOW, MAX_WINDOWS = 1.0, 8  # s: of a quiet time that is used, beside the train; how many of them
MAX_GAP, MAX_END = 8.0, 4.0  # s: without quiet time, between two of them and at an end; the mains drift
MIN_PERIODS = 2.0  # of a line in all quiet times together
STEP_TURNS, REFINEMENT = 0.1, 20  # between trial frequencies, in turns over the quiet times; parts of a step
MIN_FREQUENCY_ERROR, MAX_FREQUENCY_ERROR = 0.02, 0.1  # turns over the quiet times, of a line without and with noise
CHUNK = 64  # trial frequencies at a time, which limits the memory
LEAST_SHARE = 0.1  # of any channel, beside what still rings: with less there is no hum
HUM_SHARE = 0.5  # least share of a channel's power in its quiet times; more than this share of the channels hum
MAX_DECAY = 0.05  # of the amplitude from one half to the other, beyond three standard errors
MAX_QUIET_LEVEL = 0.25  # of what is left in the quiet times, as a share of the whole recording
SMALLEST_STEP = 1e-9  # of a converter, as a share of the range of the samples
STEEP_STEPS = 4.0  # of the converter by which a clipped signal falls within half a run
MIN_EXTREME_RUN = 3  # equal samples at the top or bottom of a channel that count as clipped, if it has two such runs
MIN_HELD_TIME = 0.05  # s: equal samples at an end of a recording that count as a lost sensor
NOTABLE_STRENGTH = 0.02  # of hum, as a share of the peak: less is subtracted without a row in a table

Windows = Sequence[tuple[int, int]]


def without_hum(recording: Recording, names: Container[str] | None = None) -> tuple[Recording, tuple[Rejection, ...]]:
    r"""The recording without its hum, and the finding.

    A recording hums if one line near 16.7, 25, 50 or 60 Hz explains half of the power, below some 500 Hz, of more than
    half of its accelerations in the quiet times. These are blocks in which nearly all channels change by at most twice
    as much from sample to sample as in their quietest tenth, up to 1 s before and behind what is louder. The line must
    be as strong in both halves of the quiet time, and in each part of it that is as long as a period. What it leaves
    must be far below the rest of the recording.

    It is fitted by least squares beside a straight line for each quiet time. It is subtracted from every channel that
    has it, within and between these times, if they are 8 s apart at most. Channels that are clipped, lost, or have a
    drop-out stay, so that later checks find this. Harmonics stay.

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
        One finding "mains_hum", or none. Its value is the largest amplitude as a share of the range of its channel's
        samples, halved.
    """
    rows = [
        i
        for i, (channel, x) in enumerate(zip(recording.channels, recording.samples))
        if channel.quantity == "acceleration"
        and (names is None or channel.name in names)
        and x.size
        and np.isfinite(x).all()
        and np.ptp(x) > 0.0
    ]
    line = _common_line(recording.samples[rows], recording.rate) if rows else None
    if line is None:
        return recording, ()
    samples, time = recording.samples.astype(float), np.arange(recording.n_sample) / recording.rate
    of_line = _sine_and_cosine(time, line.frequency) * ((time >= line.start) & (time <= line.end))[:, None]
    amplitudes, strength = list[float](), 0.0
    for i, share, sine_cosine in zip(rows, line.shares, line.amplitudes.T):
        limit = recording.channels[i].limit
        if share >= HUM_SHARE and not _holds_a_value(samples[i], recording.rate, np.inf if limit is None else limit):
            amplitude = float(np.hypot(*sine_cosine))
            strength = max(strength, 2.0 * amplitude / float(np.ptp(samples[i])))
            samples[i] = _difference(samples[i], of_line @ sine_cosine)
            amplitudes.append(amplitude)
    if not amplitudes:
        return recording, ()
    where = count_of(len(amplitudes), "channel")
    text = f"line of {line.frequency:.1f} Hz subtracted in {where}, up to {max(amplitudes):.1g} m/s²"
    return replace(recording, samples=samples), (Rejection("mains_hum", strength, NOTABLE_STRENGTH, text),)


@dataclass(frozen=True)
class _Line:
    """A line from ``start`` to ``end`` [s]: its frequency [Hz], the share of the power of each channel that it explains
    in the quiet times, and its ``amplitudes`` (2, n_channel) of sine and cosine.
    """

    frequency: float
    shares: np.ndarray
    amplitudes: np.ndarray
    start: float
    end: float


@dataclass(frozen=True)
class _Averages:
    """Signals (n_channel, n) averaged over ``merged`` samples each; ``rate`` is that of the averages. [Hz]"""

    signals: np.ndarray
    rate: float
    merged: int

    @classmethod
    def of(cls, samples: np.ndarray, rate: float) -> _Averages:
        """Of (n_channel, n_sample) samples with a sampling rate. [Hz]"""
        merged = max(1, int(rate / LINE_RATE))
        n = samples.shape[1] // merged
        means = samples[:, : n * merged].reshape(len(samples), n, merged).mean(axis=2)
        return cls(means, rate / merged, merged)

    @property
    def block(self) -> int:
        """Averages in a block."""
        return max(1, round(BLOCK * self.rate))

    def times(self, windows: Windows) -> np.ndarray:
        """Times in windows, in the middle of the samples that were averaged. [s]"""
        numbers = np.concatenate([np.arange(a, b) for a, b in windows])
        return (numbers + 0.5 - 0.5 / self.merged) / self.rate

    def line(self, windows: Windows, frequency: float) -> np.ndarray:
        """(n, 2) averages of sine and cosine of a frequency in windows."""
        x = np.pi * frequency / self.rate
        gain = np.sin(x) / (self.merged * np.sin(x / self.merged))
        return gain * _sine_and_cosine(self.times(windows), frequency)

    def without_drift(self, windows: Windows) -> tuple[np.ndarray, np.ndarray]:
        """Signals (n, n_channel) in windows without a straight line in each, and orthonormal columns of these lines."""
        columns = np.zeros((sum(b - a for a, b in windows), 2 * len(windows)))
        start = 0
        for k, (a, b) in enumerate(windows):
            columns[start : start + b - a, 2 * k] = 1.0
            columns[start : start + b - a, 2 * k + 1] = np.linspace(-1.0, 1.0, b - a)
            start += b - a
        drift = np.linalg.qr(columns)[0]
        signals = np.concatenate([self.signals[:, a:b] for a, b in windows], axis=1).T
        return signals - drift @ (drift.T @ signals), drift

    def fit(self, windows: Windows, frequency: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Amplitudes (2, n_channel) of sine and cosine, signals (n, n_channel), and what the line leaves of them."""
        signals, drift = self.without_drift(windows)
        columns = self.line(windows, frequency)
        columns -= drift @ (drift.T @ columns)
        amplitudes = np.linalg.lstsq(columns, signals, rcond=None)[0]
        return amplitudes, signals, signals - columns @ amplitudes


def _common_line(samples: np.ndarray, rate: float) -> _Line | None:
    """The line of the mains that most channels (n_channel, n_sample) have, None without one."""
    averages = _Averages.of(samples, rate)
    size = averages.block
    is_quiet = _is_low(_levels(_changes(samples), size * averages.merged))
    is_quiet &= _is_low(_levels(_changes(averages.signals), size))[: is_quiet.size]
    windows = _windows(is_quiet, size, averages.rate)
    if not windows or _strongest(averages, windows[:1], beside=False) is None:  # one quiet time tells most recordings
        return None
    strongest = _strongest(averages, windows, beside=True)
    if strongest is None:
        return None
    frequency, shares = strongest
    hums, extent = shares >= HUM_SHARE, _extent(windows, is_quiet, averages)
    if extent is None or np.mean(hums) <= HUM_SHARE or not _is_steady(averages, windows, frequency, hums):
        return None
    amplitudes, _, remainder = averages.fit(windows, frequency)
    without_line = averages.signals - (averages.line([(0, averages.signals.shape[1])], frequency) @ amplitudes).T
    if (
        np.median(np.std(remainder, axis=0)[hums] / np.maximum(np.std(without_line, axis=1)[hums], 1e-300))
        > MAX_QUIET_LEVEL
    ):
        return None
    return _Line(frequency, shares, amplitudes, *extent)


def _extent(windows: Windows, is_quiet: np.ndarray, averages: _Averages) -> tuple[float, float] | None:
    """First and last time [s] for which the quiet times tell the line, None if a train is longer than they reach."""
    rate, n = averages.rate, averages.signals.shape[1]
    ordered = sorted(windows)
    if any(b - a > MAX_GAP * rate for (_, a), (b, _) in pairwise(ordered)):
        return None
    start, end = ordered[0][0], ordered[-1][1]
    is_quiet_before = np.all(is_quiet[: start // averages.block])
    is_quiet_behind = np.all(is_quiet[-(-end // averages.block) :])
    if (start > MAX_END * rate and not is_quiet_before) or (n - end > MAX_END * rate and not is_quiet_behind):
        return None
    return start / rate if start > MAX_END * rate else 0.0, end / rate if n - end > MAX_END * rate else np.inf


def _changes(signals: np.ndarray) -> np.ndarray:
    """From sample to sample, 0 behind the last one."""
    return np.diff(signals, axis=1, append=signals[:, -1:])


def _levels(signals: np.ndarray, size: int) -> np.ndarray:
    """(n_channel, n_block) root mean square of each block."""
    n = signals.shape[1] // size
    return np.sqrt(np.mean(signals[:, : n * size].reshape(len(signals), n, size) ** 2, axis=2))


def _is_low(levels: np.ndarray) -> np.ndarray:
    """(n_block,) whether nearly all channels are little louder than in their quietest blocks."""
    if not levels.size:
        return np.zeros(levels.shape[1], dtype=bool)
    limits = QUIET_FACTOR * np.quantile(levels, QUIET_QUANTILE, axis=1, keepdims=True)
    return np.quantile(levels / np.maximum(limits, 1e-300), QUIET_CHANNELS, axis=0) <= 1.0


def _windows(is_quiet: np.ndarray, size: int, rate: float) -> list[tuple[int, int]]:
    """(first, end) of the longest quiet times, the longest first; of each the part beside what is louder."""
    edges = np.flatnonzero(np.diff(is_quiet.astype(int), prepend=0, append=0)) * size
    most = round(MAX_WINDOW * rate)
    windows = [(max(a, b - most), b) if a == 0 else (a, min(b, a + most)) for a, b in edges.reshape(-1, 2)]
    return sorted(((int(a), int(b)) for a, b in windows), key=lambda w: w[0] - w[1])[:MAX_WINDOWS]


def _strongest(averages: _Averages, windows: Windows, beside: bool) -> tuple[float, np.ndarray] | None:
    """Frequency of the line that explains most of the quiet times near the mains, and its share of each channel.

    None without one. Frequencies ``beside`` those of the mains are tried too: a line there is none of the mains, though
    between two quiet times it may look like one.
    """
    duration = sum(b - a for a, b in windows) / averages.rate
    nominal = [f for f in MAINS if duration >= MIN_PERIODS / f and averages.rate >= 4.0 * f]
    if not nominal:
        return None
    (signals, drift), time = averages.without_drift(windows), averages.times(windows)
    turn = 1.0 / np.ptp(time)  # Hz: a line so far off turns once more within the quiet times
    reach = MAINS_DEVIATION + (averages.rate / max(b - a for a, b in windows) if beside else 0.0)
    deviations = np.linspace(-reach, reach, 2 * int(np.ceil(reach / (STEP_TURNS * turn))) + 1)
    trials = np.concatenate([f + deviations for f in nominal])
    trials = trials[trials > 0.5 * min(nominal)]
    shares = _shares(signals, time, drift, trials)
    k = int(np.argmax(np.sum(shares, axis=1)))
    if np.max(shares[k]) < LEAST_SHARE:
        return None
    if not beside:
        return float(trials[k]), shares[k]
    trials = trials[k] + STEP_TURNS * turn * np.linspace(-1.0, 1.0, 2 * REFINEMENT + 1)
    totals = np.sum(_shares(signals, time, drift, trials), axis=1)
    k = int(np.clip(np.argmax(totals), 1, trials.size - 2))
    below, most, above = totals[k - 1 : k + 2]
    bend = below - 2.0 * most + above  # of the parabola through three trials, whose top is the frequency
    top = float(np.clip(0.5 * (below - above) / bend, -1.0, 1.0)) if bend < 0.0 else 0.0
    frequency = float(trials[k] + top * (trials[1] - trials[0]))
    shares = _shares(signals, time, drift, np.array([frequency]))[0]
    if min(abs(frequency - f) for f in nominal) > MAINS_DEVIATION + _error_in_turns(shares, time.size) * turn:
        return None
    return frequency, shares


def _error_in_turns(shares: np.ndarray, n: int) -> float:
    r"""Three standard errors of the frequency of a line with these shares of n values, in turns over their time.

    .. math:: \sigma_f T = \frac{\sqrt 6}{\pi} \frac{\sigma}{a \sqrt n}, \quad \frac{\sigma^2}{a^2} = \frac{1 - s}{2 s}

    for a single quiet time (Rife and Boorstyn 1974); two that lie apart tell it better.
    """
    share = max(float(np.median(shares)), 1e-3)
    error = 3.0 * np.sqrt(6.0) / np.pi * np.sqrt(max(1.0 - share, 0.0) / (2.0 * share * n))
    return min(MIN_FREQUENCY_ERROR + error, MAX_FREQUENCY_ERROR)


def _shares(signals: np.ndarray, time: np.ndarray, drift: np.ndarray, frequencies: np.ndarray) -> np.ndarray:
    """(n_frequency, n_channel) share of the power of signals (n_time, n_channel) that a line explains beside a drift.

    The line is made orthogonal to the drift, whose columns are orthonormal; then the normal equations of its two
    components are solved.
    """
    explained = []
    for chunk in np.split(frequencies, np.arange(CHUNK, frequencies.size, CHUNK)):
        phase = 2.0 * np.pi * np.outer(time, chunk)
        sine, cosine = (x - drift @ (drift.T @ x) for x in (np.sin(phase), np.cos(phase)))
        ss, cc, sc = (np.sum(x * y, axis=0)[:, None] for x, y in ((sine, sine), (cosine, cosine), (sine, cosine)))
        by_sine, by_cosine = sine.T @ signals, cosine.T @ signals
        explained.append((cc * by_sine**2 - 2.0 * sc * by_sine * by_cosine + ss * by_cosine**2) / (ss * cc - sc**2))
    return np.concatenate(explained) / np.maximum(np.sum(signals**2, axis=0), 1e-300)


def _is_steady(averages: _Averages, windows: Windows, frequency: float, hums: np.ndarray) -> bool:
    """Whether a line has one amplitude and phase in the whole quiet time, in most of the channels that hum.

    Neither what decays after an impact nor mains that drift are such a line.
    """
    period = averages.rate / frequency
    amplitudes, _, _ = averages.fit(windows, frequency)
    for window in windows:
        signals, drift = averages.without_drift([window])
        line = averages.line([window], frequency)
        remainder = signals - (line - drift @ (drift.T @ line)) @ amplitudes
        shares_left = np.sum(remainder**2, axis=0) / np.maximum(np.sum(signals**2, axis=0), 1e-300)
        is_long = window[1] - window[0] >= period  # in a shorter one, a straight line takes up a part of the line
        if np.median(shares_left[hums]) > (1.0 - HUM_SHARE if is_long else 1.0 + HUM_SHARE):
            return False
    halves = _halves(sorted(windows))
    if min(sum(b - a for a, b in half) for half in halves) < period:
        return False
    first, second = (averages.fit(half, frequency)[0][:, hums] for half in halves)
    amplitude = np.linalg.norm(amplitudes[:, hums], axis=0)
    decay = np.abs(np.linalg.norm(first, axis=0) - np.linalg.norm(second, axis=0)) / amplitude
    remainder = averages.fit(windows, frequency)[2]
    error = np.sqrt(8.0 / len(remainder)) * np.std(remainder, axis=0)[hums] / amplitude  # of the decay, by white noise
    return bool(np.median(decay - 3.0 * error) <= MAX_DECAY)


def _halves(windows: Windows) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """The first and the second half of the time in windows."""
    first: list[tuple[int, int]] = []
    second: list[tuple[int, int]] = []
    remaining = sum(b - a for a, b in windows) // 2
    for a, b in windows:
        n = min(b - a, remaining)
        first += [(a, a + n)] if n > 1 else []
        second += [(a + n, b)] if b - a - n > 1 else []
        remaining -= n
    return first, second


def _difference(samples: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Samples less a line, on the steps of their converter, which later checks need."""
    step = converter_step(samples)
    if step <= SMALLEST_STEP * np.ptp(samples):
        return samples - line
    return samples[0] + step * (np.round((samples - samples[0]) / step) - np.round(line / step))


def _holds_a_value(samples: np.ndarray, rate: float, limit: float) -> bool:
    """Whether a channel repeats one value where it should move: clipped, in a drop-out, or at an end.

    Clipped are values at the limit, two runs of an extreme value, or one that the signal leaves steeply on either side.
    """
    edges = np.concatenate([[0], np.flatnonzero(np.diff(samples)) + 1, [samples.size]])
    values, lengths = samples[edges[:-1]], np.diff(edges)
    if np.max(np.abs(samples)) >= 0.999 * limit or max(lengths[0], lengths[-1]) >= MIN_HELD_TIME * rate:
        return True
    least = STEEP_STEPS * converter_step(samples)
    for extreme in (samples.min(), samples.max()):
        runs = np.flatnonzero((lengths >= MIN_EXTREME_RUN) & (values == extreme))
        reach = (lengths[runs] + 1) // 2
        before, behind = edges[runs] - reach, edges[runs + 1] - 1 + reach
        inside = (before >= 0) & (behind < samples.size)
        falls = np.abs(samples[np.stack([before[inside], behind[inside]])] - extreme)
        if runs.size >= 2 or np.any(np.min(falls, axis=0) > least):
            return True
    return bool(drop_outs(samples).size)


def _sine_and_cosine(time: np.ndarray, frequency: float) -> np.ndarray:
    """(n, 2) sine and cosine of a frequency."""
    phase = 2.0 * np.pi * frequency * time
    return np.column_stack([np.sin(phase), np.cos(phase)])
