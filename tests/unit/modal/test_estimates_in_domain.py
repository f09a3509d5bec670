"""All estimates are in the domain of an underdamped mode, and a failure of the estimator rejects no campaign."""

from datetime import date
from zlib import crc32

import numpy as np
import pytest
from benchmarks.published import hammer_test
from scipy.stats import norm, t

from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.demo.hammer import hammer_test as simulate_test
from turnout.demo.hammer import simulated_response
from turnout.hammer_test import find_impacts
from turnout.modal import identification, identify
from turnout.modal.bands import accepted_modes, failure_of_mode
from turnout.modal.joint import identify_joint
from turnout.modal.least_squares import drift_columns
from turnout.modal.mixed_effects import MAX_DAMPING, fit_mixed
from turnout.modal.summary import ImpactEstimates, summarise
from turnout.records import Mode
from turnout.stages.hammer import identify_accepted

SETTINGS = IdentifySettings(null_draws=10)


def odd_impact(kind, time, frequency):
    """A record of amplitude 1 without a resonance of the section."""
    return {
        "short": np.exp(-4000.0 * time),
        "step": np.ones_like(time) + 0.01 * np.random.default_rng(1).standard_normal(len(time)),
        "growing": np.exp(60.0 * time) * np.sin(2.0 * np.pi * frequency * time),
    }[kind]


@pytest.mark.parametrize("location", ["OT", "CP A9"])
@pytest.mark.parametrize("kind", ["short", "step", "growing"])
def test_with_one_outlying_impact_all_estimates_are_within_their_domain(location, kind):
    """Damping ratios of single impacts were up to 2.98 here, which no vibration has."""
    test = hammer_test(location, 6, 0)
    decays = np.array(test.decays())
    time = np.arange(decays.shape[1]) / test.rate
    decays[0] = odd_impact(kind, time, test.frequency[0, 0]) * np.abs(decays[1]).max()
    start = np.stack([np.log(test.frequency[0]), test.damping[0]], axis=1)
    fit = fit_mixed(start, decays, test.rate, drift_columns(decays.shape[1], -1))
    assert np.all(np.abs(fit.unshrunken[..., 1]) <= MAX_DAMPING)
    assert np.all(np.abs(fit.mean[:, 1]) <= MAX_DAMPING)
    assert np.all(np.isfinite(fit.unshrunken))
    assert fit.is_limited[0, 0] == (kind != "growing")
    assert not fit.is_limited[1:].any()
    model = identify(list(decays), test.rate, SETTINGS)
    for i, mode in enumerate(model.modes):
        assert abs(mode.frequency - test.frequency[1, i]) < 7.0 * mode.frequency_se


def pink_noise(rng, n):
    """(n,) noise with a power density proportional to 1/f, of variance 1."""
    frequency = np.maximum(np.fft.rfftfreq(n), 1.0 / n)
    noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) / np.sqrt(frequency), n)
    return noise / noise.std()


@pytest.mark.parametrize("seed", range(2))
def test_modes_in_one_over_f_noise_are_within_their_domain(seed):
    test = hammer_test("CP A7", 10, seed, snr_db=80.0)
    rng = np.random.default_rng(seed)
    decays = [y + 0.05 * np.abs(y).max() * pink_noise(rng, len(y)) for y in test.decays()]
    model = identify(decays, test.rate, SETTINGS)
    assert model.status != "rejected"
    for mode in model.modes:
        assert 0.0 <= mode.damping_low < mode.damping < mode.damping_high <= 1.0
    assert all(abs(row["damping"]) <= MAX_DAMPING for row in model.per_impact)


def test_an_impact_for_which_the_estimator_fails_is_left_out(monkeypatch):
    test = hammer_test("CP A7", 6, 3)
    decays = test.decays()

    def fails_with_third(given, *arguments, **options):
        if any(d is decays[2] for d in given):
            raise np.linalg.LinAlgError("Singular matrix")
        return identify_joint(given, *arguments, **options)

    monkeypatch.setitem(identification.METHODS, "joint", fails_with_third)
    model = identify(decays, test.rate, SETTINGS)
    ((impact, rejection),) = model.diagnostics["rejected_impacts"]
    assert (impact, rejection.reason) == (2, "odd_one_out")
    assert "Singular matrix" in rejection.detail
    assert model.status == "accepted"
    assert model.diagnostics["impacts"] == (0, 1, 3, 4, 5)
    assert sorted({row["impact"] for row in model.per_impact}) == [0, 1, 3, 4, 5]


def test_an_estimator_that_always_fails_gives_a_rejected_model(monkeypatch):
    def fails(*_, **__):
        raise ZeroDivisionError("no scale")

    monkeypatch.setitem(identification.METHODS, "joint", fails)
    model = identify(hammer_test("OT", 5, 3).decays(), 20e3, SETTINGS)
    assert model.status == "rejected"
    assert [r.reason for r in model.rejections] == ["not_identified"]
    assert "ZeroDivisionError: no scale" in model.rejections[0].detail


