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
def fill_powers(pole: np.ndarray, fine: np.ndarray, fine_transposed: np.ndarray, block: np.ndarray) -> None:
    r"""Fill in two short tables of powers, whose products are the waves: :math:`z^{wb+j} = z^{wb} z^j`.

    Parameters
    ----------
    pole : (n_mode,) array of complex
        Logarithms of the factor z per sample.
    fine : (2 n_mode, WIDTH) array of float
        Filled with real parts of z^j, then imaginary parts.
    fine_transposed : (WIDTH, 2 n_mode) array of float
        Filled with the same.
    block : (n_block, n_mode) array of complex
        Filled with the powers at the first sample of each block.
    """
    n_mode = len(pole)
    for m in range(n_mode):
        z, power = np.exp(pole[m]), 1.0 + 0j
        for j in range(WIDTH):
            fine[m, j] = fine_transposed[j, m] = power.real
            fine[n_mode + m, j] = fine_transposed[j, n_mode + m] = power.imag
            power = power * z
        first = 1.0 + 0j
        for b in range(len(block)):
            block[b, m] = first
            first = first * power


@kernel
def sum_blocks(of_block: np.ndarray, block: np.ndarray, total: np.ndarray) -> None:
    """Products of the waves with a record, from those of the powers within blocks.

    Parameters
    ----------
    of_block : (n_block, 2 n_mode) array of float
        Products of each block of the record with real and imaginary parts of z^j.
    block : (n_block, n_mode) array of complex
        Powers at the first sample of each block.
    total : (2 n_mode,) array of float
        Filled with the products of the whole record with real and imaginary parts of the waves.
    """
    n_block, n_mode = block.shape
    total[:] = 0.0
    for b in range(n_block):
        for m in range(n_mode):
            real, imag = of_block[b, m], of_block[b, n_mode + m]
            total[m] += block[b, m].real * real - block[b, m].imag * imag
            total[n_mode + m] += block[b, m].real * imag + block[b, m].imag * real


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
def solve_factorised(factor: np.ndarray, value: np.ndarray) -> None:
    """Replace a right-hand side by the solution of the equations of a factorised matrix.

    Parameters
    ----------
    factor : (n, n) array of float
        Cholesky factor in the lower triangle.
    value : (n,) array of float
        Right-hand side.
    """
    size = len(factor)
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


@kernel
def project_out(factor: np.ndarray, across: np.ndarray, square: np.ndarray) -> None:
    """Gram matrix of what the columns of a model explain of further columns.

    Parameters
    ----------
    factor : (size, size) array of float
        Cholesky factor of the Gram matrix of the model, in the lower triangle.
    across : (size, p) array of float
        Products of the columns of the model with the further columns; overwritten.
    square : (p, p) array of float
        Filled in.
    """
    size, p = across.shape
    for r in range(size):
        for k in range(r):
            for i in range(p):
                across[r, i] -= factor[r, k] * across[k, i]
        inverse = 1.0 / factor[r, r]
        for i in range(p):
            across[r, i] *= inverse
    square[:] = 0.0
    for r in range(size):
        for i in range(p):
            for j in range(p):
                square[i, j] += across[r, i] * across[r, j]


