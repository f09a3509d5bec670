"""Responses at a complex frequency are those of the Laplace transform, by plain linear algebra."""

import numpy as np
import pytest

from turnout.simulate.frequency_response import responses
from turnout.simulate.matrices import assemble
from turnout.simulate.track import uniform_track

SHIFT = 35.0  # 1/s


def dense(upper):
    """(n, n) of the upper diagonals of a symmetric matrix."""
    half = np.diag(upper[0])
    for k in range(1, upper.shape[0]):
        half = half + np.diag(upper[k, : upper.shape[1] - k], k) + np.diag(upper[k, : upper.shape[1] - k], -k)
    return half


@pytest.mark.parametrize("pivoted", [False, True])
def test_a_complex_frequency_is_solved_as_the_laplace_transform(pivoted):
    """(s² M + s C + K)^-1 at s = σ + iω, dense."""
    matrices = assemble(uniform_track(6.0))
    frequency = np.array([40.0, 171.0, 600.0]) - 1j * SHIFT / (2.0 * np.pi)
    place = matrices.node[7]
    rows, weights = matrices.weights(float(place))
    found = responses(matrices, frequency, [float(place)], pivoted=pivoted)[:, 0]
    for line, u in zip(frequency, found):
        s = 2j * np.pi * line
        assert s.real == pytest.approx(SHIFT)
        right = np.zeros(matrices.n)
        right[rows] += weights
        system = s**2 * dense(matrices.mass) + s * dense(matrices.damping) + dense(matrices.stiffness)
        expected = np.linalg.solve(system + 1j * dense(matrices.hysteresis), right)
        assert np.max(np.abs(u - expected)) < 1e-9 * np.max(np.abs(expected))


@pytest.mark.parametrize("count", [1, 3, 8, 9, 17])
def test_many_forces_are_solved_as_one_by_one_with_pivoting(count):
    """Groups of eight, a full one and a rest: LAPACK with pivoting solves each alone."""
    matrices = assemble(uniform_track(9.0))
    frequency, places = np.array([0.0, 60.0, 420.0]), [*np.linspace(2.1, 6.9, count)]
    rows = np.array([0, 11, matrices.n - 1])
    together = responses(matrices, frequency, places, rows)
    expected = responses(matrices, frequency, places, rows, pivoted=True)
    assert together.shape == (3, count, 3)
    assert np.max(np.abs(together - expected)) < 1e-10 * np.max(np.abs(expected))
