"""Linearise the least-squares fit of damped modes to decays, with the amplitudes eliminated.

The sums over samples of damped waves z^k and of their products come from short tables. The waves are never formed.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from scipy.special import factorial

# Limit of |1 - q| n below which the series is summed. At it the differences still have 14 digits, the series all 16.
SERIES_LIMIT = 0.5
SERIES_TERMS = 14  # terms of the exponential series


@dataclass(frozen=True)
class WaveTable:
    r"""Waves :math:`z^k = c_i f_j` with k = width i + j, as two short tables.

    ``fine`` (..., n_wave, width) and ``coarse`` (..., n_wave, n_block) hold :math:`z^j` and :math:`z^{\text{width} i}`;
    Only the first ``n`` samples count; the last block may be longer.
    """

    z: np.ndarray
    fine: np.ndarray
    coarse: np.ndarray
    n: int

    @classmethod
    def of(cls, z: np.ndarray, n: int) -> "WaveTable":
        """Tables of the powers of ``z``.

        Parameters
        ----------
        z : (..., n_wave) array of complex
            Factor of each wave per sample.
        n : int
            Samples of the waves.
        """
        width = int(np.ceil(np.sqrt(n)))
        fine = _first_powers(z, width + 1)
        coarse = _first_powers(fine[..., width], -(-n // width))
        return cls(z, fine[..., :width], coarse, n)

    def last(self) -> np.ndarray:
        """(..., n_wave) the power z^n, one sample after the last one."""
        block, offset = divmod(self.n, self.fine.shape[-1])
        if block < self.coarse.shape[-1]:
            return self.coarse[..., block] * self.fine[..., offset]
        return self.coarse[..., -1] * self.fine[..., -1] * self.z

    def blocks(self, series: np.ndarray) -> np.ndarray:
        """Series in the order that :meth:`products` needs.

        Parameters
        ----------
        series : (..., n_series, n) array of float
            Real series.

        Returns
        -------
        (..., width, n_series * n_block) array of float
            Samples by their position in a block.
        """
        width, n_block = self.fine.shape[-1], self.coarse.shape[-1]
        padded = np.zeros((*series.shape[:-1], n_block * width))
        padded[..., : self.n] = series
        return np.moveaxis(padded.reshape(-1, *series.shape[-2:-1], n_block, width), -1, 1).reshape(
            *series.shape[:-2], width, -1
        )

    def products(self, blocks: np.ndarray) -> np.ndarray:
        """Sums of :math:`z^k y_k` over the samples.

        Parameters
        ----------
        blocks : (..., width, n_series * n_block) array of float
            Series y from :meth:`blocks`.

        Returns
        -------
        (..., n_wave, n_series) array of complex
            Sum for each wave and series.

        Examples
        --------
        >>> table = WaveTable.of(np.array([0.5 + 0j]), 4)
        >>> table.products(table.blocks(np.array([[1.0, 2.0, 4.0, 8.0]]))).real
        array([[4.]])
        """
        n_wave = self.fine.shape[-2]
        stacked = np.concatenate([self.fine.real, self.fine.imag], axis=-2) @ blocks
        stacked = stacked.reshape(*stacked.shape[:-1], -1, self.coarse.shape[-1])
        inner = stacked[..., :n_wave, :, :] + 1j * stacked[..., n_wave:, :, :]
        return (inner @ self.coarse[..., None])[..., 0]

    def series(self, amplitude: np.ndarray) -> np.ndarray:
        r"""Real series :math:`\mathrm{Re} \sum_m a_m z_m^k`.

        Parameters
        ----------
        amplitude : (..., n_series, n_wave) array of complex
            Amplitude of each wave in each series.

        Returns
        -------
        (..., n_series, n) array of float
            Samples of each series.

        Examples
        --------
        >>> WaveTable.of(np.array([0.5 + 0j]), 4).series(np.array([[8.0]]))
        array([[8., 4., 2., 1.]])
        """
        rotated = amplitude[..., None, :] * np.swapaxes(self.coarse, -1, -2)[..., None, :, :]
        stacked = np.concatenate([rotated.real, -rotated.imag], axis=-1)
        flat = stacked.reshape(*stacked.shape[:-3], -1, stacked.shape[-1])
        samples = flat @ np.concatenate([self.fine.real, self.fine.imag], axis=-2)
        return samples.reshape(*amplitude.shape[:-1], -1)[..., : self.n]


def geometric_sums(q: np.ndarray, q_to_n: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Sums :math:`\sum_{k<n} k^p q^k` for p = 0, 1, 2, each from the previous one by telescoping.

    .. math:: (1 - q) S_0 = 1 - q^n, \quad (1 - q) S_1 = q S_0 - n q^n, \quad (1 - q) S_2 = q (2 S_1 + S_0) - n^2 q^n

    Where q is so close to 1 that these differences lose digits, the exponential series of :math:`q^k` is summed.

    Parameters
    ----------
    q, q_to_n : arrays of complex of one shape
        q and its n-th power.
    n : int
        Number of terms.

    Returns
    -------
    three arrays of complex
        Sums for p = 0, 1 and 2.

    Examples
    --------
    >>> one, q = np.ones(1), np.array([0.5])
    >>> print(*geometric_sums(q, q**3, 3), *geometric_sums(one, one, 3))
    [1.75] [1.] [1.5] [3.] [3.] [5.]
    """
    near_one = np.abs(1.0 - q) * n < SERIES_LIMIT
    inverse = 1.0 / np.where(near_one, 1.0, 1.0 - q)
    zero = (1.0 - q_to_n) * inverse
    one = (q * zero - n * q_to_n) * inverse
    two = (q * (2.0 * one + zero) - n**2 * q_to_n) * inverse
    if near_one.any():
        zero[near_one], one[near_one], two[near_one] = _sums_near_one(np.log(q[near_one]), n)
    return zero, one, two


