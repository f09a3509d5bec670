"""Least-squares fit of damped modes to decays, with the amplitudes projected out, and its linearisation."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

RIDGE = 1e-13


@dataclass(frozen=True)
class Linearisation:
    r"""Fit of :math:`y_k = \mathrm{Re} \sum_m \alpha_m z_m^k + \text{drift}` around given modes, per decay.

    ``information`` (n_decay, p, p) is J^T J and ``score`` (n_decay, p) is J^T r for the p = 2 n_mode parameters
    (ln f, zeta of each mode in turn), amplitudes and drift eliminated; ``rss`` (n_decay,) the squared residual,
    ``amplitude`` (n_decay, n_mode) complex, ``residual`` (n_decay, n); ``gram`` (n_decay, k, k) and
    ``coefficient`` (n_decay, k) belong to the columns of the model: cosines, sines, drift.
    """

    information: np.ndarray
    score: np.ndarray
    rss: np.ndarray
    amplitude: np.ndarray
    residual: np.ndarray
    gram: np.ndarray
    coefficient: np.ndarray


def drift_columns(n: int, degree: int) -> np.ndarray:
    """(degree + 1, n) orthonormal polynomials over the record; degree -1 gives none.

    >>> drift_columns(4, 0)
    array([[0.5, 0.5, 0.5, 0.5]])
    """
    if degree < 0:
        return np.empty((0, n))
    columns = legendre.legvander(np.linspace(-1.0, 1.0, n), degree)
    q, r = np.linalg.qr(columns)
    return np.ascontiguousarray((q * np.sign(np.diag(r))).T)


def powers(z, n: int) -> np.ndarray:
    """z^0 ... z^(n-1) along a new last axis, by two short tables and one product.

    >>> powers(np.array([2.0 + 0j]), 4).real
    array([[1., 2., 4., 8.]])
    """
    log = np.log(z)[..., None]
    width = int(np.ceil(np.sqrt(n)))
    fine = np.exp(log * np.arange(width))
    coarse = np.exp(log * (width * np.arange(-(-n // width))))
    return (coarse[..., :, None] * fine[..., None, :]).reshape(*np.shape(z), -1)[..., :n]


def linearise(theta, decays, rate, drift) -> Linearisation:
    r"""Residual, amplitudes and Kaufman's Jacobian of the variable projection, for all decays at once.

    .. math:: J = (I - B B^+) \, \mathrm{d}B \, a, \qquad r = (I - B B^+) y

    Parameters
    ----------
    theta : (n_decay, n_mode, 2) array of float
        ln of the frequency in Hz, and damping ratio (inside -1 ... 1).
    decays : (n_decay, n) array of float
    rate : float
        [Hz]
    drift : (n_drift, n) array of float
        Further columns of the model, such as :func:`drift_columns`.

    References
    ----------
    Golub and Pereyra 1973; Kaufman 1975.
    """
    n_decay, n_mode = theta.shape[:2]
    n = decays.shape[1]
    omega = 2.0 * np.pi * np.exp(theta[..., 0]) / rate
    zeta = theta[..., 1]
    damped = np.sqrt(1.0 - zeta**2)
    s = omega * (-zeta + 1j * damped)
    wave = powers(np.exp(s), n)
    basis = np.concatenate([wave.real, wave.imag, np.broadcast_to(drift, (n_decay, *drift.shape))], axis=1)
    gram = basis @ basis.transpose(0, 2, 1)
    size = gram.shape[-1]
    trace = np.einsum("ijj->i", gram)
    gram = gram + (RIDGE * trace)[:, None, None] * np.eye(size)
    coefficient = np.linalg.solve(gram, (basis @ decays[..., None]))[..., 0]
    residual = decays - (coefficient[:, None, :] @ basis)[:, 0]
    amplitude = coefficient[:, :n_mode] - 1j * coefficient[:, n_mode : 2 * n_mode]
    slope = np.stack([s, omega * (-1.0 - 1j * zeta / damped)], axis=-1) * amplitude[..., None]
    ramp = wave * np.arange(n)
    derivative = slope.real[..., None] * ramp.real[:, :, None] - slope.imag[..., None] * ramp.imag[:, :, None]
    derivative = derivative.reshape(n_decay, 2 * n_mode, n)
    cross = derivative @ basis.transpose(0, 2, 1)
    information = derivative @ derivative.transpose(0, 2, 1) - cross @ np.linalg.solve(gram, cross.transpose(0, 2, 1))
    score = (derivative @ residual[..., None])[..., 0]
    rss = np.einsum("ij,ij->i", residual, residual)
    return Linearisation(information, score, rss, amplitude, residual, gram, coefficient)
