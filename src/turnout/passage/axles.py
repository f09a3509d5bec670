"""Find axles in the coordinate along the train, where the records of all sensors lie upon each other.

The position of each axle in the train is fitted to the level around it. From the record of one sensor the same fit
gives the times at which the axles pass that sensor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from scipy import ndimage

from turnout.passage.kinematics import Motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.passage.sensor_envelopes import SensorEnvelopes

GRID_STEP = 0.04  # m, step of the grid along the train
MAX_COUNTS = 4  # of the peaks of one feature, those of the largest contrast
WAVENUMBER = 1.1  # 1/m, of a standard rail on its foundation
MAX_LEFT_HEIGHT = 0.6  # of the typical height of an axle: no count leaves a higher peak out


@dataclass(frozen=True)
class AxleFinding:
    """``offsets`` (n_axle,) [m] behind the stack's origin, ``height`` (n_axle,) of the peaks.

    ``contrast`` is the weakest accepted peak over the strongest rejected one: near 1 the count is a guess.
    ``rival_contrast`` is the largest contrast of a count with another number of axles, 0 without one. ``weakest`` and
    ``further`` are the amplitudes of the weakest wheel and of the strongest one that the count leaves out, over the
    median wheel. ``lead`` [nat] is the log evidence of a known train over one with another number of axles.
    """

    offsets: np.ndarray
    height: np.ndarray
    contrast: float
    feature: str = ""
    rival_contrast: float = 0.0
    weakest: float = 1.0
    further: float = 0.0
    lead: float = np.inf


def along_train(
    values: np.ndarray, step: float, positions: Sequence[float] | np.ndarray, motion: Motion, start: float, stop: float
) -> np.ndarray:
    """(n_sensor, n) values at every ``GRID_STEP`` metres along the train between ``start`` and ``stop`` [m].

    Parameters
    ----------
    values : (n_sensor, n_bin) array of float
        Values over time, for example levels. [any unit]
    step : float
        Length of a bin. [s]
    positions : (n_sensor,) array of float
        Positions of the sensors. [m]
    motion : Motion
        Motion of the train.
    start, stop : float
        Range behind the motion's origin. [m]

    Returns
    -------
    (n_sensor, n) array of float
        Values along the train; 0 outside the recording. [same unit]
    """
    offsets = np.arange(start, stop, GRID_STEP)
    bins = np.arange(values.shape[1])
    rows = [
        np.interp(motion.passing(offsets, x) / step - 0.5, bins, row, left=0.0, right=0.0)
        for row, x in zip(values, positions)
    ]
    return np.array(rows)


def axle_candidates(
    profile: np.ndarray, start: float, spacing: float, noise: float, feature: str = ""
) -> list[AxleFinding]:
    """Up to ``MAX_COUNTS`` counts of the peaks of ``profile`` (n,), the one with the largest contrast first.

    Peaks are at least ``spacing`` metres from each other. The lesser of prominence and twice the height must exceed
    ``noise``. The cut lies where the ratio between neighbouring ranks is large. It never rejects peaks of more than
    ``MAX_LEFT_HEIGHT`` of the typical height.

    Parameters
    ----------
    profile : (n,) array of float
        Feature along the train on a grid of ``GRID_STEP``, about 1 at a wheel. [-]
    start : float
        Offset of the first point. [m]
    spacing : float
        Least distance between axles. [m]
    noise : float
        Least height of a peak. [-]
    feature : str
        Name of the feature.

    Returns
    -------
    list of AxleFinding
        Empty where fewer than two peaks are certain.
    """
    peaks, properties = scipy.signal.find_peaks(
        profile, distance=max(int(spacing / GRID_STEP), 1), prominence=0.2 * noise
    )
    height = np.minimum(properties["prominences"], 2.0 * profile[peaks])
    ranked = np.sort(height)[::-1]
    n_sure = int(np.sum(ranked >= noise))
    if n_sure < 2:
        return []
    typical = np.median(ranked[ranked >= 0.35 * ranked[min(2, n_sure - 1)]])
    following = np.maximum(np.append(ranked[1:], 0.0), max(0.25 * noise, 1e-12))
    ratio = np.where((ranked >= noise) & (following < MAX_LEFT_HEIGHT * typical), ranked / following, 0.0)
    ratio[0] = 0.0
    cuts = [k for k in np.argsort(-ratio, kind="stable")[:MAX_COUNTS] if ratio[k] > 0] or [n_sure - 1]
    positions = start + _refine_peaks(profile, peaks) * GRID_STEP
    return [
        AxleFinding(
            positions[height >= ranked[k]], height[height >= ranked[k]], float(ranked[k] / following[k]), feature
        )
        for k in cuts
    ]


def _refine_peaks(profile: np.ndarray, peaks: np.ndarray) -> np.ndarray:
    low, mid, high = (profile[np.clip(peaks + d, 0, len(profile) - 1)] for d in (-1, 0, 1))
    curve = low - 2 * mid + high
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(curve < 0, 0.5 * (low - high) / curve, 0.0)
    return peaks + np.clip(shift, -0.5, 0.5)


def level_feature(stack: np.ndarray) -> np.ndarray:
    """Levels along the train without everything longer than a bogie: one peak per wheel, at any load.

    Parameters
    ----------
    stack : (..., n) array of float
        Levels along the train on a grid of ``GRID_STEP``. [nepers of power]

    Returns
    -------
    (..., n) array of float
        The feature on the same grid. [nepers of power]
    """
    return _smooth(stack, 0.2) - _smooth(stack, 0.9)


def deflection_feature(stack: np.ndarray) -> np.ndarray:
    r"""Low-frequency acceleration along the train, sharpened to one peak per wheel; its sign is found here.

    A wheel causes v² w'' of the rail on its foundation, :math:`w'' \propto e^{-k|x|} (\sin k|x| - \cos kx)`,
    with k = ``WAVENUMBER``. The regularised inverse of that kernel is applied, then a Gaussian of 0.25 m. Wheels
    press in one direction: the sign is that of the larger skewness.

    Parameters
    ----------
    stack : (..., n) array of float
        Slow acceleration along the train on a grid of ``GRID_STEP``. [m/s²]

    Returns
    -------
    (..., n) array of float
        The feature on the same grid, positive at wheels. [m/s²]
    """
    x = np.arange(-4.0, 4.0 + GRID_STEP / 2, GRID_STEP)
    kx = WAVENUMBER * np.abs(x)
    kernel = np.exp(-kx) * (np.cos(kx) - np.sin(kx))
    n = int(2 ** np.ceil(np.log2(stack.shape[-1] + 2 * len(x))))
    response = np.fft.rfft(np.roll(np.pad(kernel, (0, n - len(kernel))), -(len(x) // 2)))
    power = np.abs(response) ** 2
    inverse = response.conj() / (power + 0.03 * power.max())
    sharp = np.fft.irfft(np.fft.rfft(stack, n) * inverse, n)[..., : stack.shape[-1]]
    sharp = _smooth(sharp, 0.25)
    skew = np.sum((sharp - sharp.mean(axis=-1, keepdims=True)) ** 3, axis=-1, keepdims=True)
    return np.where(skew < 0, -1.0, 1.0) * sharp


def _smooth(profile: np.ndarray, deviation: float) -> np.ndarray:
    return ndimage.gaussian_filter1d(profile, deviation / GRID_STEP, axis=-1)


def scale_profile(profile: np.ndarray, inside: np.ndarray) -> tuple[np.ndarray, float]:
    """Profile divided by its own large values within the train, and its noise on that scale.

    The noise is the standard deviation that the quietest 30 % of the values would have if they were normal. They lie
    between the wheels, which is most of a train.

    Parameters
    ----------
    profile : (n,) array of float
        Feature along the train. [any unit]
    inside : (n,) array of bool
        Points within the train.

    Returns
    -------
    profile : (n,) array of float
        About 1 at a wheel; 0 where it has no positive values. [-]
    noise : float
        Its noise, at least 0.01. [-]
    """
    top = np.quantile(profile[inside], 0.98) if inside.any() else 0.0
    if top <= 0:
        return np.zeros_like(profile), 1.0
    noise = np.quantile(np.abs(profile[inside]), 0.3) / 0.385 / top
    return profile / top, max(float(noise), 0.01)


FIT_REACH = 2.0  # m compared on either side of an axle
CONTACT_ROUNDING = 0.12  # m: contact patch and sleepers round the cusp at a wheel
MAX_SHIFT = 0.6  # m that an axle may move in the fit
MAX_FIT_STEPS = 15
MIN_SEPARATION = 3.5  # m: axles further from each other are fitted one by one
GRID_STRIDE = 2  # every second point of the grid is compared


def fit_axle_positions(envelopes: SensorEnvelopes, motion: Motion, offsets: np.ndarray) -> np.ndarray:
    r"""(n_axle,) offsets [m] of the model that comes closest to the level along the train.

    .. math:: L(s) = \ln\Bigl(1 + \sum_j e^{\alpha_j - 2 r_j/\ell}\Bigr), \qquad r_j = \sqrt{(s - d_j)^2 + \rho^2}

    Power decays from a wheel at the same rate in both directions; powers of wheels add. Peaks of a sharpened profile
    are biased outwards within a bogie, and each depends on little data. Here 4 m of record determine each axle. An
    axle that would move more than 0.6 m stays where it was.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.
    offsets : (n_axle,) array of float
        First estimates, increasing. [m]

    Returns
    -------
    (n_axle,) array of float
        Fitted offsets; the first estimates where the fitted ones are not in order. [m]
    """
    offsets = np.asarray(offsets, dtype=float)
    new_offsets = _near_axle_positions(envelopes, motion, offsets)
    new_offsets = np.where(np.isfinite(new_offsets), new_offsets, offsets)
    return new_offsets if np.all(np.diff(new_offsets) > 0.5) else offsets


def _near_axle_positions(envelopes: SensorEnvelopes, motion: Motion, offsets: np.ndarray) -> np.ndarray:
    """(n_axle,) fitted offsets [m], nan for an axle that would move more than ``MAX_SHIFT``."""
    start, stop = offsets[0] - FIT_REACH, offsets[-1] + FIT_REACH
    values, positions = envelopes.levels.values, envelopes.positions
    level = along_train(values, envelopes.levels.step, positions, motion, start, stop).mean(axis=0)
    grid, level = (start + np.arange(level.size) * GRID_STEP)[::GRID_STRIDE], level[::GRID_STRIDE]
    height = np.maximum(np.interp(offsets, grid, level), 0.1)
    new_offsets = offsets.copy()
    for group in np.split(np.arange(offsets.size), np.flatnonzero(np.diff(offsets) > MIN_SEPARATION) + 1):
        inside = slice(*np.searchsorted(grid, [offsets[group[0]] - FIT_REACH, offsets[group[-1]] + FIT_REACH]))
        initial = np.concatenate([offsets[group], height[group], [0.0]])
        candidates = _fit_positions(grid[inside], level[inside], initial, group.size)
        new_offsets[group] = np.where(np.abs(candidates - offsets[group]) <= MAX_SHIFT, candidates, np.nan)
    return new_offsets


def _fit_positions(grid: np.ndarray, level: np.ndarray, x: np.ndarray, n: int) -> np.ndarray:
    """(n,) positions by Levenberg and Marquardt from ``x``: positions, heights, logarithm of the decay length."""
    misfit, jacobian = _level_misfit(grid, level, x, n)
    cost, damping = misfit @ misfit, 1e-2
    for _ in range(MAX_FIT_STEPS):
        normal = jacobian.T @ jacobian
        normal[np.diag_indices_from(normal)] *= 1.0 + damping
        normal[np.diag_indices_from(normal)] += 1e-9
        trial = x - np.clip(np.linalg.solve(normal, jacobian.T @ misfit), -0.5, 0.5)
        new_misfit, new_jacobian = _level_misfit(grid, level, trial, n)
        new_cost = new_misfit @ new_misfit
        if new_cost >= cost:
            damping *= 10.0
            if damping > 1e6:
                break
            continue
        converged = cost - new_cost < 1e-4 * cost
        x, misfit, jacobian, cost, damping = trial, new_misfit, new_jacobian, new_cost, damping / 5.0
        if converged:
            break
    return x[:n]


def _level_misfit(grid: np.ndarray, level: np.ndarray, x: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Misfit (n_grid,) and its derivatives (n_grid, 2 n + 1)."""
    distance = grid[:, None] - x[:n]
    r, length = np.hypot(distance, CONTACT_ROUNDING), np.exp(x[-1])
    u = np.exp(np.minimum(x[n:-1] - 2.0 * r / length, 50.0))
    total = 1.0 + u.sum(axis=1, keepdims=True)
    share = u / total
    by_length = np.sum(share * 2.0 * r / length, axis=1, keepdims=True)
    return np.log(total[:, 0]) - level, np.hstack([share * 2.0 / length * distance / r, share, by_length])


def sensor_times(envelopes: SensorEnvelopes, motion: Motion, offsets: np.ndarray) -> np.ndarray:
    """(n_sensor, n_axle) passing times [s]; nan where a sensor's axle position deviates much from the common one.

    A sensor whose record has no axle near the common position has no time there: the common one is no measurement.

    Parameters
    ----------
    envelopes : SensorEnvelopes
        Envelopes of the sensors.
    motion : Motion
        Motion of the train.
    offsets : (n_axle,) array of float
        Offsets of the axles behind the first. [m]

    Returns
    -------
    (n_sensor, n_axle) array of float
        Passing times. [s]
    """
    rows = []
    for i, x in enumerate(envelopes.positions):
        axle_positions = _near_axle_positions(envelopes.select([i]), motion, offsets)
        shift = axle_positions - offsets
        deviation = np.abs(shift - np.median(shift[np.isfinite(shift)])) if np.isfinite(shift).any() else shift
        rows.append(np.where(deviation < 0.7 * MAX_SHIFT, motion.passing(axle_positions, x), np.nan))
    return np.array(rows)
