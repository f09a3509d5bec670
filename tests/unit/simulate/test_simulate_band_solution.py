"""Products and solutions of banded systems of a track without and with a blade, against dense matrices."""

import numpy as np
import pytest

from turnout.simulate.band_matrix import all_diagonals, inverse_windows, momentum_minus_force
from turnout.simulate.band_solution import solve6_from_both_ends, solve_from_both_ends
from turnout.simulate.preparation import _factors, _two_sided_factors


def band(half, n, seed, scale):
    """Upper diagonals of a symmetric matrix whose main diagonal exceeds the sum of the others."""
    rng = np.random.default_rng(seed)
    upper = scale * rng.normal(size=(half + 1, n))
    upper[0] = scale * (6.0 + 2.0 * half + rng.uniform(size=n))
    for k in range(half + 1):
        upper[k, n - k :] = 0.0
    return upper


def dense(upper):
    n = upper.shape[1]
    matrix = np.diag(upper[0])
    for k in range(1, upper.shape[0]):
        matrix = matrix + np.diag(upper[k, : n - k], k) + np.diag(upper[k, : n - k], -k)
    return matrix


@pytest.mark.parametrize(("half", "n"), [(4, 31), (4, 40), (5, 40), (6, 41), (6, 60)])
def test_the_solution_from_both_ends_is_that_of_the_dense_system(half, n):
    """With and without a row in the middle that is eliminated from one end alone."""
    system = np.ascontiguousarray(band(half, n, 1, 1.0) + 1j * band(half, n, 2, 0.3))
    lower, upper, pivot = _factors(system)
    reach, pad = n - 1, 7
    window = inverse_windows(lower, upper, pivot, reach)
    *back, middle = _two_sided_factors(system, window, reach)
    assert middle.shape == ((4, 4) if half == 4 else (6, 6))
    right = np.random.default_rng(3).normal(size=(2, n)) @ np.diag(np.arange(1.0, n + 1.0))
    x = np.full(n + 2 * pad, 1e9 + 0j)
    x[pad : pad + n] = right[0] + 1j * right[1]
    solution = solve_from_both_ends if half == 4 else solve6_from_both_ends
    solution(lower, upper, pivot, *back, middle, x, pad, n)
    assert x[pad : pad + n] == pytest.approx(np.linalg.solve(dense(system), right[0] + 1j * right[1]), rel=1e-11)
    assert np.all(x[:pad] == 1e9) and np.all(x[pad + n :] == 1e9)


@pytest.mark.parametrize("half", [4, 6])
def test_momentum_less_force_agrees_with_dense_matrices(half):
    n, pad, rng = 37, 9, np.random.default_rng(5)
    mass, stiffness = band(half, n, 6, 2.0), band(half, n, 7, 50.0)
    v, u = rng.normal(size=(2, n))
    padded = [np.concatenate([np.zeros(pad), values, np.zeros(pad)]) for values in (v, u)]
    out, by_v, by_u = np.zeros(n + 2 * pad, dtype=complex), 3.0 - 1.0j, 0.5 + 2.0j
    diagonals = all_diagonals(mass, half), all_diagonals(stiffness, half)
    momentum_minus_force(*diagonals, *padded, by_v, by_u, pad, out, n)
    assert out[pad : pad + n] == pytest.approx(by_v * (dense(mass) @ v) - by_u * (dense(stiffness) @ u), rel=1e-12)