def _sums_near_one(log: np.ndarray, n: int) -> tuple[np.ndarray, ...]:
    """The same sums for (n_q,) logarithms of q, by the exponential series."""
    term = (log[:, None] * n) ** np.arange(SERIES_TERMS) / factorial(np.arange(SERIES_TERMS))
    return tuple(float(n) ** p * (term @ _power_sums(n)[p]) for p in range(3))


@cache
def _power_sums(n: int) -> np.ndarray:
    """(3, SERIES_TERMS) sums over k of (k / n) to the power p + j."""
    k = np.arange(n) / n
    return np.array([[np.sum(k ** (p + j)) for j in range(SERIES_TERMS)] for p in range(3)])


def pair_sums(table: WaveTable) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    r"""(..., n_wave, n_wave) sums :math:`\sum_k k^p (z_i z_j)^k` and the same with :math:`\bar z_j`; p = 0, 1, 2.

    Parameters
    ----------
    table : WaveTable
        Waves z.

    Returns
    -------
    two tuples of three arrays of complex
        Sums of z_i z_j and of z_i times the conjugate of z_j.
    """
    z, last = table.z, table.last()
    second = np.concatenate([z, z.conj()], axis=-1)
    second_last = np.concatenate([last, last.conj()], axis=-1)
    sums = geometric_sums(
        z[..., :, None] * second[..., None, :], last[..., :, None] * second_last[..., None, :], table.n
    )
    m = z.shape[-1]
    return tuple(s[..., :m] for s in sums), tuple(s[..., m:] for s in sums)


def _first_powers(z: np.ndarray, n: int) -> np.ndarray:
    """z^0 ... z^(n-1) along a new last axis."""
    table = np.empty((*np.shape(z), n), dtype=complex)
    table[..., 0] = 1.0
    table[..., 1:] = np.asarray(z)[..., None]
    return np.cumprod(table, axis=-1)


RIDGE = 1e-13  # relative addition to the diagonal of the Gram matrix, so that it stays invertible


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


