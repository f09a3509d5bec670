"""The paper's procedure with its bias, which every result states."""

import numpy as np
import pytest
from benchmarks.published import LOCATIONS, hammer_test

from turnout.config.settings.identify import IdentifySettings
from turnout.modal import identify
from turnout.modal.paper import band_modes, split_bands

SETTINGS = IdentifySettings(null_draws=10, paper_bias_tests=8)


def paper(location, settings=SETTINGS, with_leads=True, **conditions):
    test = hammer_test(location, 6, 4, pre_trigger=0.01, **conditions)
    leads = [y[:k] for y, k in zip(test.acceleration, test.decay_start, strict=True)] if with_leads else None
    options = {"leads": leads} if with_leads else {}
    return test, identify(test.decays(), test.rate, settings, method="paper", **options)


@pytest.mark.parametrize("location", LOCATIONS)
def test_the_stated_bias_is_the_actual_bias(location):
    """The bias depends on contact time and start sample: random in the simulation, fixed in the test. To 2.5 %."""
    test, model = paper(location)
    assert "ballast" in [m.band for m in model.modes]
    for mode in model.modes:
        true = test.frequency[0, test.bands.index(mode.band)]
        bias = model.diagnostics["simulated_bias"][mode.band]
        assert 100.0 * (mode.frequency / true - 1.0) == pytest.approx(bias["frequency_percent"], abs=2.5)
    assert (
        f"ballast f {model.diagnostics['simulated_bias']['ballast']['frequency_percent']:+.1f} %"
        in (model.diagnostics["bias_words"])
    )


def test_the_ballast_mode_has_a_bias_that_the_joint_method_does_not_have():
    test, model = paper("OT")
    joint = identify(test.decays(), test.rate, SETTINGS, method="joint")
    truth = test.frequency[0, 0]
    assert abs(model.mode("ballast").frequency / truth - 1.0) > 0.05
    assert abs(joint.mode("ballast").frequency / truth - 1.0) < 0.01


def test_two_bands_give_two_pairs():
    _, model = paper("CP A7")
    assert (model.method, model.order, model.status) == ("paper", 4, "accepted")
    assert np.all(model.a[:2, 2:] == 0.0)
    assert np.all(model.a[2:, :2] == 0.0)
    assert model.fit is not None


def test_a_location_with_one_band_gives_a_second_order_model():
    _, model = paper("CP A8")
    assert (model.order, model.status) == (2, "second_order_only")
    assert [r.reason for r in model.rejections] == ["not_identified"]


def test_a_causal_filter_shifts_the_ballast_mode_of_a7_downwards():
    """Two states cannot contain the poles of the causal filter: the shift is tens of percent."""
    settings = IdentifySettings(null_draws=10, paper_bias_tests=4, paper_zero_phase=False)
    test, model = paper("CP A7", settings)
    mode = model.mode("ballast")
    assert mode is None or mode.frequency < 0.85 * test.frequency[0, 0]


def test_without_samples_before_the_decay_the_diagnostics_state_that():
    _, model = paper("CP A7", with_leads=False)
    assert model.diagnostics["filters_start_at"] == "decay"


def test_settings_choose_the_method():
    test = hammer_test("SP", 3, 5)
    model = identify(test.decays(), test.rate, IdentifySettings(method="paper", null_draws=10, paper_bias_tests=2))
    assert model.method == "paper"


@pytest.mark.parametrize(("rate", "bands"), [(1600.0, 2), (1500.0, 2), (1280.0, 2), (400.0, 1)])
def test_at_a_low_rate_the_upper_band_ends_below_half_of_it(rate, bands):
    """Decays of 60 Hz and, where it fits, of 350 Hz: order 2 finds each in its band, for any upper limit of the
    filter."""
    k = np.arange(int(0.5 * rate)) / rate
    wanted = [(60.0, 0.05), (350.0, 0.05)][:bands]
    lead = np.zeros(int(0.05 * rate))
    records = sum(np.exp(-z * 2 * np.pi * f * k) * np.cos(2 * np.pi * f * k) for f, z in wanted)
    found = band_modes([np.r_[lead, records]], [len(lead)], len(k), rate, SETTINGS)[:, 0]
    assert found[:bands, 0] == pytest.approx([f for f, _ in wanted], rel=0.05)
    assert np.isnan(found[bands:]).all()
    # the upper band ends at 0.45 of the rate, and there is no upper band if that is below the split
    assert len(split_bands([records], rate, SETTINGS)) == bands


def test_one_impact_has_no_standard_error():
    test = hammer_test("CP A7", 1, 4, pre_trigger=0.01)
    leads = [y[:k] for y, k in zip(test.acceleration, test.decay_start, strict=True)]
    model = identify(test.decays(), test.rate, SETTINGS, method="paper", leads=leads)
    assert model.modes and all(m.n == 1 for m in model.modes)
    for mode in model.modes:
        assert (mode.frequency_se, mode.damping_se, mode.frequency_low, mode.damping_high) == (None,) * 4
    assert all(row["frequency_se"] is None and row["damping_se"] is None for row in model.per_impact)


def test_the_spread_of_impacts_is_stated_without_errors_of_single_impacts():
    """The procedure states no error of an impact: all differences between impacts are spread."""
    _, model = paper("CP A7", spread=0.02)
    for mode in model.modes:
        own = [row for row in model.per_impact if row["band"] == mode.band]
        assert {row["frequency_se"] for row in own} == {None}
        logs = np.log([row["frequency"] for row in own])
        assert mode.frequency_sd / mode.frequency == pytest.approx(logs.std(ddof=1), rel=1e-6)
        assert mode.frequency_se == pytest.approx(mode.frequency_sd / np.sqrt(len(own)), rel=1e-6)
