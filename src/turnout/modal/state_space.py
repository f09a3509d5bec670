"""Assemble modes, residues and diagnostics into a modal model with a state space.

The state-space pairs have the balanced form in which the paper prints its models.

Convert between the poles of a sampled system and frequencies and damping ratios.

Fit of each held-out impact by the modes of the other impacts, and the fit of random modes to compare with.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from turnout.modal.least_squares import drift_columns, linearise, powers
from turnout.records import ModalModel, Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.summary import ImpactEstimates
    from turnout.records import Mode


def modal_parameters(pole: ArrayLike, rate: float) -> tuple[np.ndarray, np.ndarray]:
    r"""Undamped natural frequency and damping ratio of discrete poles.

    .. math:: s = f_s \ln z, \quad f_n = |s| / 2\pi, \quad \zeta = -\mathrm{Re}(s) / |s|

    Parameters
    ----------
    pole : array of complex
        Eigenvalues z of the state matrix, any shape.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    frequency, damping : arrays of float
        Undamped natural frequency [Hz] and damping ratio, same shape.

    References
    ----------
    Barkhordari et al., eq. 16, which calls the frequency in Hz an angular one.

    Examples
    --------
    An undamped pole a quarter turn per sample is at a quarter of the sampling rate.

    >>> frequency, damping = modal_parameters(1j, 20e3)
    >>> print(f"{frequency:.0f} Hz, {abs(damping):.0f}")
    5000 Hz, 0
    """
    s = np.log(np.asarray(pole, dtype=complex)) * rate
    magnitude = np.abs(s)
    with np.errstate(invalid="ignore", divide="ignore"):
        damping = np.where(magnitude > 0.0, -s.real / magnitude, np.nan)
    return magnitude / (2.0 * np.pi), damping


def continuous_pole(frequency: ArrayLike, damping: ArrayLike) -> np.ndarray:
    r"""Pole in the upper half plane of an underdamped mode.

    .. math:: s = 2\pi f_n (-\zeta + i\sqrt{1-\zeta^2})

    Parameters
    ----------
    frequency : float or array
        Undamped natural frequency. [Hz]
    damping : float or array
        Damping ratio, below 1 in magnitude, broadcast against ``frequency``.

    Returns
    -------
    (...) array of complex
        Pole s. [1/s]

    Raises
    ------
    ValueError
        For a damping ratio of 1 or more.

    Examples
    --------
    >>> s = continuous_pole(1.0 / (2.0 * np.pi), 0.6)
    >>> print(f"{s:.1f}")
    -0.6+0.8j
    """
    damping = np.asarray(damping, dtype=float)
    if np.any(np.abs(damping) >= 1.0):
        raise ValueError(f"need damping ratios below 1, the highest is {np.max(np.abs(damping)):.3g}")
    return 2.0 * np.pi * np.asarray(frequency) * (-damping + 1j * np.sqrt(1.0 - damping**2))


def discrete_pole(frequency: ArrayLike, damping: ArrayLike, rate: float) -> np.ndarray:
    r"""Pole of the sampled mode, :math:`z = \exp(s / f_s)`; the inverse of :func:`modal_parameters`.

    Parameters
    ----------
    frequency : float or array
        Undamped natural frequency. [Hz]
    damping : float or array
        Damping ratio, below 1 in magnitude.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (...) array of complex
        Pole z.

    Raises
    ------
    ValueError
        For a damping ratio of 1 or more.

    Examples
    --------
    >>> f, zeta = modal_parameters(discrete_pole(99.45, 0.2912, 20e3), 20e3)
    >>> print(f"{f:.2f} Hz, {zeta:.4f}")
    99.45 Hz, 0.2912
    """
    return np.exp(continuous_pole(frequency, damping) / rate)


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


def random_mode_fits(
    decays: np.ndarray, rate: float, bands: Sequence[tuple[float, float]], draws: int, seed: int = 20171001
) -> np.ndarray:
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
    seed : int
        Seed of the draws.

    Returns
    -------
    (draws,) array of float
        Median fit of each draw. [%]
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


def balanced_pair(pole: complex, residue: complex) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Real pair with a12 = -a21, b = diag(1, -1) c^T and diagonal Gramians for :math:`y_k = \mathrm{Re}(R z^k)`.

    The Hankel matrix of a scalar decay is symmetric, H = U diag(w) U^T, so one state enters with each sign.
    Signs of the states are chosen so that a12 < 0 and c2 > 0.

    Parameters
    ----------
    pole : complex
        z in the upper half plane, inside the unit circle.
    residue : complex
        R, not 0.

    Returns
    -------
    a (2, 2), b (2,), c (2,)

    References
    ----------
    Barkhordari et al., eq. 20; Moore 1981 for balancing.

    Examples
    --------
    >>> a, b, c = balanced_pair(0.99 + 0.03j, 1.0 - 0.4j)
    >>> bool(np.isclose(a[0, 1], -a[1, 0])), bool(np.allclose(b, c * [1, -1]))
    (True, True)
    """
    root = np.sqrt(residue / 2.0)
    a = np.array([[pole.real, -pole.imag], [pole.imag, pole.real]])
    c = np.sqrt(2.0) * np.array([root.real, -root.imag])
    gramian = solve_discrete_lyapunov(a.T, np.outer(c, c))
    # Only hyperbolic rotations preserve diag(1, -1): rotate until the observability Gramian is diagonal.
    angle = -0.5 * np.arctanh(2.0 * gramian[0, 1] / (gramian[0, 0] + gramian[1, 1]))
    rotation = np.array([[np.cosh(angle), np.sinh(angle)], [np.sinh(angle), np.cosh(angle)]])
    a = np.linalg.solve(rotation, a @ rotation)
    c = c @ rotation
    signs = np.array([1.0, 1.0])
    if a[0, 1] > 0.0:
        signs[0] = -1.0
    if c[1] < 0.0:
        signs = -signs
    a, c = a * np.outer(signs, signs), c * signs
    return a, c * (1.0, -1.0), c


