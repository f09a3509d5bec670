"""Fit of each held-out impact by the modes of the other impacts, and the fit of random modes to compare with."""

import numpy as np

from turnout.modal.least_squares import drift_columns, linearise, powers
from turnout.modal.poles import discrete_pole


def fit_percent(measured, residual) -> np.ndarray:
    r"""Fit of each decay, :math:`100 (1 - \|a - \hat a\| / \|a - \bar a\|)`. [%]

    ``measured`` and ``residual`` are (n_decay, n); nan for a constant decay.

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


def held_out_fit(theta, decays, rate) -> np.ndarray:
    """Fit of each decay with the mean modes of all other decays, amplitudes refitted. [%]

    ``theta`` (n_decay, n_mode, 2) holds ln f [Hz] and zeta of each decay. A single decay gives nan.
    """
    n = len(decays)
    if n < 2:
        return np.full(n, np.nan)
    mean_modes = (theta.sum(axis=0) - theta) / (n - 1)
    mean_modes[..., 1] = np.clip(mean_modes[..., 1], 1e-5, 0.95)
    return fit_percent(decays, linearise(mean_modes, decays, rate, drift_columns(decays.shape[1], -1)).residual)


def random_mode_fits(decays, rate, bands, draws: int, seed: int = 20171001) -> np.ndarray:
    """Median fit over the decays for ``draws`` random mode sets, one mode in each band; (draws,). [%]

    Frequencies are uniform in the logarithm within ``bands`` ((low, high) [Hz] each), damping ratios uniform
    from 0.02 to 0.3. Amplitudes are fitted like those of the real modes: this is the fit that free amplitudes give.
    """
    rng = np.random.default_rng(seed)
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
