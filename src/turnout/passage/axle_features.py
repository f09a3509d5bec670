"""Find axles in the coordinate along the train, where the records of all sensors lie upon each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage, signal

from turnout.passage.kinematics import Motion

GRID_STEP = 0.04  # m, step of the grid along the train


@dataclass(frozen=True)
class AxleFinding:
    """``offsets`` (n_axle,) [m] behind the stack's origin, ``height`` (n_axle,) of the peaks.

    ``contrast`` is the weakest accepted peak over the strongest rejected one: near 1 the count is a guess.
    """

    offsets: np.ndarray
    height: np.ndarray
    contrast: float
    feature: str = ""


def along_train(values, step: float, positions, motion: Motion, start: float, stop: float) -> np.ndarray:
    """(n_sensor, n) values at every ``GRID_STEP`` metres along the train between ``start`` and ``stop`` [m]."""
    offsets = np.arange(start, stop, GRID_STEP)
    bins = np.arange(values.shape[1])
    rows = [
        np.interp(motion.passing(offsets, x) / step - 0.5, bins, row, left=0.0, right=0.0)
        for row, x in zip(values, positions)
    ]
    return np.array(rows)


def axle_candidates(profile, start: float, spacing: float, noise: float, feature: str = "", n: int = 4):
    """Up to ``n`` counts of the peaks of ``profile`` (n,), the one with the largest contrast first.

    Peaks are at least ``spacing`` metres from each other. The lesser of prominence and twice the height must exceed
    ``noise``. The cut lies where the ratio between neighbouring ranks is large. It never rejects peaks of more than 60
    % of the typical height.
    """
    peaks, properties = signal.find_peaks(profile, distance=max(int(spacing / GRID_STEP), 1), prominence=0.2 * noise)
    height = np.minimum(properties["prominences"], 2.0 * profile[peaks])
    ranked = np.sort(height)[::-1]
    n_sure = int(np.sum(ranked >= noise))
    if n_sure < 2:
        return []
    typical = np.median(ranked[ranked >= 0.35 * ranked[min(2, n_sure - 1)]])
    following = np.maximum(np.append(ranked[1:], 0.0), max(0.25 * noise, 1e-12))
    ratio = np.where((ranked >= noise) & (following < 0.6 * typical), ranked / following, 0.0)
    ratio[0] = 0.0
    cuts = [k for k in np.argsort(-ratio, kind="stable")[:n] if ratio[k] > 0] or [n_sure - 1]
    positions = start + _refine_peaks(profile, peaks) * GRID_STEP
    return [
        AxleFinding(
            positions[height >= ranked[k]], height[height >= ranked[k]], float(ranked[k] / following[k]), feature
        )
        for k in cuts
    ]


def _refine_peaks(profile, peaks):
    low, mid, high = (profile[np.clip(peaks + d, 0, len(profile) - 1)] for d in (-1, 0, 1))
    curve = low - 2 * mid + high
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(curve < 0, 0.5 * (low - high) / curve, 0.0)
    return peaks + np.clip(shift, -0.5, 0.5)


def level_feature(stack) -> np.ndarray:
    """Levels along the train without everything longer than a bogie: one peak per wheel, at any load."""
    return _smooth(stack, 0.2) - _smooth(stack, 0.9)


def deflection_feature(stack, wavenumber: float = 1.1) -> np.ndarray:
    r"""Low-frequency acceleration along the train, sharpened to one peak per wheel; its sign is found here.

    A wheel causes v² w'' of the rail on its foundation, :math:`w'' \propto e^{-k|x|} (\sin k|x| - \cos kx)`,
    k near 1 per metre for standard rails on ballast. The regularised inverse of that kernel is applied, then a
    Gaussian of 0.25 m. Wheels press in one direction: the sign is that of the larger skewness.
    """
    x = np.arange(-4.0, 4.0 + GRID_STEP / 2, GRID_STEP)
    kx = wavenumber * np.abs(x)
    kernel = np.exp(-kx) * (np.cos(kx) - np.sin(kx))
    n = int(2 ** np.ceil(np.log2(stack.shape[-1] + 2 * len(x))))
    response = np.fft.rfft(np.roll(np.pad(kernel, (0, n - len(kernel))), -(len(x) // 2)))
    power = np.abs(response) ** 2
    inverse = response.conj() / (power + 0.03 * power.max())
    sharp = np.fft.irfft(np.fft.rfft(stack, n) * inverse, n)[..., : stack.shape[-1]]
    sharp = _smooth(sharp, 0.25)
    skew = np.sum((sharp - sharp.mean(axis=-1, keepdims=True)) ** 3, axis=-1, keepdims=True)
    return np.where(skew < 0, -1.0, 1.0) * sharp


def _smooth(profile, deviation):
    return ndimage.gaussian_filter1d(profile, deviation / GRID_STEP, axis=-1)


def scale_profile(profile, inside) -> tuple[np.ndarray, float]:
    """Profile divided by its own large values within the train, and its noise on that scale.

    The noise is the standard deviation that the quietest 30 % of the values would have if they were normal. They lie
    between the wheels, which is most of a train.
    """
    top = np.quantile(profile[inside], 0.98) if inside.any() else 0.0
    if top <= 0:
        return np.zeros_like(profile), 1.0
    noise = np.quantile(np.abs(profile[inside]), 0.3) / 0.385 / top
    return profile / top, max(float(noise), 0.01)