def drift_columns(n: int, degree: int) -> np.ndarray:
    """Orthonormal polynomials over the record; degree -1 gives none.

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
    z : array of complex
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
    table = WaveTable.of(z, n)
    products = table.coarse[..., :, None] * table.fine[..., None, :]
    return products.reshape(*np.shape(z), -1)[..., :n]


def linearise(theta: np.ndarray, decays: np.ndarray, rate: float, drift: np.ndarray) -> Linearisation:
    r"""Residual, amplitudes and Kaufman's Jacobian of the variable projection, for all decays at once.

    .. math:: J = (I - B B^+) \, \mathrm{d}B \, a, \qquad r = (I - B B^+) y

    Neither B nor its derivative is formed. They enter through sums over samples: geometric series for the waves, and
    products of short tables with the data.

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

    References
    ----------
    Golub and Pereyra 1973; Kaufman 1975.
    """
    n_decay, n = decays.shape
    # One group of decays for each set of modes: all decays in one group, or each in its own.
    group = decays.reshape(len(theta), -1, n)
    pole, slope = _poles(theta, rate)
    waves = WaveTable.of(np.exp(pole), n)
    plus, minus = pair_sums(waves)
    gram, of_drift = _gram(waves, plus, minus, drift)
    right = np.concatenate(
        [_stack_real_imag(waves.products(waves.blocks(group))), drift @ np.swapaxes(group, -1, -2)], axis=-2
    )
    coefficient = np.swapaxes(np.linalg.solve(gram, right), -1, -2)
    n_mode = theta.shape[1]
    amplitude = coefficient[..., :n_mode] - 1j * coefficient[..., n_mode : 2 * n_mode]
    residual = group - waves.series(amplitude)
    if len(drift):
        residual -= coefficient[..., 2 * n_mode :] @ drift
    ramped = np.swapaxes(waves.products(waves.blocks(residual * np.arange(n))), -1, -2)
    # (group, decay, mode, parameter): the derivative by a parameter is Re(tilt k z^k)
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


def _poles(theta: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Logarithms (group, n_mode) of the discrete poles, and (..., 2) their derivatives by ln f and zeta."""
    omega = 2.0 * np.pi * np.exp(theta[..., 0]) / rate
    zeta = theta[..., 1]
    damped = np.sqrt(1.0 - zeta**2)
    pole = omega * (-zeta + 1j * damped)
    return pole, np.stack([pole, omega * (-1.0 - 1j * zeta / damped)], axis=-1)


def _stack_real_imag(z: np.ndarray) -> np.ndarray:
    """Real above imaginary parts along the axis before the last."""
    return np.concatenate([z.real, z.imag], axis=-2)


def _gram(
    waves: WaveTable, plus: tuple[np.ndarray, ...], minus: tuple[np.ndarray, ...], drift: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Gram matrix of cosines, sines and drift, and the sums of k z^k over the drift (group, n_mode, n_drift)."""
    p, q = plus[0], minus[0]
    m, size = p.shape[-1], 2 * p.shape[-1] + len(drift)
    gram = np.empty((len(p), size, size))
    gram[:, :m, :m], gram[:, m : 2 * m, m : 2 * m] = 0.5 * (p + q).real, 0.5 * (q - p).real
    gram[:, :m, m : 2 * m] = 0.5 * (p - q).imag
    gram[:, m : 2 * m, :m] = np.swapaxes(gram[:, :m, m : 2 * m], -1, -2)
    of_drift = np.empty((len(p), m, 0))
    if len(drift):
        drift_and_ramp = np.concatenate([drift, drift * np.arange(drift.shape[1])])
        sums = waves.products(waves.blocks(drift_and_ramp))
        gram[:, 2 * m :, : 2 * m] = np.swapaxes(_stack_real_imag(sums[..., : len(drift)]), -1, -2)
        gram[:, : 2 * m, 2 * m :] = np.swapaxes(gram[:, 2 * m :, : 2 * m], -1, -2)
        gram[:, 2 * m :, 2 * m :] = drift @ drift.T
        of_drift = sums[..., len(drift) :]
    gram += (RIDGE * np.einsum("gjj->g", gram))[:, None, None] * np.eye(size)
    return gram, of_drift


def _information(
    tilt: np.ndarray,
    gram: np.ndarray,
    plus: tuple[np.ndarray, ...],
    minus: tuple[np.ndarray, ...],
    of_drift: np.ndarray,
) -> np.ndarray:
    """J^T J (group, decay, p, p) of Re(tilt k z^k), minus its projection on the columns of the model."""
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
    projected = np.swapaxes(np.linalg.solve(gram, right), -1, -2).reshape(across.shape)
    return square - across @ np.swapaxes(projected, -1, -2)
