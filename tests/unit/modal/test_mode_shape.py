"""The ratio of two responses of each mode, and its covariance over the impacts."""

import numpy as np
import pytest

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import identify
from turnout.modal.mode_shape import amplitude_ratio, two_point_shapes
from turnout.modal.poles import continuous_pole

RATE, N, N_IMPACT = 20e3, 600, 10
FREQUENCY, DAMPING = np.array([99.0, 616.0]), np.array([0.25, 0.06])
FIRST, SECOND = np.array([1.0, 3.0 + 1.0j]), np.array([1.5 + 0.5j, -0.8j])
SETTINGS = IdentifySettings(null_draws=10)


def responses(rng, noise):
    """Decays (N_IMPACT, N) of both sensors for impacts of different size, white noise."""
    size = 1.0 + 0.3 * rng.random((N_IMPACT, 1))
    wave = np.exp(continuous_pole(FREQUENCY, DAMPING)[:, None] * np.arange(N) / RATE)
    clean = [(a[:, None] * wave).real.sum(axis=0) for a in (FIRST, SECOND)]
    return [list(size * c + noise * rng.standard_normal((N_IMPACT, N))) for c in clean]


def test_the_ratio_is_that_of_the_amplitudes_for_impacts_of_any_size():
    first, second = responses(np.random.default_rng(1), 1e-6)
    shapes = two_point_shapes(identify(first, RATE, SETTINGS), first, second)
    np.testing.assert_allclose([s.ratio for s in shapes], SECOND / FIRST, rtol=1e-4)


def test_the_covariance_is_that_of_repeated_tests():
    """60 tests, two modes: the probability of T² of the error is uniform."""
    distance = []
    for k in range(60):
        first, second = responses(np.random.default_rng([38, k]), 0.02)
        for shape, truth in zip(
            two_point_shapes(identify(first, RATE, SETTINGS), first, second), SECOND / FIRST, strict=True
        ):
            error = np.array([(shape.ratio - truth).real, (shape.ratio - truth).imag])
            distance.append(error @ np.linalg.solve(shape.covariance, error))
    probability = (1.0 + np.array(distance) / (N_IMPACT - 1)) ** (-(N_IMPACT - 2) / 2.0)
    assert np.mean(probability < 0.05) < 0.12
    assert 0.4 < np.mean(probability) < 0.6


def test_the_covariance_of_unequal_parts():
    """Second response with an error in its imaginary part alone: variance s² n / (n - 1) over the sum of squares."""
    error = np.array([1.0, -1.0, 1.0, -1.0])
    first = np.full(4, 2.0 * np.exp(0.9j))  # the phase at the start of the decay does not matter
    shape = amplitude_ratio(first, first * (0.5 + 0.1j * error))
    assert shape.ratio == pytest.approx(0.5)
    np.testing.assert_allclose(shape.covariance, [[0.0, 0.0], [0.0, 0.01 / 3.0]], atol=1e-15)


def test_too_few_impacts_and_other_methods_have_no_shape():
    first, second = responses(np.random.default_rng(2), 0.01)
    model = identify(first, RATE, SETTINGS)
    assert two_point_shapes(model, first[:2], second[:2]) is None
    model.diagnostics.pop("modes_in_fit")
    assert two_point_shapes(model, first, second) is None
