"""Compiled functions of the port system: force laws, paths, the rail under a port, windows of the inverse."""

import numpy as np

from turnout.kernel_cache import inline_kernel, inner_kernel
from turnout.simulate.force_laws import FRICTION, GAP, LIFT, LINEAR, POWER


@inline_kernel
def law_force(
    law_code: int, numbers: np.ndarray, i: int, table: np.ndarray, first: int, last: int, d: float, rate: float
) -> tuple[float, float, float]:
    """Force of a law with its numbers in row ``i``, and its derivatives by deformation and by rate.

    Parameters
    ----------
    law_code : int
        One of the codes of ``turnout.simulate.force_laws``.
    numbers : (n_port, 3) array of float
        Numbers of the laws.
    i : int
        Row of the port.
    table : (3, n_table) array of float
        Deformation [m], elastic force [N] and viscous factor [N s/m] of all table laws.
    first : int
        First column of the port in ``table``.
    last : int
        Column after its last one.
    d : float
        Deformation, pressing positive. [m]
    rate : float
        Rate of deformation. [m/s]

    Returns
    -------
    (float, float, float)
        Force [N], its derivative by deformation [N/m] and by rate [N s/m].
    """
    if law_code == POWER:
        if d <= 0.0:
            return 0.0, 0.0, 0.0
        k, p, chi = numbers[i, 0], numbers[i, 1], numbers[i, 2]
        power = np.sqrt(d) if p == 1.5 else d ** (p - 1.0)
        factor = 1.0 + chi * rate
        if factor <= 0.0:
            return 0.0, 0.0, 0.0
        return k * power * d * factor, p * k * power * factor, k * power * d * chi
    if law_code == GAP:
        if d <= 0.0:
            return 0.0, 0.0, 0.0
        k, c, onset = numbers[i, 0], numbers[i, 1], numbers[i, 2]
        share = min(1.0, d / onset)
        force = k * d + c * rate * share
        if force <= 0.0:
            return 0.0, 0.0, 0.0
        return force, k + (c * rate / onset if d < onset else 0.0), c * share
    if law_code == LINEAR:
        return numbers[i, 2] + numbers[i, 0] * d + numbers[i, 1] * rate, numbers[i, 0], numbers[i, 1]
    if law_code == FRICTION:
        value = np.tanh(rate / numbers[i, 1])
        return numbers[i, 0] * value, 0.0, numbers[i, 0] * (1.0 - value * value) / numbers[i, 1]
    if law_code == LIFT:
        pull = -(numbers[i, 2] + numbers[i, 0] * d + numbers[i, 1] * rate)
        return (pull, -numbers[i, 0], -numbers[i, 1]) if pull > 0.0 else (0.0, 0.0, 0.0)
    k = first
    while k < last - 2 and table[0, k + 1] <= d:
        k += 1
    width = table[0, k + 1] - table[0, k]
    slope = (table[1, k + 1] - table[1, k]) / width
    fraction = (d - table[0, k]) / width
    bend = (table[2, k + 1] - table[2, k]) / width if 0.0 < fraction < 1.0 else 0.0
    viscous = table[2, k] + (table[2, k + 1] - table[2, k]) * min(1.0, max(0.0, fraction))
    return table[1, k] + slope * (d - table[0, k]) + viscous * rate, slope + bend * rate, viscous


@inner_kernel
def path_at(path: np.ndarray, path_index: int, start: float, step: float, x: float) -> float:
    """Dip of path ``path_index`` at ``x``; constant beyond the ends of its grid.

    Parameters
    ----------
    path : (n_path, n_piece, 4) array of float
        Cubic coefficients, the highest power first.
    path_index : int
        Number of the path.
    start : float
        Position of the first piece. [m]
    step : float
        Length of a piece. [m]
    x : float
        Position of the wheel. [m]

    Returns
    -------
    float
        Dip, down positive. [m]
    """
    grid_position = (x - start) / step
    k = min(max(int(np.floor(grid_position)), 0), path.shape[1] - 1)
    r = min(max(grid_position - k, 0.0), 1.0)
    return ((path[path_index, k, 0] * r + path[path_index, k, 1]) * r + path[path_index, k, 2]) * r + path[
        path_index, k, 3
    ]


@inline_kernel
def ramp_at(ramp: np.ndarray, stand_in: bool, x: float) -> tuple[float, float]:
    """Share (r, q) of the modelled track and of the stand-in, r² + q² = 1.

    Parameters
    ----------
    ramp : (4,) array of float
        Positions where the share of the modelled track starts to rise, is 1, starts to fall and is 0. [m]
    stand_in : bool
        Whether there are stand-in tracks; without them the shares are 1 and 0.
    x : float
        Position of the wheel. [m]

    Returns
    -------
    (float, float)
        Share of the modelled track and of the stand-in, each 0 to 1.
    """
    if not stand_in:
        return 1.0, 0.0
    entry_ramp = (x - ramp[0]) / (ramp[1] - ramp[0])
    exit_ramp = (ramp[3] - x) / (ramp[3] - ramp[2])
    ramp_share = min(entry_ramp, exit_ramp)
    if ramp_share >= 1.0:
        return 1.0, 0.0
    if ramp_share <= 0.0:
        return 0.0, 1.0
    angle = 0.5 * np.pi * ramp_share * ramp_share * ramp_share * (10.0 + ramp_share * (6.0 * ramp_share - 15.0))
    return np.sin(angle), np.cos(angle)


