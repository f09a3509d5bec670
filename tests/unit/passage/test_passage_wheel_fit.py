"""Joint fit of all wheels, impact times and the test of the jump, against the true values."""

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, RATE, impact_record, paper_model
from scipy import stats

from turnout.passage.channel_fit import fit_channel
from turnout.passage.impact_timing import impact_times, search_times
from turnout.passage.impulse_fit import joint_fit, onsets, predict, whitener
from turnout.passage.model_tests import direction_test
from turnout.passage.wheel_basis import apply_filter, band_pass, wheel_basis
from turnout.records import ModalModel


def test_an_impact_between_samples_is_the_continuous_decay():
    """y(t) = c exp(S (t - t0)) b at the samples after t0, S the matrix logarithm of A at the sampling rate."""
    from scipy.linalg import expm, logm

    model = paper_model("CP A7")
    continuous = logm(model.a) * model.rate
    basis = wheel_basis(model, None, RATE)
    late = 0.3 / RATE
    expected = [model.c @ expm(continuous * (late + k / RATE)) @ model.b for k in (0, 7, 100)]
    assert np.allclose(basis.response(0.3)[[0, 7, 100]], np.real(expected), atol=0.0, rtol=1e-9)


def test_a_model_of_another_rate_keeps_its_poles():
    model = paper_model("OT")
    half = wheel_basis(model, None, RATE / 2).response(0.0)
    assert np.allclose(wheel_basis(model, None, RATE).response(0.0)[: 2 * 200 : 2], half[:200], atol=1e-12)


def test_an_unstable_model_is_rejected_with_its_eigenvalue():
    with pytest.raises(ValueError, match=r"unstable: \|eigenvalue\| 1\.2"):
        wheel_basis(ModalModel(np.diag([1.2]), np.ones(1), np.ones(1), RATE, ()), None, RATE)


@pytest.mark.parametrize("free", [False, True])
def test_joint_fit_equals_dense_least_squares(free):
    """Wheels 3 ms apart: every response overlaps its neighbours. Compared with lstsq on the written-out design."""
    rng = np.random.default_rng(3)
    through = band_pass(80, 800, 4, RATE)
    basis = wheel_basis(paper_model("SP"), through, RATE)
    times = np.array([100.4, 160.7, 231.2, 800.0])
    data = rng.standard_normal(900 + basis.n_sample)
    first, phi = onsets(times)
    weights = np.eye(4)[None].repeat(4, 0) if free else basis.coefficients(phi)[:, None, :]
    design = np.column_stack([predict(len(data), [n], w[None], basis) for n, rows in zip(first, weights) for w in rows])
    expected = np.linalg.lstsq(design, data, rcond=None)[0]
    fit = joint_fit(data, times, basis, free)
    assert np.allclose(fit.amplitudes.ravel(), expected, rtol=1e-6, atol=1e-9)
    assert np.allclose(fit.covariance, np.linalg.inv(design.T @ design), rtol=1e-5, atol=1e-12)


def test_free_jumps_equal_the_recursion_wheel_by_wheel():
    """On noise-free data the jump is the state after the wheel minus the state before, x+ = A^k x + w."""
    rng = np.random.default_rng(4)
    model = paper_model("CP A9")
    jumps, state, rows, n = [], np.zeros(4), [], 400
    for _ in range(3):
        jumps.append(rng.standard_normal(4))
        state = state + jumps[-1]
        for _ in range(n):
            rows.append(model.c @ state)
            state = model.a @ state
    # long enough that the cut at 1e-12 of the response does not matter
    basis = wheel_basis(model, None, RATE, tolerance=1e-12, longest=1.0)
    data = np.concatenate([rows, np.zeros(0)])
    fit = joint_fit(data, [0, n, 2 * n], basis, free=True)
    expected = [basis.coefficients(0.0, w) for w in jumps]
    assert np.allclose(fit.amplitudes, expected, rtol=1e-7, atol=1e-7)


def test_covariance_of_the_amplitudes_is_that_of_repeated_data():
    """Standard deviation of 300 estimates over the reported one: 1 within 4 standard errors (4 / sqrt(600) = .16)."""
    rng = np.random.default_rng(5)
    basis = wheel_basis(paper_model("CLP"), None, RATE)
    times = np.array([50.3, 900.9, 1400.2])
    first, phi = onsets(times)
    clean = predict(4000, first, np.array([[1.0], [2.0], [0.5]]) * basis.coefficients(phi), basis)
    found, errors = [], None
    for _ in range(300):
        fit = joint_fit(clean + 0.05 * rng.standard_normal(4000), times, basis)
        found.append(fit.amplitudes[:, 0])
        errors = fit.standard_errors(0.05)[:, 0]
    assert np.std(found, axis=0) / errors == pytest.approx(1.0, abs=0.16)
    assert np.mean(found, axis=0) == pytest.approx([1.0, 2.0, 0.5], abs=4 * errors.max() / np.sqrt(300))


def cramer_rao(passage, basis):
    """(n_wheel,) bound of the impact times with free amplitudes. [samples]"""
    _, phi = onsets(passage.times)
    bound = []
    for amplitude, p in zip(passage.amplitudes, phi):
        rows = np.stack([basis.coefficients(p) @ basis.columns, amplitude * (basis.slopes(p) @ basis.columns)])
        bound.append(passage.noise * np.sqrt(np.linalg.inv(rows @ rows.T)[1, 1]))
    return np.array(bound)


