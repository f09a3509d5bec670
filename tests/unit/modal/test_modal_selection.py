"""Reported modes: all true modes and no others, without knowledge of their number and frequencies."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.published import LOCATIONS, UNMODELLED, Nuisance, hammer_test, published_model

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import identify

SETTINGS = IdentifySettings(null_draws=10)


def hammer_test_and_model(location, seed=0, n=10, settings=SETTINGS, **conditions):
    test = hammer_test(location, n, seed, **conditions)
    return test, identify(test.decays(), test.rate, settings)


@pytest.mark.parametrize("location", LOCATIONS)
def test_at_every_location_the_true_modes_and_no_others_are_reported(location):
    test, model = hammer_test_and_model(location)
    assert tuple(m.band for m in model.modes) == test.bands
    assert len(model.diagnostics["modes_in_fit"]) == len(test.bands)
    for i, mode in enumerate(model.modes):
        # Six standard errors of a t with nine degrees of freedom: a chance of 1e-4 per value.
        assert abs(mode.frequency - test.frequency[0, i]) < 6.0 * mode.frequency_se
        assert abs(mode.damping - test.damping[0, i]) < 6.0 * mode.damping_se
        assert mode.frequency_low < mode.frequency < mode.frequency_high
        assert mode.n == 10
    assert model.status == ("second_order_only" if location == "CP A8" else "accepted")


@pytest.mark.parametrize("location", ["OT", "CP A7", "AS diverging"])
@pytest.mark.parametrize("snr", [40.0, 26.0])
def test_unmodelled_modes_and_drift_do_not_affect_the_modes(location, snr):
    """Limits of the rms over many tests, here for single tests at three times their value."""
    test, model = hammer_test_and_model(location, 4, snr_db=snr, nuisance=UNMODELLED, drift=0.05)
    ballast, railpad = model.mode("ballast"), model.mode("railpad")
    f_limit, zeta_limit = (0.015, 0.075) if snr == 40.0 else (0.036, 0.21)
    assert ballast.frequency == pytest.approx(test.frequency[0, 0], rel=f_limit)
    assert ballast.damping == pytest.approx(test.damping[0, 0], rel=zeta_limit)
    assert railpad.frequency == pytest.approx(test.frequency[0, 1], rel=f_limit)
    fitted = np.sort(model.diagnostics["modes_in_fit"])
    np.testing.assert_allclose(fitted, np.sort(test.frequency[0]), rtol=0.03)
    frequencies = sorted(m["frequency"] for m in model.rejected_modes if "stays in the fit" in m["reason"])
    assert frequencies == pytest.approx([330.0, 1050.0], rel=0.03)


@pytest.mark.parametrize("location", ["CP A9", "AS main"])
def test_a_mode_that_scatters_between_impacts_is_not_reported_as_two(location):
    _, model = hammer_test_and_model(location, 1, spread=0.03)
    assert len(model.diagnostics["modes_in_fit"]) == 2
    # Ten impacts of 3 %: the spread is known to 1/sqrt(18) = 24 %.
    assert model.mode("railpad").frequency_sd / model.mode("railpad").frequency == pytest.approx(0.03, rel=0.7)


def test_white_noise_and_random_walks_have_no_modes():
    rng = np.random.default_rng(2)
    for _ in range(5):
        white = rng.standard_normal((10, 600))
        for decays in (white, np.cumsum(white, axis=1), white + 5.0 * np.linspace(0.0, 1.0, 600)):
            model = identify(list(decays), 20e3, SETTINGS)
            assert model.status == "rejected"
            assert model.order == 0
            assert [r.reason for r in model.rejections] == ["not_identified", "not_identified"]


@pytest.mark.parametrize("hum", [50.0, 150.0, 16.7])
def test_hum_is_modelled_and_reported(hum):
    rng = np.random.default_rng(6)
    test = hammer_test("CP A7", 10, 6)
    size = 0.05 * max(np.abs(y).max() for y in test.decays())
    time = np.arange(600) / test.rate
    decays = [y + size * np.sin(2 * np.pi * hum * time + rng.uniform(0.0, 2 * np.pi)) for y in test.decays()]
    model = identify(decays, test.rate, SETTINGS)
    # Half a period in the record cannot be distinguished from a drift, and need not be.
    as_drift = hum == 16.7 and model.diagnostics["drift_degree"] >= 2
    assert as_drift or model.diagnostics["hum"] == (hum,)
    for i, mode in enumerate(model.modes):
        assert abs(mode.frequency - test.frequency[0, i]) < 6.0 * mode.frequency_se
        assert abs(mode.damping - test.damping[0, i]) < 6.0 * mode.damping_se


def test_coloured_noise_is_modelled():
    test = hammer_test("CP A7", 10, 7, snr_db=80.0)
    noise = np.random.default_rng(7).standard_normal((10, 800))
    for k in range(1, 800):
        noise[:, k] += 0.7 * noise[:, k - 1]
    size = 0.005 * max(np.abs(y).max() for y in test.decays())
    decays = [y + size * e for y, e in zip(test.decays(), noise[:, 200:], strict=True)]
    model = identify(decays, test.rate, SETTINGS)
    assert model.diagnostics["noise_order"] >= 1
    for i, mode in enumerate(model.modes):
        assert abs(mode.frequency - test.frequency[0, i]) < 6.0 * mode.frequency_se
        assert abs(mode.damping - test.damping[0, i]) < 6.0 * mode.damping_se


@pytest.mark.parametrize("damage", ["noise", "second impact"])
def test_an_outlying_impact_is_left_out_and_reported(damage):
    test = hammer_test("SP", 10, 8)
    decays = test.decays()
    size = np.abs(decays[3]).max()
    if damage == "noise":
        decays[3] = 0.3 * size * np.random.default_rng(8).standard_normal(600)
    else:
        decays[3] = decays[3] + np.concatenate([np.zeros(250), 0.8 * decays[3][:350]])
    model = identify(decays, test.rate, SETTINGS)
    ((impact, rejection),) = model.diagnostics["rejected_impacts"]
    assert (impact, rejection.reason) == (3, "odd_one_out")
    assert 3 not in {row["impact"] for row in model.per_impact}
    assert {m.n for m in model.modes} == {9}
    assert model.mode("railpad").frequency == pytest.approx(test.frequency[0, 1], rel=1e-3)


def test_a_third_resonance_is_kept_when_its_band_is_configured():
    rail = Nuisance(1050.0, 0.03, 0.4)
    settings = IdentifySettings(null_draws=10, extra_bands=(800.0, 1500.0))
    _, model = hammer_test_and_model("CP A7", 9, settings=settings, nuisance=(rail,))
    assert [m.band for m in model.modes] == ["ballast", "railpad", "other1"]
    assert model.order == 6
    assert model.mode("other1").frequency == pytest.approx(1050.0, abs=6.0 * model.mode("other1").frequency_se)


def test_the_result_does_not_depend_on_the_order_of_impacts_and_is_repeatable():
    test = hammer_test("CLP", 6, 10)
    decays = test.decays()
    first, again = identify(decays, test.rate, SETTINGS), identify(decays, test.rate, SETTINGS)
    assert first.modes == again.modes
    assert first.per_impact == again.per_impact
    turned = identify(decays[::-1], test.rate, SETTINGS)
    for one, other in zip(first.modes, turned.modes, strict=True):
        assert one.frequency == pytest.approx(other.frequency, rel=1e-6)


def test_one_impact_gives_modes_with_the_error_of_its_noise():
    test, model = hammer_test_and_model("CP A7", 11, n=1)
    for i, mode in enumerate(model.modes):
        assert mode.n == 1
        assert mode.frequency_se == pytest.approx(mode.frequency_crb, rel=0.05)
        assert abs(mode.frequency - test.frequency[0, i]) < 6.0 * mode.frequency_se
    assert model.fit is None


def test_the_held_out_fit_exceeds_its_null_and_reaches_its_limit():
    test, model = hammer_test_and_model("CP A7", 12, settings=replace(SETTINGS, null_draws=100))
    decays = np.array(test.decays())
    noise_share = test.noise[:, None] * np.sqrt(600) / np.linalg.norm(decays - decays.mean(1, keepdims=True), axis=1)
    limit = 100.0 * (1.0 - np.median(noise_share.diagonal()))
    assert model.fit == pytest.approx(limit, abs=1.0)
    null = random_fits(decays, test.rate, [edges for name, *edges in SETTINGS.bands() if name in test.bands], 400)
    # The 95 % quantile of 100 draws lies between these of 400 others, with a chance of 97 %.
    assert np.quantile(null, 0.9) < model.diagnostics["fit_null"] < np.quantile(null, 0.99)


def random_fits(decays, rate, bands, draws):
    """(draws,) median fits [%] of modes drawn in the bands, by least squares on their damped cosines and sines."""
    rng, time = np.random.default_rng(99), np.arange(decays.shape[1]) / rate
    scale, fits = np.linalg.norm(decays - decays.mean(axis=1, keepdims=True), axis=1), []
    for _ in range(draws):
        omega = 2.0 * np.pi * np.array([low * (high / low) ** rng.uniform() for low, high in bands])
        zeta = rng.uniform(0.02, 0.3, omega.size)
        phase = np.outer(time, omega * np.sqrt(1.0 - zeta**2))
        envelope = np.exp(-np.outer(time, zeta * omega))
        basis = np.hstack([envelope * np.cos(phase), envelope * np.sin(phase)])
        residual = decays.T - basis @ np.linalg.lstsq(basis, decays.T, rcond=None)[0]
        fits.append(np.median(100.0 * (1.0 - np.linalg.norm(residual, axis=0) / scale)))
    return np.array(fits)


def test_stabilisation_lists_the_poles_of_every_order():
    test, model = hammer_test_and_model("CP A7", 13)
    stable = [row for row in model.stabilisation if row["status"] == "stable"]
    assert {row["order"] for row in model.stabilisation} == set(range(2, 17, 2))
    for f in test.frequency[0]:
        assert sum(abs(row["frequency"] / f - 1.0) < 0.08 for row in stable) >= 6


BAD = {
    "nothing": ([], "no decays"),
    "short": ([np.ones(100), np.arange(30.0)], "no decay is long enough"),
    "nan": ([np.full(600, np.nan)], "no decay is long enough"),
    "constant": ([np.ones(600)], "no decay is long enough"),
}


@pytest.mark.parametrize("case", BAD)
def test_unusable_decays_give_a_rejected_model_with_a_reason(case):
    decays, words = BAD[case]
    model = identify(decays, 20e3, SETTINGS)
    assert model.status == "rejected"
    assert words in model.rejections[0].detail
    assert len(model.diagnostics["rejected_impacts"]) == len(decays)


def test_one_bad_decay_is_left_out_alone():
    test = hammer_test("CP A7", 5, 14)
    decays = test.decays()
    decays[1] = decays[1][:150]
    decays[4] = np.where(np.arange(600) == 77, np.inf, decays[4])
    model = identify(decays, test.rate, SETTINGS)
    rejected = {impact: rejection for impact, rejection in model.diagnostics["rejected_impacts"]}
    assert {i: r.reason for i, r in rejected.items()} == {1: "late", 4: "not_finite"}
    assert rejected[4].value == 77
    assert {row["impact"] for row in model.per_impact} == {0, 2, 3}


def test_a_method_that_does_not_exist_is_an_error_with_the_list():
    with pytest.raises(ValueError, match=r"no method 'ssi'; there are \['joint', 'paper'\]"):
        identify([], 20e3, SETTINGS, method="ssi")


def test_the_truth_of_the_generator_is_that_of_the_paper():
    """The decays that are identified obey the printed matrices: a linear recursion of order four."""
    model = published_model("CP A7")
    y = hammer_test("CP A7", 1, 15, snr_db=400.0).decays()[0]
    coefficients = np.poly(np.linalg.eigvals(model.a))
    predicted = -sum(coefficients[k] * y[4 - k : len(y) - k] for k in range(1, 5))
    np.testing.assert_allclose(predicted, y[4:], atol=1e-7 * np.abs(y).max())