@inner_kernel
def rail_weights(
    node: np.ndarray,
    first_row: np.ndarray,
    last_row: np.ndarray,
    shear_ratio: np.ndarray,
    flexible: np.ndarray,
    shear_flexible: np.ndarray,
    line: int,
    e: int,
    x: float,
    share: float,
    k: int,
    rows: np.ndarray,
    weights: np.ndarray,
) -> float:
    """Fill row ``k`` of rows and weights of the rail at ``x`` in element ``e``; returns its local compliance.

    Parameters
    ----------
    node : (n_node,) array of float
        Positions of the nodes. [m]
    first_row, last_row : (2, n_element) array of int
        Row of the deflection of both nodes of each element; its rotation is the next row.
    shear_ratio : (2, n_element) array of float
        Shear ratio P of each element. [-]
    flexible : (2, n_element) array of float
        1 / EI. [1/(N m²)]
    shear_flexible : (2, n_element) array of float
        1 / κGA, 0 for an Euler-Bernoulli beam. [1/N]
    line : int
        0: the rail; 1: the line that changes to the blade.
    e : int
        Element that holds ``x``.
    x : float
        Position. [m]
    share : float
        Share of the modelled track, which multiplies the weights.
    k : int
        Row to fill.
    rows : (n, 4) array of int
        Its row ``k`` is overwritten.
    weights : (n, 4) array of float
        Its row ``k`` is overwritten.

    Returns
    -------
    float
        Local compliance for the share of the force. [m/N]
    """
    h = node[e + 1] - node[e]
    s, p = (x - node[e]) / h, shear_ratio[line, e]
    f = share / (1.0 + p)
    q = s * (1.0 - s)
    first, last = first_row[line, e], last_row[line, e]
    rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 3] = first, first + 1, last, last + 1
    weights[k, 0] = f * (1.0 - 3.0 * s * s + 2.0 * s * s * s + p * (1.0 - s))
    weights[k, 1] = f * h * (s - 2.0 * s * s + s * s * s + 0.5 * p * q)
    weights[k, 2] = f * (3.0 * s * s - 2.0 * s * s * s + p * s)
    weights[k, 3] = f * h * (-s * s + s * s * s - 0.5 * p * q)
    bend = q * q * (q / 3.0 + p * (1.0 - 2.0 * s) ** 2 / (12.0 * (1.0 + p)))
    return share * share * (q * h * shear_flexible[line, e] + h * h * h * flexible[line, e] * bend)


@inner_kernel
def window_product(window: np.ndarray, pad: int, rows: np.ndarray, weights: np.ndarray, a: int, b: int) -> complex:
    """b_a^T Z^-1 b_b for two port stages.

    Parameters
    ----------
    window : (n, 2 pad + 1) array
        Windows of the inverse.
    pad : int
        Half width of the windows.
    rows : (n_stage, 4) array of int
        Rows of the rail under each port stage.
    weights : (n_stage, 4) array of float
        Weights of these rows.
    a : int
        First port stage.
    b : int
        Second port stage.

    Returns
    -------
    complex
        Displacement at stage a per force at stage b; real for the midpoint rule. [m/N]
    """
    total = window[0, 0] * 0.0
    for i in range(4):
        weight, row = weights[a, i], rows[a, i]
        base = pad - row
        for j in range(4):
            k = base + rows[b, j]
            if 0 <= k <= 2 * pad:  # else too far apart to matter; unused entries have weight 0
                total += weight * weights[b, j] * window[row, k]
    return total


@inner_kernel
def solve_dense(a: np.ndarray, b: np.ndarray, n: int) -> None:
    """Solve in place by elimination with partial pivoting; the matrices have at most a few dozen rows.

    Parameters
    ----------
    a : (n_row, n_row) array of float
        Its upper left ``n`` rows and columns are the matrix; overwritten.
    b : (n_row,) array of float
        Right-hand side; overwritten with the solution.
    n : int
        Number of equations.
    """
    for i in range(n):
        pivot_row = i
        for k in range(i + 1, n):
            if abs(a[k, i]) > abs(a[pivot_row, i]):
                pivot_row = k
        if pivot_row != i:
            for j in range(n):
                a[i, j], a[pivot_row, j] = a[pivot_row, j], a[i, j]
            b[i], b[pivot_row] = b[pivot_row], b[i]
        inverse = 1.0 / a[i, i]
        for k in range(i + 1, n):
            f = a[k, i] * inverse
            if f != 0.0:
                for j in range(i + 1, n):
                    a[k, j] -= f * a[i, j]
                b[k] -= f * b[i]
    for i in range(n - 1, -1, -1):
        s = b[i]
        for j in range(i + 1, n):
            s -= a[i, j] * b[j]
        b[i] = s / a[i, i]