def block_model(
    poles: Sequence[complex] | Sequence[np.ndarray] | np.ndarray, residues: Sequence[complex] | np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Block-diagonal state matrix of several modes in turn.

    Parameters
    ----------
    poles : (m,) array of complex
        Poles in the upper half plane, inside the unit circle.
    residues : (m,) array of complex
        Residue of each pole, not 0.

    Returns
    -------
    (2m, 2m), (2m,) and (2m,) arrays of float
        State matrix, input and output vector.
    """
    order = 2 * len(poles)
    a, b, c = np.zeros((order, order)), np.zeros(order), np.zeros(order)
    for i, (pole, residue) in enumerate(zip(poles, residues, strict=True)):
        block = slice(2 * i, 2 * i + 2)
        a[block, block], b[block], c[block] = balanced_pair(complex(pole), complex(residue))
    return a, b, c


def assemble(
    estimates: Sequence[ImpactEstimates],
    modes: tuple[Mode, ...],
    residues: np.ndarray,
    validation_set: tuple[np.ndarray, np.ndarray],
    rate: float,
    settings: IdentifySettings,
    *,
    method: str,
    status: str,
    diagnostics: dict[str, Any],
    scale: str,
    **model_fields: Any,
) -> ModalModel:
    """Modal model of one section.

    Parameters
    ----------
    estimates : list of ImpactEstimates
        One for each mode.
    modes : tuple of Mode
        Their campaign values, in the order of the state vector.
    residues : (n_mode,) array of complex
        Residues of the response that ``scale`` names; ``b`` follows from them.
    validation_set : (theta, records)
        Modes (n_impact, n_mode, 2) and decays (n_impact, n) of the held-out fit.
    rate : float
        [Hz]
    settings : IdentifySettings
        Bands, and number of random mode sets.
    method : str
        Name of the method, "joint" or "paper".
    status : str
        "accepted" or "second_order_only".
    diagnostics : dict
        Diagnostics of the fit, to which those of the model are added.
    scale : str
        What the residues are the response to, with their unit.
    model_fields
        ``rejections``, ``rejected_modes``, ``stabilisation`` of the model.

    Returns
    -------
    ModalModel
        The model, with its fits in ``diagnostics``.
    """
    a, b, c = block_model([discrete_pole(m.frequency, m.damping, rate) for m in modes], residues)
    theta, records = validation_set
    fits = held_out_fit(theta, records, rate)
    edges = {name: (low, high) for name, low, high in settings.bands()}
    bands = [edges[mode.band] for mode in modes]
    random_fits = random_mode_fits(records, rate, bands, settings.null_draws) if len(records) else None
    fit_results = {
        "fit_per_impact": tuple(float(f) for f in fits),
        "fit_null": None if random_fits is None else float(np.quantile(random_fits, 0.95)),
        "fit_null_draws": settings.null_draws,
        "scale": scale,
    }
    return ModalModel(
        a=a,
        b=b,
        c=c,
        rate=rate,
        modes=modes,
        method=method,
        status=status,
        per_impact=tuple(row for e in estimates for row in e.rows()),
        fit=float(np.median(fits)) if len(fits) and np.all(np.isfinite(fits)) else None,
        diagnostics=diagnostics | fit_results,
        **model_fields,
    )


def no_model(
    rate: float, method: str, rejections: tuple[Rejection, ...], diagnostics: dict[str, Any], **extras: Any
) -> ModalModel:
    """A rejected model, with its reasons.

    Parameters
    ----------
    rate : float
        Sampling rate. [Hz]
    method : str
        Name of the method.
    rejections : tuple of Rejection
        Reasons.
    diagnostics : dict
        Diagnostics of the fit.
    **extras : Any
        Further fields of ``ModalModel``.

    Returns
    -------
    ModalModel
        Model of order 0.
    """
    empty = np.empty(0)
    return ModalModel(
        np.empty((0, 0)), empty, empty, rate, (), method, "rejected", rejections, diagnostics=diagnostics, **extras
    )


def no_decays(rate: float, method: str, dropped: Sequence[tuple[int, Rejection]]) -> ModalModel:
    """A rejected model without a usable decay.

    Parameters
    ----------
    rate : float
        Sampling rate. [Hz]
    method : str
        Name of the method.
    dropped : sequence of (int, Rejection)
        Number of each impact, and why its decay is not usable.

    Returns
    -------
    ModalModel
        Model of order 0.
    """
    rejection = Rejection("not_identified", 0, 1, "no decay is long enough" if dropped else "no decays")
    return no_model(rate, method, (rejection, *(r for _, r in dropped)), {"dropped_impacts": tuple(dropped)})
