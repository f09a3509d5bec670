"""Least-squares fit of damped modes to decays, with the amplitudes projected out, and its linearisation."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from turnout.identify.wave_sums import WaveTable, pair_sums

RIDGE = 1e-13


@dataclass(frozen=True)
class Linearisation:
    r"""Fit of :math:`y_k = \mathrm{Re} \sum_m \alpha_m z_m^k + \text{drift}` around given modes, per decay.

    ``information`` (n_decay, p, p) is J^T J and ``score`` (n_decay, p) is J^T r for the p = 2 n_mode parameters
    (ln f, zeta of each mode in turn), amplitudes and drift eliminated; ``rss`` (n_decay,) the squared residual,
    ``amplitude`` (n_decay, n_mode) complex, ``residual`` (n_decay, n); ``gram`` (n_decay, k, k) and
    ``coefficient`` (n_decay, k) belong to the columns of the model: cosines, sines, drift. Where all decays share
    their modes there is one ``gram`` (1, k, k).
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
    table = WaveTable.of(z, n)
    whole = table.coarse[..., :, None] * table.fine[..., None, :]
    return whole.reshape(*np.shape(z), -1)[..., :n]


def linearise(theta, decays, rate, drift) -> Linearisation:
    r"""Residual, amplitudes and Kaufman's Jacobian of the variable projection, for all decays at once.

    .. math:: J = (I - B B^+) \, \mathrm{d}B \, a, \qquad r = (I - B B^+) y

    Neither B nor its derivative is formed: they enter by sums over samples, which are geometric series among the
    waves and products of short tables with the data.

    Parameters
    ----------
    theta : (n_decay, n_mode, 2) or (1, n_mode, 2) array of float
        ln of the frequency in Hz, and damping ratio (inside -1 ... 1); one set may be shared by all decays.
    decays : (n_decay, n) array of float
    rate : float
        [Hz]
    drift : (n_drift, n) array of float
        Further columns of the model, such as :func:`drift_columns`.

    References
    ----------
    Golub and Pereyra 1973; Kaufman 1975.
    """
    n_decay, n = decays.shape
    # One group of decays for each set of modes: all in one, or each alone.
    group = decays.reshape(len(theta), -1, n)
    pole, slope = _poles(theta, rate)
    waves = WaveTable.of(np.exp(pole), n)
    plus, minus = pair_sums(waves)
    gram, of_drift = _gram(waves, plus, minus, drift)
    right = np.concatenate([_stacked(waves.products(waves.blocks(group))), drift @ np.swapaxes(group, -1, -2)], axis=-2)
    coefficient = np.swapaxes(np.linalg.solve(gram, right), -1, -2)
    n_mode = theta.shape[1]
    amplitude = coefficient[..., :n_mode] - 1j * coefficient[..., n_mode : 2 * n_mode]
    residual = group - waves.series(amplitude)
    if len(drift):
        residual -= coefficient[..., 2 * n_mode :] @ drift
    ramped = np.swapaxes(waves.products(waves.blocks(residual * np.arange(n))), -1, -2)
    # (group, decay, mode, parameter): what a step in a parameter does is Re(tilt k z^k)
    tilt = slope[:, None] * amplitude[..., None]
    score = np.real(tilt * ramped[..., None])
    information = _information(tilt, gram, plus, minus, of_drift)
    return Linearisation(
        information.reshape(n_decay, 2 * n_mode, 2 * n_mode),
        score.reshape(n_decay, 2 * n_mode),
        np.einsum("gdk,gdk->gd", residual, residual).ravel(),
        amplitude.reshape(n_decay, n_mode),
        residual.reshape(n_decay, n),
        gram,
        coefficient.reshape(n_decay, -1),
    )


def _poles(theta, rate):
    """Logarithms (group, n_mode) of the discrete poles, and (..., 2) their derivatives by ln f and zeta."""
    omega = 2.0 * np.pi * np.exp(theta[..., 0]) / rate
    zeta = theta[..., 1]
    damped = np.sqrt(1.0 - zeta**2)
    pole = omega * (-zeta + 1j * damped)
    return pole, np.stack([pole, omega * (-1.0 - 1j * zeta / damped)], axis=-1)


def _stacked(z):
    """Real above imaginary parts along the axis before the last."""
    return np.concatenate([z.real, z.imag], axis=-2)


def _gram(waves, plus, minus, drift):
    """Gram matrix of cosines, sines and drift, and the sums of k z^k over the drift (group, n_mode, n_drift)."""
    p, q = plus[0], minus[0]
    m, size = p.shape[-1], 2 * p.shape[-1] + len(drift)
    gram = np.empty((len(p), size, size))
    gram[:, :m, :m], gram[:, m : 2 * m, m : 2 * m] = 0.5 * (p + q).real, 0.5 * (q - p).real
    gram[:, :m, m : 2 * m] = 0.5 * (p - q).imag
    gram[:, m : 2 * m, :m] = np.swapaxes(gram[:, :m, m : 2 * m], -1, -2)
    of_drift = np.empty((len(p), m, 0))
    if len(drift):
        both = np.concatenate([drift, drift * np.arange(drift.shape[1])])
        sums = waves.products(waves.blocks(both))
        gram[:, 2 * m :, : 2 * m] = np.swapaxes(_stacked(sums[..., : len(drift)]), -1, -2)
        gram[:, : 2 * m, 2 * m :] = np.swapaxes(gram[:, 2 * m :, : 2 * m], -1, -2)
        gram[:, 2 * m :, 2 * m :] = drift @ drift.T
        of_drift = sums[..., len(drift) :]
    gram += (RIDGE * np.einsum("gjj->g", gram))[:, None, None] * np.eye(size)
    return gram, of_drift


def _information(tilt, gram, plus, minus, of_drift):
    """J^T J (group, decay, p, p) of Re(tilt k z^k), less what the columns of the model take up."""
    n_group, n_decay, m, _ = tilt.shape
    flat = tilt.reshape(n_group, n_decay, 2 * m)
    twice = np.repeat(np.arange(m), 2)
    p2, q2 = (s[2][:, twice][:, :, twice][:, None] for s in (plus, minus))
    square = 0.5 * np.real(flat[..., :, None] * (flat[..., None, :] * p2 + flat[..., None, :].conj() * q2))
    p1, q1 = (s[1][:, twice][:, None] for s in (plus, minus))
    across = np.concatenate(
        [
            0.5 * np.real(flat[..., None] * (p1 + q1)),
            0.5 * np.imag(flat[..., None] * (p1 - q1)),
            np.real(flat[..., None] * of_drift[:, twice][:, None]),
        ],
        axis=-1,
    )
    right = np.swapaxes(across.reshape(n_group, n_decay * 2 * m, -1), -1, -2)
    taken = np.swapaxes(np.linalg.solve(gram, right), -1, -2).reshape(across.shape)
    return square - across @ np.swapaxes(taken, -1, -2)
