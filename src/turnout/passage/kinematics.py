"""Describe the motion of a train past the sensors: constant acceleration, in either direction.

Estimate speed and direction from the levels of two or more sensors, before any axle is known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft, ndimage

from turnout.constants import KMH

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from turnout.config.settings.passage import PassageSettings

MIN_PEAK_DISTANCE = 0.04  # of the slowness, between two peaks of a scan
SLOWNESS_STEP = 0.008  # of the slowness, in a coarse scan
REFINED_WIDTH = 0.03  # of the slowness, to either side in a fine scan


@dataclass(frozen=True)
class Motion:
    r"""Travel of the first axle: :math:`u(t) = v (t - t_0) + \tfrac12 a (t - t_0)^2` from the origin.

    ``speed`` [m/s] above 0 and ``acceleration`` [m/s²] at ``start`` [s], when the first axle passes the ``origin``, a
    position [m]. ``direction`` is +1 where the train runs towards larger positions (facing: from the switch to the
    crossing), -1 against them. An axle ``d`` metres behind the first passes the position ``x`` when
    u = d + direction * (x - origin).
    """

    speed: float
    start: float = 0.0
    acceleration: float = 0.0
    direction: int = 1
    origin: float = 0.0

    def time(self, distance: float | np.ndarray) -> np.ndarray:
        """Time at which the first axle is ``distance`` [m] past the origin; negative ``distance`` before it. [s]

        Parameters
        ----------
        distance : float or (...) array of float
            Distance past the origin. [m]

        Returns
        -------
        (...) array of float
            Of the shape of ``distance``. [s]

        Examples
        --------
        >>> float(Motion(10.0, 1.0, 2.0).time(24.0))
        3.0
        """
        return _time_at(self.speed, self.start, self.acceleration, np.asarray(distance, dtype=float))

    def distance(self, time: float | np.ndarray) -> np.ndarray:
        """Distance that the first axle has travelled from the origin at ``time``: the inverse of ``time()``. [m]

        Parameters
        ----------
        time : float or (...) array of float
            Time after the start of the recording. [s]

        Returns
        -------
        (...) array of float
            Of the shape of ``time``. [m]
        """
        elapsed = np.asarray(time, dtype=float) - self.start
        return self.speed * elapsed + 0.5 * self.acceleration * elapsed**2

    def passing(self, offsets: np.ndarray, position: float) -> np.ndarray:
        """Times at which axles ``offsets`` [m] behind the first pass ``position`` [m]. [s]

        Parameters
        ----------
        offsets : (...) array of float
            Distances of the axles behind the first. [m]
        position : float
            Position along the turnout. [m]

        Returns
        -------
        (...) array of float
            Of the shape of ``offsets``. [s]
        """
        return self.time(np.asarray(offsets, dtype=float) + self.direction * (position - self.origin))

    def speed_at(self, time: float | np.ndarray) -> np.ndarray:
        """Speed at ``time`` [s]. [m/s]

        Parameters
        ----------
        time : float or (...) array of float
            Time after the start of the recording. [s]

        Returns
        -------
        (...) array of float
            Of the shape of ``time``. [m/s]
        """
        return self.speed + self.acceleration * (np.asarray(time) - self.start)

    def relative_to_axle(self, distance: float) -> Motion:
        """The same motion relative to an axle ``distance`` metres behind the first.

        Parameters
        ----------
        distance : float
            Distance of the axle behind the first. [m]

        Returns
        -------
        Motion
            With that axle at the origin at its start.
        """
        start = float(self.time(distance))
        return replace(self, speed=float(self.speed_at(start)), start=start)

    def from_position(self, position: float) -> Motion:
        """The same motion with its origin at another position. [m]

        Parameters
        ----------
        position : float
            New origin, which the first axle passes at the new start. [m]

        Returns
        -------
        Motion
            ``passing`` gives the same times. The origin stays where the first axle never was at ``position``.

        Examples
        --------
        >>> Motion(10.0, 1.0, 2.0).from_position(24.0)
        Motion(speed=14.0, start=3.0, acceleration=2.0, direction=1, origin=24.0)
        >>> Motion(10.0, 1.0, 2.0).from_position(-30.0).origin
        0.0
        """
        distance = self.direction * (position - self.origin)
        if self.speed**2 + 2.0 * self.acceleration * distance <= 0.0:
            return self
        return replace(self.relative_to_axle(distance), origin=position)


def _time_at(
    speed: float | np.ndarray, start: float | np.ndarray, acceleration: float | np.ndarray, distance: np.ndarray
) -> np.ndarray:
    speed_squared = np.maximum(speed**2 + 2.0 * acceleration * distance, 1e-6)
    # rationalised root: no cancellation as the acceleration goes to 0
    return start + 2.0 * distance / (speed + np.sqrt(speed_squared))


def passing_times(motions: Sequence[Motion], offsets: np.ndarray, position: float) -> np.ndarray:
    """``Motion.passing`` of several motions. [s]

    Parameters
    ----------
    motions : sequence of Motion
        Motions, one for each row.
    offsets : (n_motion, n) array of float
        Distances of axles behind the first. [m]
    position : float
        Position along the turnout. [m]

    Returns
    -------
    (n_motion, n) array of float
        Times at which these axles pass the position. [s]
    """
    speed, start, acceleration, direction, origin = (
        np.array([[value] for value in values])
        for values in zip(*((m.speed, m.start, m.acceleration, m.direction, m.origin) for m in motions))
    )
    return _time_at(speed, start, acceleration, offsets + direction * (position - origin))


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
