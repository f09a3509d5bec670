"""Compiled sums over damped waves: the least-squares fit of modes to decays, with its derivatives."""

import numpy as np

from turnout.kernel_cache import kernel

# Limit of |1 - q| n below which the series is summed. At it the differences still have 14 digits, the series all 16.
SERIES_LIMIT = 0.5
WIDTH = 32  # samples of a block: a multiple of what a processor multiplies at once
RIDGE = 1e-13  # relative addition to the diagonal of the Gram matrix, so that it stays invertible


@kernel
def geometric_sums(q: complex, q_to_n: complex, n: int, power_sums: np.ndarray) -> tuple[complex, complex, complex]:
    r"""Sums :math:`\sum_{k<n} k^p q^k` for p = 0, 1, 2, each from the previous one by telescoping.

    .. math:: (1 - q) S_0 = 1 - q^n, \quad (1 - q) S_1 = q S_0 - n q^n, \quad (1 - q) S_2 = q (2 S_1 + S_0) - n^2 q^n

    Where q is so close to 1 that these differences lose digits, the exponential series of :math:`q^k` is summed.

    Parameters
    ----------
    q, q_to_n : complex
        q and its n-th power.
    n : int
        Number of terms.
    power_sums : (3, n_term) array of float
        Sums over k of (k / n) to the power p + j.

    Returns
    -------
    three complex
        Sums for p = 0, 1 and 2.
    """
    rest = 1.0 - q
    size = rest.real * rest.real + rest.imag * rest.imag
    if size * n * n >= SERIES_LIMIT * SERIES_LIMIT:
        inverse = complex(rest.real / size, -rest.imag / size)
        zero = (1.0 - q_to_n) * inverse
        one = (q * zero - n * q_to_n) * inverse
        two = (q * (2.0 * one + zero) - float(n) * n * q_to_n) * inverse
        return zero, one, two
    exponent = np.log(q) * n
    term, zero, one, two = 1.0 + 0j, 0j, 0j, 0j
    for j in range(power_sums.shape[1]):
        zero += term * power_sums[0, j]
        one += term * power_sums[1, j]
        two += term * power_sums[2, j]
        term = term * exponent / (j + 1)
    return zero, n * one, float(n) * n * two


@kernel
def fill_waves(pole: np.ndarray, waves: np.ndarray) -> None:
    """Fill in the waves exp(pole k), from two short tables of powers.

    Parameters
    ----------
    pole : (n_mode,) array of complex
        Logarithms of the factor per sample.
    waves : (2 n_mode, n) array of float
        Filled with real parts, then imaginary parts.
    """
    n_mode, n = len(pole), waves.shape[1]
    fine_real, fine_imag = np.empty(WIDTH), np.empty(WIDTH)
    for m in range(n_mode):
        z, power = np.exp(pole[m]), 1.0 + 0j
        for j in range(WIDTH):
            fine_real[j], fine_imag[j] = power.real, power.imag
            power = power * z
        block = 1.0 + 0j
        for first in range(0, n, WIDTH):
            for j in range(min(WIDTH, n - first)):
                waves[m, first + j] = block.real * fine_real[j] - block.imag * fine_imag[j]
                waves[n_mode + m, first + j] = block.real * fine_imag[j] + block.imag * fine_real[j]
            block = block * power


@kernel
def factorise(matrix: np.ndarray, least: float) -> None:
    """Replace the lower triangle of a positive definite matrix by its Cholesky factor.

    Parameters
    ----------
    matrix : (n, n) array of float
        Symmetric; only the lower triangle is read.
    least : float
        Lower limit of a pivot: the smallest eigenvalue, where rounding may lose it.
    """
    n = len(matrix)
    for i in range(n):
        for j in range(i):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = total / matrix[j, j]
        total = matrix[i, i]
        for k in range(i):
            total -= matrix[i, k] * matrix[i, k]
        matrix[i, i] = np.sqrt(max(total, least))