@pytest.mark.parametrize("snr_db, limit", [(40.0, 1.5), (26.0, 1.5)])
def test_impact_times_reach_the_bound_and_their_stated_errors_are_right(snr_db, limit):
    """40 passages, 320 wheels: rms over the bound is known to 4 %; the stated errors are the actual ones to 15 %."""
    rng = np.random.default_rng(6)
    basis = wheel_basis(paper_model("CP A7"), None, RATE)
    off, bound, reported, flagged = [], [], [], []
    for _ in range(40):
        passage = impact_record(rng, snr_db=snr_db)
        expected = passage.times + rng.normal(0.0, 10.0, passage.times.size)
        found = impact_times(passage.samples, expected, basis, 60.0, passage.noise, 20.0)
        off += list(found.times - passage.times)
        bound += list(cramer_rao(passage, basis))
        reported += list(found.standard_errors)
        flagged += list(found.ambiguous)
    off, flagged, reported = np.array(off), np.array(flagged), np.array(reported)
    assert np.sqrt(np.mean(off[~flagged] ** 2)) <= limit * np.sqrt(np.mean(np.square(bound)))
    assert np.std(off[~flagged] / reported[~flagged]) == pytest.approx(1.0, abs=0.15)


def test_a_wrong_interval_is_flagged():
    """At 6 dB many times land in a wrong interval: of those not flagged at odds of 100, at most 2 % may be wrong."""
    rng = np.random.default_rng(7)
    basis = wheel_basis(paper_model("CP A7"), None, RATE)
    silent = wrong = total = 0
    for _ in range(60):
        passage = impact_record(rng, snr_db=6.0)
        expected = passage.times + rng.normal(0.0, 10.0, passage.times.size)
        found = impact_times(passage.samples, expected, basis, 60.0, passage.noise, 10.0)
        missed = np.ceil(found.times) != np.ceil(passage.times)
        wrong += missed.sum()
        silent += (missed & ~found.ambiguous).sum()
        total += (~found.ambiguous).sum()
    assert wrong >= 20, "the test must contain wrong intervals"
    assert silent <= max(0.02 * total, 3)


def test_responses_of_overlapping_wheels_are_separated():
    """A three-axle bogie at 250 km/h: responses of SP (27 ms) overlap; times within 5 us without noise."""
    rng = np.random.default_rng(8)
    passage = impact_record(rng, "SP", [0.0, 1.5, 3.0], 69.4, snr_db=120.0)
    basis = wheel_basis(paper_model("SP"), None, RATE)
    found = search_times(passage.samples, passage.times + 3.0, basis, 40.0, basis.n_sample, 8)
    assert np.abs(found - passage.times).max() < 0.1


def test_the_test_of_the_jump_has_its_level_and_detects_another_direction():
    """800 wheels along b at the true times: share below 0.01 within the binomial range; a second jump is found."""
    rng = np.random.default_rng(9)
    basis = wheel_basis(paper_model("CP A7"), None, RATE)
    p_values, other = [], []
    model = paper_model("CP A7")
    for k in range(100):
        passage = impact_record(rng)
        p_values += list(direction_test(passage.samples, passage.times, basis, passage.noise).p_value)
        if k < 5:
            first, phi = onsets(passage.times)
            aside = basis.coefficients(phi, np.array([0.3, 0.0, 0.0, 0.0]) * np.abs(model.b).max())
            beside_b = passage.samples + predict(passage.samples.size, first, aside, basis)
            other.append(direction_test(beside_b, passage.times, basis, passage.noise).failed_share)
    share = np.mean(np.array(p_values) < 0.01)
    low, high = stats.binom.ppf([0.001, 0.999], 800, 0.01) / 800
    assert low <= share <= high
    assert stats.kstest(p_values, "uniform").pvalue > 1e-3
    assert np.mean(other) > 0.9


def test_the_test_of_the_jump_keeps_its_level_where_times_and_noise_are_estimated(settings):
    """400 wheels along b at 26 dB. An estimated time takes a degree of freedom: without it 2 % are below 0.05."""
    rng = np.random.default_rng(10)
    p_values = []
    for k in range(50):
        location = ("OT", "SP", "CLP", "CP A7", "AS main")[k % 5]
        passage = impact_record(rng, location, snr_db=26.0, start=1.2, tail=1.2)
        model = paper_model(location)
        fit = fit_channel(passage.samples, RATE, passage.times / RATE, 44.4, model, settings, with_null=False)
        p_values += list(fit.test.p_value)
    assert stats.kstest(p_values, "uniform").pvalue > 1e-3
    low, high = stats.binom.ppf([0.001, 0.999], 400, 0.05) / 400
    assert low <= np.mean(np.array(p_values) < 0.05) <= high


def test_whitened_noise_is_white_and_the_basis_passes_the_same_filter():
    rng = np.random.default_rng(10)
    coloured = apply_filter(rng.standard_normal(60000), np.array([1.0, 0.8, 0.3]))
    taps, noise = whitener(coloured)
    white = apply_filter(coloured, taps)[100:]
    lags = [np.mean(white[k:] * white[:-k]) / np.var(white) for k in range(1, 6)]
    assert np.abs(lags).max() < 4 / np.sqrt(60000)
    assert noise == pytest.approx(1.0, rel=0.02)
    model = paper_model("OT")
    plain = wheel_basis(model, None, RATE).response(0.4)
    assert np.allclose(apply_filter(plain, taps), wheel_basis(model, taps, RATE).response(0.4)[: plain.size], atol=1e-9)


def test_a_wheel_outside_the_recording_is_an_error_that_names_it():
    basis = wheel_basis(paper_model("OT"), None, RATE)
    with pytest.raises(ValueError, match="wheel 1 at sample 5000 lies outside the 4000 samples"):
        joint_fit(np.zeros(4000), [100.0, 5000.0], basis)


def test_the_train_of_the_fixtures_is_that_of_the_axle_patterns():
    assert IC3[-1] == pytest.approx(53.1)
