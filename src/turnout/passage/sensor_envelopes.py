"""Compute the level of each channel in a few bands on a coarse time grid, in which axles are sought."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from turnout.constants import MAD_TO_SD

if TYPE_CHECKING:
    from collections.abc import Sequence

# Hz. Between ballast and railpad resonance the rail's vibration decays fastest along the track, above them slowest.
# Three bands, each with its own logarithm, so that no resonance masks the position of the wheel.
EDGE_WIDTH = 0.2  # of the frequency of an edge, over which a band falls to zero
BANDS = ((30.0, 120.0), (120.0, 400.0), (400.0, 900.0))


@dataclass(frozen=True)
class Levels:
    """``values`` (n_channel, n_bin): mean over the bands of ln(power above the quiet level), 0 where quiet.

    ``step`` [s] between bins; bin k covers [k, k + 1) steps from the start of the recording. ``scatter`` (n_channel,)
    is the standard deviation of the quiet values. ``loud_power`` (n_channel,) is the power that a tenth of the 50 ms
    blocks exceed, mean over the bands in logarithms. [(m/s²)²] ``amplitude`` (n_channel, n_bin) is the mean over the
    bands of the root of the power, each band over its own root mean square.
    """

    values: np.ndarray
    step: float
    scatter: np.ndarray
    loud_power: np.ndarray
    amplitude: np.ndarray

    @property
    def n_bin(self) -> int:
        """Number of bins."""
        return self.values.shape[1]


def band_powers(
    samples: np.ndarray, rate: float, step: float, bands: Sequence[tuple[float, float]] = BANDS
) -> np.ndarray:
    """(n_channel, n_band, n_bin) mean square of the band-passed samples in each bin. [(m/s²)²]

    One transform per channel. Each band has cosine edges of relative width 0.2. It is transformed back at four samples
    per bin, or more where the band needs it. There is no delay, and the cost is a third of that of filters.

    Parameters
    ----------
    samples : (n_channel, n_sample) array of float
        Acceleration. [m/s²]
    rate : float
        Sampling rate. [Hz]
    step : float
        Length of a bin. [s]
    bands : sequence of (float, float)
        Edges of the bands. [Hz]

    Returns
    -------
    (n_channel, n_band, n_bin) array of float
        Mean square. [(m/s²)²]
    """
    samples = np.atleast_2d(samples)
    per_bin = max(round(step * rate), 1)
    n_bin = samples.shape[1] // per_bin
    length = fft.next_fast_len(n_bin, real=True)
    top = min(max(high for _, high in bands) * 1.2, 0.45 * rate)
    points = min(max(int(np.ceil(2.0 * top * per_bin / rate)), 4), per_bin)
    frequency = np.arange(length * points // 2 + 1) * rate / (length * per_bin)
    windows = [_edges(frequency, low, min(high, 0.4 * rate)) * (points / per_bin) for low, high in bands]
    powers = np.empty((samples.shape[0], len(bands), n_bin))
    for i, row in enumerate(samples):
        spectrum = fft.rfft(row[: n_bin * per_bin], length * per_bin)[: frequency.size]
        for k, window in enumerate(windows):
            band_signal = fft.irfft(spectrum * window, length * points).reshape(length, points)[:n_bin]
            powers[i, k] = np.einsum("np,np->n", band_signal, band_signal) / points
    return powers


def _edges(frequency: np.ndarray, low: float, high: float) -> np.ndarray:
    """Window that is 1 between ``low`` and ``high`` and falls to 0 over ``EDGE_WIDTH`` of either edge."""
    rise = np.clip((frequency / low - 1 + EDGE_WIDTH) / EDGE_WIDTH, 0, 1)
    fall = np.clip((1 + EDGE_WIDTH - frequency / high) / EDGE_WIDTH, 0, 1)
    return np.sin(0.5 * np.pi * rise) ** 2 * np.sin(0.5 * np.pi * fall) ** 2


def levels(samples: np.ndarray, rate: float, step: float) -> Levels:
    """Levels of all channels; the quiet level of a band is the median of the quietest fifth of 50 ms blocks.

    A bin is the whole number of samples next to ``step``; the ``step`` of the result is its exact length.

    Parameters
    ----------
    samples : (n_channel, n_sample) array of float
        Acceleration. [m/s²]
    rate : float
        Sampling rate. [Hz]
    step : float
        Wanted length of a bin. [s]

    Returns
    -------
    Levels
        One row per channel.
    """
    step = max(round(step * rate), 1) / rate
    powers = band_powers(samples, rate, step, BANDS)
    quiet_power = quiet_level(powers, max(round(0.05 / step), 1))[..., None]
    values = np.log1p(powers / quiet_power).mean(axis=1)
    quiet = values < np.quantile(values, 0.2, axis=1, keepdims=True)
    quiet |= values == values.min(axis=1, keepdims=True)  # of a silent channel all values are equal
    centre = np.array([np.median(v[q]) for v, q in zip(values, quiet)])
    scatter = np.array([MAD_TO_SD * np.median(np.abs(v[q] - c)) for v, q, c in zip(values, quiet, centre)])
    block = max(round(0.05 / step), 1)
    n = max(values.shape[1] // block, 1)
    blocks = powers[..., : n * block].reshape(*powers.shape[:2], n, -1).mean(axis=-1)
    loud_power = np.exp(np.log(np.maximum(np.quantile(blocks, 0.9, axis=-1), 1e-300)).mean(axis=1))
    mean_power = np.maximum(powers.mean(axis=-1, keepdims=True), np.finfo(float).tiny)
    amplitude = np.sqrt(powers / mean_power).mean(axis=1)
    return Levels(values - centre[:, None], step, np.maximum(scatter, 0.05), loud_power, amplitude)


def quiet_level(powers: np.ndarray, block: int) -> np.ndarray:
    """(...,) level of the quietest fifth of blocks of bins; never zero.

    Parameters
    ----------
    powers : (..., n_bin) array of float
        Mean squares. [(m/s²)²]
    block : int
        Bins of a block.

    Returns
    -------
    (...) array of float
        Quiet power. [(m/s²)²]
    """
    n = max(powers.shape[-1] // block, 1)
    blocks = powers[..., : n * block].reshape(*powers.shape[:-1], n, -1).mean(axis=-1)
    level = np.quantile(blocks, 0.1, axis=-1)
    # 27 dB below the loud parts is quiet: vibration from distant wheels says nothing about axles
    return np.maximum(level, 2e-3 * np.quantile(blocks, 0.98, axis=-1) + np.finfo(float).tiny)


@dataclass(frozen=True)
class SensorEnvelopes:
    """Envelopes of all sensors on one time grid, in which axles are sought.

    ``levels`` (n_sensor, n_bin) with their ``step`` [s]; ``slow`` (n_sensor, n_bin) mean acceleration per bin, without
    offset [m/s²]; ``positions`` (n_sensor,) [m]; ``begin``, ``end`` [s] where the train is audible.
    """

    levels: Levels
    slow: np.ndarray
    positions: np.ndarray
    begin: float
    end: float

    def select(self, rows: Sequence[int] | np.ndarray) -> SensorEnvelopes:
        """The envelopes of some of the sensors.

        Parameters
        ----------
        rows : sequence of int
            Rows of the sensors.

        Returns
        -------
        SensorEnvelopes
            In the order of ``rows``.
        """
        rows = np.asarray(rows, dtype=int)
        levels = self.levels
        selected = Levels(
            levels.values[rows], levels.step, levels.scatter[rows], levels.loud_power[rows], levels.amplitude[rows]
        )
        return SensorEnvelopes(selected, self.slow[rows], self.positions[rows], self.begin, self.end)

    def relative_to(self, position: float) -> SensorEnvelopes:
        """The same envelopes, with the sensors' positions relative to a given one.

        Parameters
        ----------
        position : float
            The new origin. [m]

        Returns
        -------
        SensorEnvelopes
            At ``positions`` less ``position``.
        """
        return replace(self, positions=self.positions - position)