@kernel
def fit_waves(
    theta: np.ndarray, rate: float, decays: np.ndarray, columns: np.ndarray, power_sums: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Amplitudes, residuals and derivatives of the least-squares fit of waves and further columns to decays.

    Parameters
    ----------
    theta : (n_group, n_mode, 2) array of float
        Ln f [Hz] and zeta of each mode.
    rate : float
        Sampling rate. [Hz]
    decays : (n_group, n_decay, n) array of float
        Decays of each group.
    columns : (n_column, n) array of float
        Further columns of the model.
    power_sums : (3, n_term) array of float
        Sums over k of (k / n) to the power p + j.

    Returns
    -------
    gram (n_group, k, k), coefficient (n_group, n_decay, k), residual (n_group, n_decay, n), rss (n_group, n_decay),
    score (n_group, n_decay, p), information (n_group, n_decay, p, p)
        As in ``Linearisation``, with p = 2 n_mode and k = 2 n_mode + n_column.
    """
    n_group, n_decay, n = decays.shape
    n_mode, n_column = theta.shape[1], len(columns)
    p = 2 * n_mode
    size = p + n_column
    gram, factor = np.empty((n_group, size, size)), np.empty((size, size))
    coefficient, residual = np.empty((n_group, n_decay, size)), np.empty((n_group, n_decay, n))
    rss = np.empty((n_group, n_decay))
    pole, slope = np.empty(n_mode, np.complex128), np.empty(p, np.complex128)
    score, information = np.empty((n_group, n_decay, p)), np.empty((n_group, n_decay, p, p))
    model, ramped = np.empty((size, n)), np.empty(n)
    model[p:] = columns
    sums = np.empty((2, 3, n_mode, n_mode), np.complex128)
    across, square = np.empty((size, p)), np.empty((p, p))
    ramp_columns = np.empty((n, n_column))
    for k in range(n):
        for c in range(n_column):
            ramp_columns[k, c] = k * columns[c, k]
    column_gram = columns @ columns.T
    column_transposed = np.ascontiguousarray(columns.T)
    tilt = np.empty(p, np.complex128)
    for g in range(n_group):
        for m in range(n_mode):
            omega, zeta = 2.0 * np.pi * np.exp(theta[g, m, 0]) / rate, theta[g, m, 1]
            damped = np.sqrt(1.0 - zeta * zeta)
            pole[m] = slope[2 * m] = omega * complex(-zeta, damped)
            slope[2 * m + 1] = omega * complex(-1.0, -zeta / damped)
        fill_waves(pole, model[:p])
        last = np.exp(pole * n)
        z = np.exp(pole)
        for i in range(n_mode):
            for j in range(i + 1):
                for conjugate in range(2):
                    other, other_last = (z[j].conjugate(), last[j].conjugate()) if conjugate else (z[j], last[j])
                    zero, one, two = geometric_sums(z[i] * other, last[i] * other_last, n, power_sums)
                    sums[conjugate, 0, i, j], sums[conjugate, 1, i, j], sums[conjugate, 2, i, j] = zero, one, two
                    if conjugate:
                        zero, one, two = zero.conjugate(), one.conjugate(), two.conjugate()
                    sums[conjugate, 0, j, i], sums[conjugate, 1, j, i], sums[conjugate, 2, j, i] = zero, one, two
        waves = model[:p]
        of_columns = waves @ column_transposed
        of_ramp = waves @ ramp_columns
        for i in range(n_mode):
            for j in range(n_mode):
                plus, minus = sums[0, 0, i, j], sums[1, 0, i, j]
                gram[g, i, j] = 0.5 * (plus.real + minus.real)
                gram[g, n_mode + i, n_mode + j] = 0.5 * (minus.real - plus.real)
                gram[g, i, n_mode + j] = 0.5 * (plus.imag - minus.imag)
                gram[g, n_mode + j, i] = gram[g, i, n_mode + j]
        for c in range(n_column):
            gram[g, p + c, p:] = column_gram[c]
            for i in range(p):
                gram[g, p + c, i] = gram[g, i, p + c] = of_columns[i, c]
        trace = 0.0
        for i in range(size):
            trace += gram[g, i, i]
        for i in range(size):
            gram[g, i, i] += RIDGE * trace
        factor[:] = gram[g]
        factorise(factor, RIDGE * trace)
        for d in range(n_decay):
            value = coefficient[g, d]
            value[:] = model @ decays[g, d]
            for i in range(size):
                total = value[i]
                for k in range(i):
                    total -= factor[i, k] * value[k]
                value[i] = total / factor[i, i]
            for i in range(size - 1, -1, -1):
                total = value[i]
                for k in range(i + 1, size):
                    total -= factor[k, i] * value[k]
                value[i] = total / factor[i, i]
            residual[g, d] = decays[g, d] - value @ model
            square_sum = 0.0
            for k in range(n):
                ramped[k] = k * residual[g, d, k]
                square_sum += residual[g, d, k] * residual[g, d, k]
            rss[g, d] = square_sum
            ramp_sums = waves @ ramped
            for m in range(n_mode):
                amplitude = complex(value[m], -value[n_mode + m])
                for i in range(2):
                    tilt[2 * m + i] = slope[2 * m + i] * amplitude
                    score[g, d, 2 * m + i] = (
                        tilt[2 * m + i].real * ramp_sums[m] - tilt[2 * m + i].imag * ramp_sums[n_mode + m]
                    )
            for i in range(p):
                a, m = tilt[i], i // 2
                for j in range(n_mode):
                    plus, minus = sums[0, 1, m, j], sums[1, 1, m, j]
                    # Re and Im of a times a complex sum, written out
                    across[j, i] = 0.5 * (a.real * (plus.real + minus.real) - a.imag * (plus.imag + minus.imag))
                    across[n_mode + j, i] = 0.5 * (
                        a.real * (plus.imag - minus.imag) + a.imag * (plus.real - minus.real)
                    )
                for c in range(n_column):
                    across[p + c, i] = a.real * of_ramp[m, c] - a.imag * of_ramp[n_mode + m, c]
                for j in range(i + 1):
                    b = tilt[j]
                    both, mixed = a * b, a * b.conjugate()
                    plus, minus = sums[0, 2, m, j // 2], sums[1, 2, m, j // 2]
                    square[i, j] = 0.5 * (both * plus + mixed * minus).real
            for r in range(size):
                for k in range(r):
                    for i in range(p):
                        across[r, i] -= factor[r, k] * across[k, i]
                for i in range(p):
                    across[r, i] /= factor[r, r]
            for i in range(p):
                for j in range(i + 1):
                    total = square[i, j]
                    for r in range(size):
                        total -= across[r, i] * across[r, j]
                    information[g, d, i, j] = information[g, d, j, i] = total
    return gram, coefficient, residual, rss, score, information