def test_the_error_of_a_mean_is_reported_in_two_parts():
    """Estimates 9 and 11: repeatability 1. The shared error of 2 has a normal interval, the scatter one of t(1)."""
    summary = summarise(np.array([9.0, 11.0]), np.array([0.1, 0.1]), 0.95, shared_se=2.0)
    assert (summary.repeatability, summary.systematic) == pytest.approx((1.0, 2.0))
    assert summary.se == pytest.approx(np.sqrt(5.0))
    half = np.hypot(t.ppf(0.975, 1), 2.0 * norm.ppf(0.975))
    assert (summary.low, summary.high) == pytest.approx((10.0 - half, 10.0 + half))


def demonstration_model(section, factors, number):
    """Receptance and model of 30 impacts at a section of the demonstration's track, with the noise of one campaign."""
    rng = np.random.default_rng([1, crc32(f"tommerup_s1/{section}".encode()), number])
    response = simulated_response(section, *factors)
    recordings = [r for k in (1, 2, 3) for r in simulate_test(response, 10.0, date(2024, 9, 14), k, rng)[0]]
    impacts = find_impacts(recordings, "force", "rail", ReceptanceSettings())
    return identify_accepted(impacts, ReceptanceSettings(), SETTINGS)[1:]


def check_receptance(measured, model):
    """The fitted receptance is the measured one at both resonances; it was wrong by a factor of two to five there."""
    at = [int(np.argmin(np.abs(measured.frequency - mode.frequency))) for mode in model.modes]
    ratio = model.fitted_receptance.at(measured.frequency[at]) / measured.h1[at]
    assert np.all(np.abs(ratio - 1.0) < 0.1)


def test_two_poles_do_not_replace_one_resonance():
    """Formerly poles of 477 and 493 Hz described the railpad resonance of one campaign: 505 Hz, and a fit of 55 %."""
    tests = [demonstration_model("A8", (1.0, 1.012), number) for number in (0, 5)]
    first, second = (model for _, model in tests)
    for measured, model in tests:
        check_receptance(measured, model)
        assert model.status == "accepted"
        assert model.fit > 70.0
    a, b = first.mode("railpad"), second.mode("railpad")
    assert abs(a.frequency - b.frequency) < 4.0 * np.hypot(a.frequency_repeatability, b.frequency_repeatability)
    assert abs(a.damping - b.damping) < 4.0 * np.hypot(a.damping_se, b.damping_se)


@pytest.mark.parametrize(("damping", "error", "is_rejected"), [
    (0.0074, 0.0233, True), (0.067, 0.002, False), (0.067, 0.034, True), (-0.01, 0.001, True),
])  # fmt: skip
def test_a_mean_that_is_too_uncertain_is_no_mode(damping, error, is_rejected):
    """A damping of 0.0074 ± 0.0233 was accepted; the limit of a damping is half its value."""
    mode = Mode("railpad", 611.0, damping, frequency_repeatability=0.8, damping_repeatability=error)
    failure = failure_of_mode(mode, SETTINGS)
    assert (failure is not None) == is_rejected
    if is_rejected:
        assert failure.reason == "not_identified" and "railpad mode at 611 Hz" in failure.detail


def shared_error_mode(band, frequency, shared, damping=0.1, damping_shared=0.0):
    """A mode whose ten impacts agree, with the relative error ``shared`` of the frequency common to all of them."""
    estimate = np.column_stack([np.log(frequency) + 1e-3 * np.arange(-4.5, 5.0), np.full(10, damping)])
    error, shared_se = np.full((10, 2), 1e-3), np.array([shared, damping_shared])
    return ImpactEstimates(band, np.arange(10), estimate, error, np.ones(10), shared_se=shared_se)


@pytest.mark.parametrize(("estimates", "is_rejected"), [
    (shared_error_mode("ballast", 307.0, 0.25, 0.4, 0.34), True),  # formerly accepted: all of its error is shared
    # intervals of ± 1.96 x 4 %: 288 to 337 Hz, 268 to 314 Hz, 262 to 307 Hz; edges 330 and 273 Hz
    (shared_error_mode("ballast", 312.0, 0.04), True), (shared_error_mode("ballast", 290.0, 0.04), False),
    (shared_error_mode("railpad", 284.0, 0.04), True), (shared_error_mode("railpad", 299.0, 0.003), False),
    # ± 1.96 x 40 %: 68 to 329 Hz, 46 to 219 Hz, 45 to 215 Hz; the lower edge is 45.5 Hz
    (shared_error_mode("ballast", 150.0, 0.4), False), (shared_error_mode("ballast", 98.0, 0.4), True),
    (shared_error_mode("ballast", 102.0, 0.4), False), (shared_error_mode("railpad", 750.0, 0.1), True),
    (shared_error_mode("other1", 284.0, 0.04), False),
])  # fmt: skip
def test_an_error_that_all_impacts_share_counts(estimates, is_rejected):
    """An interval beyond the band of a resonance does not identify it, even if all impacts agree."""
    accepted, failed = accepted_modes([estimates], SETTINGS)
    assert len(accepted) == (not is_rejected)
    reasons = [(band, rejection.reason) for band, rejection in failed]
    assert reasons == ([(estimates.band, "not_identified")] if is_rejected else [])
