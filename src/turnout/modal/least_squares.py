"""Linearise the least-squares fit of damped modes to decays, with the amplitudes eliminated.

Sums over samples of products of two damped waves are geometric series. The sums are compiled (``wave_kernels``).
"""

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.polynomial import legendre

SERIES_TERMS = 14  # terms of the exponential series that sums q^k near q = 1


@cache
def power_sums(n: int) -> np.ndarray:
    """Sums over k of (k / n) to the power p + j, for series of geometric sums.

    Parameters
    ----------
    n : int
        Number of samples.

    Returns
    -------
    (3, SERIES_TERMS) array of float
        Row p, term j.
    """
    k = np.arange(n) / n
    return np.array([[np.sum(k ** (p + j)) for j in range(SERIES_TERMS)] for p in range(3)])


@dataclass(frozen=True)
class Linearisation:
    r"""Fit of :math:`y_k = \mathrm{Re} \sum_m \alpha_m z_m^k + \text{drift}` around given modes, per decay.

    ``information`` (n_decay, p, p) is J^T J and ``score`` (n_decay, p) is J^T r, with amplitudes and drift
    eliminated. The p = 2 n_mode parameters are ln f and zeta of each mode in turn. ``rss`` (n_decay,) is the sum of
    squared residuals, ``amplitude`` (n_decay, n_mode) is complex, ``residual`` is (n_decay, n). ``gram``
    (n_decay, k, k) and ``coefficient`` (n_decay, k) belong to the columns of the model: cosines, sines, drift. If all
    decays share their modes there is one ``gram`` (1, k, k).
    """

    information: np.ndarray
    score: np.ndarray
    rss: np.ndarray
    amplitude: np.ndarray
    residual: np.ndarray
    gram: np.ndarray
    coefficient: np.ndarray


@lru_cache(maxsize=64)
def drift_columns(n: int, degree: int) -> np.ndarray:
    """Orthonormal polynomials over the record; degree -1 gives none. Callers share the array, and must not change it.

    Parameters
    ----------
    n : int
        Samples of a decay.
    degree : int
        Highest degree, -1 or more.

    Returns
    -------
    (degree + 1, n) array of float
        One polynomial per row.

    Examples
    --------
    >>> drift_columns(4, 0)
    array([[0.5, 0.5, 0.5, 0.5]])
    """
    if degree < 0:
        return np.empty((0, n))
    columns = legendre.legvander(np.linspace(-1.0, 1.0, n), degree)
    q, r = np.linalg.qr(columns)
    return np.ascontiguousarray((q * np.sign(np.diag(r))).T)


def powers(z: np.ndarray, n: int) -> np.ndarray:
    """z^0 ... z^(n-1) along a new last axis, by two short tables and one product.

    Parameters
    ----------
    z : (...) array of complex
        Factors, of any shape.
    n : int
        Number of powers.

    Returns
    -------
    (..., n) array of complex
        Powers of each ``z``.

    Examples
    --------
    >>> powers(np.array([2.0 + 0j]), 4).real
    array([[1., 2., 4., 8.]])
    """
    width = int(np.ceil(np.sqrt(n)))
    fine = _first_powers(z, width + 1)
    coarse = _first_powers(fine[..., width], -(-n // width))
    products = coarse[..., :, None] * fine[..., None, :width]
    return products.reshape(*np.shape(z), -1)[..., :n]


def _first_powers(z: np.ndarray, n: int) -> np.ndarray:
    """z^0 ... z^(n-1) along a new last axis."""
    table = np.empty((*np.shape(z), n), dtype=complex)
    table[..., 0] = 1.0
    table[..., 1:] = np.asarray(z)[..., None]
    return np.cumprod(table, axis=-1)


def linearise(theta: np.ndarray, decays: np.ndarray, rate: float, drift: np.ndarray) -> Linearisation:
    r"""Residual, amplitudes and Kaufman's Jacobian of the variable projection, for all decays at once.

    .. math:: J = (I - B B^+) \, \mathrm{d}B \, a, \qquad r = (I - B B^+) y

    The derivative of B is not formed: its products are geometric series.

    Parameters
    ----------
    theta : (n_decay, n_mode, 2) or (1, n_mode, 2) array of float
        ln of the frequency in Hz, and damping ratio (inside -1 ... 1); one set may be shared by all decays.
    decays : (n_decay, n) array of float
        Decays; whitened ones have the same poles.
    rate : float
        [Hz]
    drift : (n_drift, n) array of float
        Further columns of the model, such as :func:`drift_columns`.

    Returns
    -------
    Linearisation
        Residual and derivatives of each decay.

    Raises
    ------
    ValueError
        For a damping ratio of 1 or more in magnitude: such a mode does not oscillate, and the derivative of its pole
        is infinite.

    References
    ----------
    Golub and Pereyra 1973; Kaufman 1975.
    """
    # At the first use, since numba takes a third of a second to import.
    from turnout.modal.wave_kernels import fit_waves

    theta, group = group_decays(theta, decays)
    return linearisation_of(fit_waves(theta, rate, group, contiguous(drift), power_sums(group.shape[-1])))


def contiguous(values: np.ndarray) -> np.ndarray:
    """Values as compiled sums need them. For a read-only array numba would compile each sum once more.

    Parameters
    ----------
    values : (...) array of float
        Any.

    Returns
    -------
    (...) array of float
        Contiguous and writeable; ``values`` itself if it is.
    """
    return np.require(values, dtype=float, requirements=("C", "W"))


def group_decays(theta: np.ndarray, decays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Modes, and the decays of each set of them: all decays in one group, or each in its own.

    Parameters
    ----------
    theta : (n_group, n_mode, 2) array of float
        ln of the frequency in Hz, and damping ratio.
    decays : (n_decay, n) array of float
        Decays of a group follow each other.

    Returns
    -------
    (n_group, n_mode, 2) array of float, (n_group, n_decay / n_group, n) array of float
        Both contiguous.

    Raises
    ------
    ValueError
        For a damping ratio of 1 or more in magnitude.
    """
    if np.any(np.abs(theta[..., 1]) >= 1.0):
        raise ValueError(f"need damping ratios below 1, the highest is {np.max(np.abs(theta[..., 1])):.3g}")
    return contiguous(theta), contiguous(decays).reshape(len(theta), -1, decays.shape[1])


def linearisation_of(fit: tuple[np.ndarray, ...]) -> Linearisation:
    """Results of :func:`~turnout.modal.wave_kernels.fit_waves` without their groups.

    Parameters
    ----------
    fit : tuple of (n_group, ...) arrays of float
        What it returns.

    Returns
    -------
    Linearisation
        One row per decay.
    """
    gram, coefficient, residual, rss, score, information = fit
    p = score.shape[-1]
    coefficient = coefficient.reshape(-1, coefficient.shape[-1])
    return Linearisation(
        information.reshape(-1, p, p),
        score.reshape(-1, p),
        rss.ravel(),
        coefficient[:, : p // 2] - 1j * coefficient[:, p // 2 : p],
        residual.reshape(-1, residual.shape[-1]),
        gram,
        coefficient,
    )
