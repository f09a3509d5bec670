"""Estimate slowness and direction of a train from the levels of two or more sensors, before any axle is known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, ndimage

from turnout.constants import KMH

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.config.settings.passage import PassageSettings

MIN_PEAK_DISTANCE = 0.04  # of the slowness, between two peaks of a scan
SLOWNESS_STEP = 0.008  # of the slowness, in a coarse scan
REFINED_WIDTH = 0.03  # of the slowness, to either side in a fine scan


@dataclass(frozen=True)
class Scan:
    """Correlation of all sensors after shifts by distance times slowness, over signed slowness. [s/m]

    ``correlation`` (n,) is the mean correlation coefficient over pairs of sensors, weighted by distance up to 3 m.
    """

    slowness: np.ndarray
    correlation: np.ndarray

    def peaks(self, n: int = 3) -> list[tuple[float, float]]:
        """The ``n`` best (slowness, correlation), at least ``MIN_PEAK_DISTANCE`` from each other.

        Parameters
        ----------
        n : int
            Largest number of peaks.

        Returns
        -------
        list of (float, float)
            Slowness [s/m], interpolated, and correlation there [-]; the best first.
        """
        peaks, remaining = [], self.correlation.copy()
        for _ in range(n):
            k = int(np.argmax(remaining))
            if not np.isfinite(remaining[k]):
                break
            peaks.append((self._refined_peak(k), float(self.correlation[k])))
            remaining[np.abs(self.slowness - self.slowness[k]) < MIN_PEAK_DISTANCE * abs(self.slowness[k])] = -np.inf
        return peaks

    def _refined_peak(self, k: int) -> float:
        if not 0 < k < len(self.slowness) - 1:
            return float(self.slowness[k])
        low, mid, high = self.correlation[k - 1 : k + 2]
        curve = low - 2 * mid + high
        shift = 0.5 * (low - high) / curve if curve < 0 else 0.0
        step = 0.5 * (self.slowness[k + 1] - self.slowness[k - 1])
        return float(self.slowness[k] + np.clip(shift, -1, 1) * step)


def slowness_grid(settings: PassageSettings) -> np.ndarray:
    """Signed slownesses between the slowest and the fastest train, with steps of ``SLOWNESS_STEP``. [s/m]

    Parameters
    ----------
    settings : PassageSettings
        Slowest and fastest train.

    Returns
    -------
    (n,) array of float
        Slownesses, the negative ones first. [s/m]
    """
    slow, fast = KMH / settings.speed_minimum, KMH / settings.speed_maximum
    positive = np.geomspace(fast, slow, int(np.log(slow / fast) / SLOWNESS_STEP) + 2)
    return np.concatenate([-positive[::-1], positive])


def scan_slowness(values: np.ndarray, step: float, positions: np.ndarray, settings: PassageSettings) -> Scan:
    """Slant stack of levels (n_sensor, n_bin) of sensors at ``positions`` [m].

    Bogies are not resolved, so that there are no false maxima.

    Parameters
    ----------
    values : (n_sensor, n_bin) array of float
        Levels of the sensors. [nepers of power]
    step : float
        Length of a bin. [s]
    positions : (n_sensor,) array of float
        Positions of the sensors. [m]
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    Scan
        Over all slownesses of trains.
    """
    slowness = slowness_grid(settings)
    return Scan(slowness, correlation_at(slowness, values, step, positions))


def correlation_at(slowness: np.ndarray, values: np.ndarray, step: float, positions: np.ndarray) -> np.ndarray:
    """(n,) correlation of all sensors at each slowness [s/m]; at 0 that of simultaneous records.

    Parameters
    ----------
    slowness : (n,) array of float
        Slownesses. [s/m]
    values : (n_sensor, n_bin) array of float
        Levels of the sensors. [nepers of power]
    step : float
        Length of a bin. [s]
    positions : (n_sensor,) array of float
        Positions of the sensors. [m]

    Returns
    -------
    (n,) array of float
        Mean correlation coefficient. [-]
    """
    positions = np.asarray(positions, dtype=float)
    # as wide as the grid at the slow end, where a passage is long
    width = np.clip(0.008 * np.ptp(positions) * KMH / 20.0, 0.02, 0.1)
    values, step = coarsen(values, step, 0.005)
    return stack_correlations(
        pair_correlations(values, step, width), step, positions, np.asarray(slowness, dtype=float)
    )


def refine_slowness(
    correlations: Mapping[tuple[int, int], np.ndarray],
    step: float,
    positions: np.ndarray,
    near: float,
) -> tuple[float, float]:
    """Best slowness within ``REFINED_WIDTH`` of ``near`` and its correlation, from fine ``pair_correlations``.

    Parameters
    ----------
    correlations : mapping
        As ``pair_correlations`` returns them.
    step : float
        Length of a bin. [s]
    positions : (n_sensor,) array of float
        Positions of the sensors. [m]
    near : float
        Slowness in the middle of the range. [s/m]

    Returns
    -------
    slowness, correlation : float
        [s/m], [-]
    """
    positions = np.asarray(positions, dtype=float)
    span = max(np.ptp(positions), 0.1)
    n = int(np.clip(2 * REFINED_WIDTH * abs(near) * span / (0.5 * step), 21, 601)) | 1
    slowness = near * np.linspace(1 - REFINED_WIDTH, 1 + REFINED_WIDTH, n)
    return Scan(slowness, stack_correlations(correlations, step, positions, slowness)).peaks(1)[0]


def coarsen(values: np.ndarray, step: float, max_step: float) -> tuple[np.ndarray, float]:
    """(levels, step) averaged over as many bins as fit into ``max_step`` [s].

    Parameters
    ----------
    values : (n_sensor, n_bin) array of float
        Levels of the sensors. [any unit]
    step : float
        Length of a bin. [s]
    max_step : float
        Largest length of the new bins. [s]

    Returns
    -------
    values : (n_sensor, n) array of float
        Means. [same unit]
    step : float
        Length of the new bins. [s]
    """
    values, k = np.atleast_2d(values), max(int(max_step / step + 1e-9), 1)
    n = values.shape[1] // k
    return values[:, : n * k].reshape(len(values), n, k).mean(axis=2), k * step


def pair_correlations(values: np.ndarray, step: float, width: float) -> dict[tuple[int, int], np.ndarray]:
    """(i, j) -> (n_lag,) correlation coefficient of sensors i and j over the lag [bins], negative ones at the end.

    Parameters
    ----------
    values : (n_sensor, n_bin) array of float
        Levels of the sensors. [any unit]
    step : float
        Length of a bin. [s]
    width : float
        Length of the moving mean. [s]

    Returns
    -------
    dict
        (i, j) -> (n_lag,) array of float. [-]
    """
    smooth = ndimage.uniform_filter1d(np.atleast_2d(values), max(round(width / step), 1), axis=1)
    n = fft.next_fast_len(2 * smooth.shape[1], real=True)
    centred = smooth - smooth.mean(axis=1, keepdims=True)
    centred /= np.maximum(np.linalg.norm(centred, axis=1, keepdims=True), 1e-12)
    spectra = fft.rfft(centred, n, axis=1)
    correlations = {}
    for i in range(len(spectra) - 1):
        for j, row in enumerate(fft.irfft(spectra[i + 1 :] * spectra[i].conj(), n, axis=1), i + 1):
            correlations[i, j] = row
    return correlations


def stack_correlations(
    correlations: Mapping[tuple[int, int], np.ndarray], step: float, positions: np.ndarray, slowness: np.ndarray
) -> np.ndarray:
    """(n,) mean correlation coefficient of the pairs after the shifts of each slowness, weighted by distance to 3 m.

    Parameters
    ----------
    correlations : mapping
        As ``pair_correlations`` returns them.
    step : float
        Length of a bin. [s]
    positions : (n_sensor,) array of float
        Positions of the sensors. [m]
    slowness : (n,) array of float
        Slownesses. [s/m]

    Returns
    -------
    (n,) array of float
        -inf where no two sensors are 0.05 m apart. [-]
    """
    total, weight = np.zeros(len(slowness)), 0.0
    for (i, j), correlation in correlations.items():
        distance = positions[j] - positions[i]
        if not abs(distance) >= 0.05:
            continue
        n = correlation.size
        lag = slowness * distance / step
        whole = np.floor(lag).astype(int)
        fraction = lag - whole
        w = min(abs(distance), 3.0)
        total += w * ((1 - fraction) * correlation[whole % n] + fraction * correlation[(whole + 1) % n])
        weight += w
    return total / weight if weight else np.full(len(slowness), -np.inf)
