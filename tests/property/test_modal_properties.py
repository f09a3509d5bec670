"""Properties of the identification for any decays: scale, order, sampling rate, exactness without noise."""

import numpy as np
import pytest
from benchmarks.published import LOCATIONS, hammer_test
from hypothesis import given, settings
from hypothesis import strategies as st

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import balanced_pair, discrete_pole, era, identify, modal_parameters, summarise

SETTINGS = IdentifySettings(null_draws=10)
FREQUENCY, DAMPING = st.floats(30.0, 900.0), st.floats(0.005, 0.5)


@given(FREQUENCY, DAMPING, st.floats(1e3, 1e5))
def test_modes_and_poles_are_equivalent(frequency, damping, rate):
    found = modal_parameters(discrete_pole(frequency, damping, 2.5 * frequency + rate), 2.5 * frequency + rate)
    assert found == pytest.approx((frequency, damping), rel=1e-9)


@given(FREQUENCY, DAMPING, st.floats(-3.1, 3.1), st.floats(1e-3, 1e3))
@settings(max_examples=40, deadline=None)
def test_one_mode_without_noise_is_realised_exactly(frequency, damping, phase, size):
    z = discrete_pole(frequency, damping, 5000.0)
    decay = size * (np.exp(1j * phase) * z ** np.arange(120)).real
    found, zeta = era(decay, 2, rate=5000.0).modes()
    # The second singular value can be 1e-3 of the first if the record is only half a period long.
    assert found == pytest.approx([frequency], rel=1e-6)
    assert zeta == pytest.approx([damping], rel=1e-6, abs=1e-7)


@given(FREQUENCY, DAMPING, st.floats(-3.1, 3.1))
@settings(max_examples=60, deadline=None)
def test_a_balanced_pair_has_the_response_and_equal_diagonal_gramians(frequency, damping, phase):
    z = complex(discrete_pole(frequency, damping, 20e3))
    a, b, c = balanced_pair(z, np.exp(1j * phase))
    k = np.arange(6)
    out = [c @ np.linalg.matrix_power(a, i) @ b for i in k]
    np.testing.assert_allclose(out, (np.exp(1j * phase) * z**k).real, atol=1e-7)
    assert a[0, 1] == pytest.approx(-a[1, 0], abs=1e-9)
    assert a[0, 1] <= 1e-9
    assert c[1] >= 0.0
    np.testing.assert_allclose(b, c * [1.0, -1.0])


@given(st.sampled_from(LOCATIONS), st.integers(0, 10**6), st.sampled_from([1e-6, 3.7, 1e5]))
@settings(max_examples=6, deadline=None)
def test_the_unit_of_the_decays_does_not_matter(location, seed, factor):
    test = hammer_test(location, 4, seed)
    plain = identify(test.decays(), test.rate, SETTINGS)
    scaled = identify([factor * y for y in test.decays()], test.rate, SETTINGS)
    assert [m.band for m in plain.modes] == [m.band for m in scaled.modes]
    for one, other in zip(plain.modes, scaled.modes, strict=True):
        assert one.frequency == pytest.approx(other.frequency, rel=1e-6)
        assert one.damping_se == pytest.approx(other.damping_se, rel=1e-3)


@given(st.lists(st.tuples(st.floats(-5, 5), st.floats(0.01, 3.0)), min_size=2, max_size=12), st.floats(-100, 100))
@settings(max_examples=60, deadline=None)
def test_a_summary_moves_with_its_values_and_keeps_its_width(pairs, offset):
    value, error = np.array(pairs).T
    first, moved = summarise(value, error), summarise(value + offset, error)
    assert moved.mean == pytest.approx(first.mean + offset, abs=1e-8)
    assert moved.high - moved.low == pytest.approx(first.high - first.low, abs=1e-7)
    assert value.min() - 1e-9 <= first.mean <= value.max() + 1e-9
