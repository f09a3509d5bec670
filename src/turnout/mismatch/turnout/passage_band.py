"""Frequency band and sampling rates of passages: filters, interpolation between samples, resampling."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from turnout.mismatch.turnout.priors import PASSAGE, SIMULATION

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.records import Recording
    from turnout.simulate.sensor import Sensor


def limit_band(
    samples: np.ndarray, rate: float, low: float = PASSAGE.band_low, high: float = PASSAGE.band_high
) -> np.ndarray:
    """Rows of ``samples`` between ``low`` and ``high`` [Hz], zero phase, cosine edges of a third.

    Parameters
    ----------
    samples : (..., n) array of float
        Signals along the last axis.
    rate : float
        Samples per second. [Hz]
    low : float
        Lower end of the band. [Hz]
    high : float
        Upper end of the band. [Hz]

    Returns
    -------
    (..., n) array of float
        The signals within the band.
    """
    n = samples.shape[-1]
    size = padded_size(n, rate)
    passed = band_window(np.fft.rfftfreq(size, 1.0 / rate), low, high)
    return np.fft.irfft(np.fft.rfft(samples, size) * passed, size)[..., :n]


def padded_size(n: int, rate: float) -> int:
    """Length of a transform in which a signal of ``limit_band`` does not wrap around: its lower edge rings for half a
    second.

    Parameters
    ----------
    n : int
        Samples of the signal.
    rate : float
        Samples per second. [Hz]

    Returns
    -------
    int
    """
    return next_fast_len(n + round(rate * 0.75), real=True)


def band_window(frequency: np.ndarray | Sequence[float], low: float, high: float) -> np.ndarray:
    """Factor of ``limit_band`` at each frequency [Hz], 0 to 1.

    Parameters
    ----------
    frequency : (n,) array of float
        [Hz]
    low : float
        Lower end of the band. [Hz]
    high : float
        Upper end of the band. [Hz]

    Returns
    -------
    (n,) array of float
        0 to 1.
    """
    f = np.asarray(frequency)
    passed = np.clip((f - 0.67 * low) / (0.33 * low), 0.0, 1.0) * np.clip((1.25 * high - f) / (0.25 * high), 0.0, 1.0)
    return 0.5 - 0.5 * np.cos(np.pi * passed)


def read_at(samples: np.ndarray, rate: float, time: np.ndarray) -> np.ndarray:
    """Band-limited ``samples`` (..., n), sample k at (k + 1/2)/rate, read at ``time`` (m,), 0 outside.

    Parameters
    ----------
    samples : (..., n) array of float
        Signals along the last axis.
    rate : float
        Samples per second. [Hz]
    time : (m,) array of float
        Times. [s]

    Returns
    -------
    (..., m) array of float
        Signals at these times; 0 outside the record.
    """
    n = samples.shape[-1]
    sample = np.asarray(time) * rate - 0.5
    k = np.clip(np.floor(sample).astype(int), 1, n - 3)
    s = sample - k
    a, b, c, d = (samples[..., k + i] for i in (-1, 0, 1, 2))
    value = b + 0.5 * s * (c - a + s * (2.0 * a - 5.0 * b + 4.0 * c - d + s * (3.0 * (b - c) + d - a)))
    return np.where((sample < 0.0) | (sample > n - 1), 0.0, value)


def upsample(samples: np.ndarray, factor: int = 4) -> np.ndarray:
    """Samples at a multiple of the rate by Fourier transform; sample k stays at (k + 1/2) of its own step.

    Parameters
    ----------
    samples : (..., n) array of float
        Signals along the last axis.
    factor : int
        Multiple of the rate.

    Returns
    -------
    (..., factor n) array of float
        The same signals at ``factor`` times the rate.
    """
    n = samples.shape[-1]
    size = 2 * next_fast_len((n + 65) // 2, real=True)
    spectrum = np.fft.rfft(samples, size)
    shift = np.exp(2j * np.pi * np.fft.rfftfreq(size) * (0.5 / factor - 0.5))
    padded = np.zeros((*samples.shape[:-1], size * factor // 2 + 1), dtype=complex)
    padded[..., : spectrum.shape[-1]] = spectrum * shift
    return factor * np.fft.irfft(padded, size * factor)[..., : n * factor]


def band_end(speed: float) -> float:
    """Upper end of the band of a passage [Hz]: its edge is 1.25 times this, at the shortest wave.

    Parameters
    ----------
    speed : float
        Speed of the train. [m/s]

    Returns
    -------
    float
        [Hz]
    """
    return min(PASSAGE.band_high, speed / PASSAGE.shortest_wave / 1.25)


def sample_rate_of(speed: float) -> float:
    """Sampling rate for the band of a passage at this speed, an integer fraction of ``SIMULATION.rate`` [Hz].

    Parameters
    ----------
    speed : float
        Speed of the train. [m/s]

    Returns
    -------
    float
        [Hz]
    """
    enough = [
        SIMULATION.rate / fold
        for fold in PASSAGE.rate_divisors
        if SIMULATION.rate / fold > 2.4 * 1.25 * band_end(speed)
    ]
    return enough[0] if enough else SIMULATION.rate / PASSAGE.rate_divisors[-1]


def transfer_lines() -> np.ndarray:
    """Lines of the transfer functions of a passage [Hz].

    Returns
    -------
    (n_line,) array of float
        [Hz]
    """
    return np.arange(SIMULATION.lowest_line, SIMULATION.band_margin * PASSAGE.band_high, SIMULATION.line_step)


def band_signals(recording: Recording, sensors: Sequence[Sensor], high: float) -> np.ndarray:
    """Rows of the ``sensors`` of a recording, in the band that ends at ``high`` [Hz].

    Parameters
    ----------
    recording : Recording
        The recording.
    sensors : sequence of Sensor
        The sensors.
    high : float
        Upper end of the band. [Hz]

    Returns
    -------
    (n_sensor, n) array of float
        At the rate of the recording.
    """
    rows = [recording.index(s.name) for s in sensors]
    return limit_band(recording.samples[rows], recording.rate, high=high)
