"""Sums over the samples of damped waves z^k and their products, from short tables and without the waves themselves."""

from dataclasses import dataclass

import numpy as np
from scipy.special import factorial

# At this distance times n the differences still keep 14 digits and 14 terms of the series all 16.
NEAR_ONE = 0.5
SERIES_TERMS = 14


@dataclass(frozen=True)
class WaveTable:
    r"""Waves :math:`z^k = c_i f_j` with k = width i + j, as two short tables.

    ``fine`` (..., n_wave, width) and ``coarse`` (..., n_wave, n_block) hold :math:`z^j` and :math:`z^{\text{width} i}`;
    ``n`` samples are meant, the rest of the last block is not.
    """

    z: np.ndarray
    fine: np.ndarray
    coarse: np.ndarray
    n: int

    @classmethod
    def of(cls, z, n: int) -> "WaveTable":
        """Tables of (..., n_wave) complex ``z`` for ``n`` samples."""
        width = int(np.ceil(np.sqrt(n)))
        fine = _first_powers(z, width + 1)
        coarse = _first_powers(fine[..., width], -(-n // width))
        return cls(z, fine[..., :width], coarse, n)

    def last(self) -> np.ndarray:
        """(..., n_wave) the power z^n, just behind the last sample."""
        block, rest = divmod(self.n, self.fine.shape[-1])
        if block < self.coarse.shape[-1]:
            return self.coarse[..., block] * self.fine[..., rest]
        return self.coarse[..., -1] * self.fine[..., -1] * self.z

    def blocks(self, series) -> np.ndarray:
        """(..., width, n_series * n_block) of (..., n_series, n) real ``series``, as :meth:`products` wants them."""
        width, n_block = self.fine.shape[-1], self.coarse.shape[-1]
        padded = np.zeros((*series.shape[:-1], n_block * width))
        padded[..., : self.n] = series
        return np.moveaxis(padded.reshape(-1, *series.shape[-2:-1], n_block, width), -1, 1).reshape(
            *series.shape[:-2], width, -1
        )

    def products(self, blocks) -> np.ndarray:
        r"""(..., n_wave, n_series) of :math:`\sum_k z^k y_k`, with ``blocks`` from :meth:`blocks`.

        >>> table = WaveTable.of(np.array([0.5 + 0j]), 4)
        >>> table.products(table.blocks(np.array([[1.0, 2.0, 4.0, 8.0]]))).real
        array([[4.]])
        """
        n_wave = self.fine.shape[-2]
        both = np.concatenate([self.fine.real, self.fine.imag], axis=-2) @ blocks
        both = both.reshape(*both.shape[:-1], -1, self.coarse.shape[-1])
        inner = both[..., :n_wave, :, :] + 1j * both[..., n_wave:, :, :]
        return (inner @ self.coarse[..., None])[..., 0]

    def series(self, amplitude) -> np.ndarray:
        r"""(..., n_series, n) real series :math:`\mathrm{Re} \sum_m a_m z_m^k` of (..., n_series, n_wave) amplitudes.

        >>> WaveTable.of(np.array([0.5 + 0j]), 4).series(np.array([[8.0]]))
        array([[8., 4., 2., 1.]])
        """
        turned = amplitude[..., None, :] * np.swapaxes(self.coarse, -1, -2)[..., None, :, :]
        both = np.concatenate([turned.real, -turned.imag], axis=-1)
        flat = both.reshape(*both.shape[:-3], -1, both.shape[-1])
        whole = flat @ np.concatenate([self.fine.real, self.fine.imag], axis=-2)
        return whole.reshape(*amplitude.shape[:-1], -1)[..., : self.n]


def geometric_sums(q, q_to_n, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Sums :math:`\sum_{k<n} k^p q^k` for p = 0, 1, 2, each from the one before by telescoping.

    .. math:: (1 - q) S_0 = 1 - q^n, \quad (1 - q) S_1 = q S_0 - n q^n, \quad (1 - q) S_2 = q (2 S_1 + S_0) - n^2 q^n

    Where q is so near to 1 that these differences lose digits, the exponential series of :math:`q^k` is summed.

    Parameters
    ----------
    q, q_to_n : arrays of complex of one shape
        q and its n-th power.
    n : int

    Examples
    --------
    >>> one, q = np.ones(1), np.array([0.5])
    >>> print(*geometric_sums(q, q**3, 3), *geometric_sums(one, one, 3))
    [1.75] [1.] [1.5] [3.] [3.] [5.]
    """
    near = np.abs(1.0 - q) * n < NEAR_ONE
    over = 1.0 / np.where(near, 1.0, 1.0 - q)
    zero = (1.0 - q_to_n) * over
    one = (q * zero - n * q_to_n) * over
    two = (q * (2.0 * one + zero) - n**2 * q_to_n) * over
    if near.any():
        zero[near], one[near], two[near] = _sums_near_one(np.log(q[near]), n)
    return zero, one, two


def _sums_near_one(log, n):
    """The same for (n_q,) logarithms of q, by the series of the exponential."""
    k = np.arange(n) / n
    term = (log[:, None] * n) ** np.arange(SERIES_TERMS) / factorial(np.arange(SERIES_TERMS))
    return tuple(float(n) ** p * (term @ [np.sum(k ** (p + j)) for j in range(SERIES_TERMS)]) for p in range(3))


def pair_sums(table: WaveTable) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    r"""(..., n_wave, n_wave) sums :math:`\sum_k k^p (z_i z_j)^k` and the same with :math:`\bar z_j`; p = 0, 1, 2."""
    z, last = table.z, table.last()
    second = np.concatenate([z, z.conj()], axis=-1)
    second_last = np.concatenate([last, last.conj()], axis=-1)
    sums = geometric_sums(
        z[..., :, None] * second[..., None, :], last[..., :, None] * second_last[..., None, :], table.n
    )
    m = z.shape[-1]
    return tuple(s[..., :m] for s in sums), tuple(s[..., m:] for s in sums)


def _first_powers(z, n):
    """z^0 ... z^(n-1) along a new last axis."""
    table = np.empty((*np.shape(z), n), dtype=complex)
    table[..., 0] = 1.0
    table[..., 1:] = np.asarray(z)[..., None]
    return np.cumprod(table, axis=-1)