@kernel
def wave_sums(pole: np.ndarray, n: int, power_sums: np.ndarray, sums: np.ndarray) -> None:
    """Sums of the products of all pairs of waves, times k to the power 0, 1 and 2.

    Parameters
    ----------
    pole : (n_mode,) array of complex
        Logarithms of the factor per sample.
    n : int
        Number of samples.
    power_sums : (3, n_term) array of float
        Sums over k of (k / n) to the power p + j.
    sums : (2, 3, n_mode, n_mode) array of complex
        Filled in: of two waves, then of a wave and the conjugate of the other.
    """
    n_mode = len(pole)
    last, z = np.exp(pole * n), np.exp(pole)
    for i in range(n_mode):
        for j in range(i + 1):
            for conjugate in range(2):
                other, other_last = (z[j].conjugate(), last[j].conjugate()) if conjugate else (z[j], last[j])
                zero, one, two = geometric_sums(z[i] * other, last[i] * other_last, n, power_sums)
                sums[conjugate, 0, i, j], sums[conjugate, 1, i, j], sums[conjugate, 2, i, j] = zero, one, two
                if conjugate:
                    zero, one, two = zero.conjugate(), one.conjugate(), two.conjugate()
                sums[conjugate, 0, j, i], sums[conjugate, 1, j, i], sums[conjugate, 2, j, i] = zero, one, two


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
    n_block = -(-n // WIDTH)
    gram, factor = np.empty((n_group, size, size)), np.empty((size, size))
    coefficient, residual = np.empty((n_group, n_decay, size)), np.empty((n_group, n_decay, n))
    rss = np.empty((n_group, n_decay))
    score, information = np.empty((n_group, n_decay, p)), np.empty((n_group, n_decay, p, p))
    pole, slope = np.empty(n_mode, np.complex128), np.empty(p, np.complex128)
    tilt = np.empty(p, np.complex128)
    sums = np.empty((2, 3, n_mode, n_mode), np.complex128)
    across, square = np.empty((size, p)), np.empty((p, p))
    fine, fine_transposed = np.empty((p, WIDTH)), np.empty((WIDTH, p))
    block = np.empty((n_block, n_mode), np.complex128)
    # Records as blocks of WIDTH samples, filled up with zeros: products with waves are small products of matrices.
    column_blocks = np.zeros((2 * n_column, n_block * WIDTH))
    for c in range(n_column):
        for k in range(n):
            column_blocks[c, k] = columns[c, k]
            column_blocks[n_column + c, k] = k * columns[c, k]
    column_gram = columns @ columns.T
    of_columns, of_block = np.empty((2 * n_column, p)), np.empty((n_block, p))
    of_column_blocks = np.empty((2 * n_column * n_block, p))
    record, model = np.zeros(n_block * WIDTH), np.empty((n_block, WIDTH))
    weight, ramp_sums = np.empty((n_block, p)), np.empty(p)
    for g in range(n_group):
        for m in range(n_mode):
            omega, zeta = 2.0 * np.pi * np.exp(theta[g, m, 0]) / rate, theta[g, m, 1]
            damped = np.sqrt(1.0 - zeta * zeta)
            pole[m] = slope[2 * m] = omega * complex(-zeta, damped)
            slope[2 * m + 1] = omega * complex(-1.0, -zeta / damped)
        fill_powers(pole, fine, fine_transposed, block)
        wave_sums(pole, n, power_sums, sums)
        if n_column:
            np.dot(column_blocks.reshape(2 * n_column * n_block, WIDTH), fine_transposed, of_column_blocks)
            for c in range(2 * n_column):
                sum_blocks(of_column_blocks[c * n_block : (c + 1) * n_block], block, of_columns[c])
        for i in range(n_mode):
            for j in range(n_mode):
                plus, minus = sums[0, 0, i, j], sums[1, 0, i, j]
                gram[g, i, j] = 0.5 * (plus.real + minus.real)
                gram[g, n_mode + i, n_mode + j] = 0.5 * (minus.real - plus.real)
                gram[g, i, n_mode + j] = 0.5 * (plus.imag - minus.imag)
                gram[g, n_mode + j, i] = gram[g, i, n_mode + j]
                # products of the columns of the model with the waves times k, real parts, then imaginary parts
                plus, minus = sums[0, 1, i, j], sums[1, 1, i, j]
                across[j, i] = 0.5 * (plus.real + minus.real)
                across[j, n_mode + i] = 0.5 * (plus.imag + minus.imag)
                across[n_mode + j, i] = 0.5 * (plus.imag - minus.imag)
                across[n_mode + j, n_mode + i] = 0.5 * (minus.real - plus.real)
        for c in range(n_column):
            gram[g, p + c, p:] = column_gram[c]
            for i in range(p):
                gram[g, p + c, i] = gram[g, i, p + c] = of_columns[c, i]
                across[p + c, i] = of_columns[n_column + c, i]
        trace = 0.0
        for i in range(size):
            trace += gram[g, i, i]
        for i in range(size):
            gram[g, i, i] += RIDGE * trace
        factor[:] = gram[g]
        factorise(factor, RIDGE * trace)
        project_out(factor, across, square)
        for d in range(n_decay):
            value = coefficient[g, d]
            record[:n] = decays[g, d]
            np.dot(record.reshape(n_block, WIDTH), fine_transposed, of_block)
            sum_blocks(of_block, block, value[:p])
            for c in range(n_column):
                total = 0.0
                for k in range(n):
                    total += columns[c, k] * record[k]
                value[p + c] = total
            solve_factorised(factor, value)
            for b in range(n_block):
                for m in range(n_mode):
                    turned = complex(value[m], -value[n_mode + m]) * block[b, m]
                    weight[b, m], weight[b, n_mode + m] = turned.real, -turned.imag
            np.dot(weight, fine, model)
            fitted = model.reshape(n_block * WIDTH)
            for c in range(n_column):
                for k in range(n):
                    fitted[k] += value[p + c] * columns[c, k]
            square_sum = 0.0
            for k in range(n):
                rest = record[k] - fitted[k]
                residual[g, d, k] = rest
                square_sum += rest * rest
                record[k] = k * rest
            rss[g, d] = square_sum
            np.dot(record.reshape(n_block, WIDTH), fine_transposed, of_block)
            sum_blocks(of_block, block, ramp_sums)
            for i in range(p):
                tilt[i] = slope[i] * complex(value[i // 2], -value[n_mode + i // 2])
                score[g, d, i] = tilt[i].real * ramp_sums[i // 2] - tilt[i].imag * ramp_sums[n_mode + i // 2]
            for i in range(p):
                m, a = i // 2, tilt[i]
                for j in range(i + 1):
                    other, b = j // 2, tilt[j]
                    plus, minus = sums[0, 2, m, other], sums[1, 2, m, other]
                    total = 0.5 * (a * b * plus + a * b.conjugate() * minus).real
                    total -= a.real * b.real * square[m, other]
                    total += a.real * b.imag * square[m, n_mode + other]
                    total += a.imag * b.real * square[n_mode + m, other]
                    total -= a.imag * b.imag * square[n_mode + m, n_mode + other]
                    information[g, d, i, j] = information[g, d, j, i] = total
    return gram, coefficient, residual, rss, score, information
