"""Fit of free decays by modes: of each held-out impact, of another response, and of random modes to compare with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.least_squares import drift_columns, linearise, powers
from turnout.modal.poles import discrete_pole
from turnout.records import ModalModel

if TYPE_CHECKING:
    from collections.abc import Sequence

RANDOM_MODES_SEED = 20171001


def fit_percent(measured: np.ndarray, residual: np.ndarray) -> np.ndarray:
    r"""Fit of each decay, :math:`100 (1 - \|a - \hat a\| / \|a - \bar a\|)`.

    Parameters
    ----------
    measured : (n_decay, n) array of float
        Measured decays.
    residual : (n_decay, n) array of float
        Measured minus modelled decays.

    Returns
    -------
    (n_decay,) array of float
        Fit of each decay, nan for a constant one. [%]

    References
    ----------
    Barkhordari et al., eq. 22, with its brackets corrected.

    Examples
    --------
    >>> fit_percent(np.array([[1.0, -1.0]]), np.array([[0.5, -0.5]]))
    array([50.])
    """
    centred = np.linalg.norm(measured - measured.mean(axis=-1, keepdims=True), axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(centred > 0.0, 100.0 * (1.0 - np.linalg.norm(residual, axis=-1) / centred), np.nan)


def held_out_fit(theta: np.ndarray, decays: np.ndarray, rate: float) -> np.ndarray:
    """Fit of each decay with the mean modes of all other decays, amplitudes refitted.

    Parameters
    ----------
    theta : (n_decay, n_mode, 2) array of float
        Ln f [Hz] and zeta of each decay.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (n_decay,) array of float
        Fit, nan for a single decay. [%]
    """
    n = len(decays)
    if n < 2:
        return np.full(n, np.nan)
    mean_modes = (theta.sum(axis=0) - theta) / (n - 1)
    mean_modes[..., 1] = np.clip(mean_modes[..., 1], 1e-5, 0.95)
    return fit_percent(decays, linearise(mean_modes, decays, rate, drift_columns(decays.shape[1], -1)).residual)


def validation_fit(model: ModalModel, decays: Sequence[np.ndarray]) -> np.ndarray:
    """Fit of decays of another response with the modes of a model, amplitudes refitted.

    Parameters
    ----------
    model : ModalModel
        Model with at least one mode.
    decays : sequence of (n,) arrays of float
        Free decays that took no part in the identification, at the model's rate. [m/s²]

    Returns
    -------
    (n_decay,) array of float
        Fit of each decay. [%]
    """
    n = min(len(decay) for decay in decays)
    records = np.array([np.asarray(decay, dtype=float)[:n] for decay in decays])
    theta = np.array([[np.log(mode.frequency), mode.damping] for mode in model.modes])
    modes = np.broadcast_to(theta, (len(records), *theta.shape))
    return fit_percent(records, linearise(modes, records, model.rate, drift_columns(n, -1)).residual)


def random_mode_fits(decays: np.ndarray, rate: float, bands: Sequence[tuple[float, float]], draws: int) -> np.ndarray:
    """Median fit over the decays for random mode sets, one mode in each band.

    Frequencies are uniform in the logarithm within the bands, damping ratios uniform from 0.02 to 0.3. Amplitudes are
    fitted like those of the real modes: this is the fit that free amplitudes give.

    Parameters
    ----------
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        Sampling rate. [Hz]
    bands : sequence of (float, float)
        Lowest and highest frequency of each band. [Hz]
    draws : int
        Number of mode sets.

    Returns
    -------
    (draws,) array of float
        Median fit of each draw. [%]
    """
    rng = np.random.default_rng(RANDOM_MODES_SEED)
    low, high = np.log(np.array(bands, dtype=float)).T
    log_frequency = rng.uniform(low, high, (draws, len(bands)))
    theta = np.stack([log_frequency, rng.uniform(0.02, 0.3, log_frequency.shape)], axis=-1)
    n = decays.shape[1]
    wave = powers(discrete_pole(np.exp(log_frequency), theta[..., 1], rate), n)
    basis = np.concatenate([wave.real, wave.imag], axis=1)
    gram = basis @ basis.transpose(0, 2, 1)
    centred = np.linalg.norm(decays - decays.mean(axis=1, keepdims=True), axis=1)
    product = basis @ decays.T
    explained = np.einsum("dki,dki->di", product, np.linalg.solve(gram, product))
    residual = np.sqrt(np.maximum(np.sum(decays**2, axis=1) - explained, 0.0))
    return np.median(100.0 * (1.0 - residual / centred), axis=1)
