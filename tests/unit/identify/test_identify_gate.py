"""The coherence gate decides which modes may be reported, and H1 gives the response to a unit impulse."""

import numpy as np
import pytest

from turnout.config.settings.identify import IdentifySettings
from turnout.identify import identify
from turnout.identify.gate import passed_share, residues_of_receptance
from turnout.identify.poles import continuous_pole
from turnout.published import hammer_test, published_model
from turnout.records import Receptance

SETTINGS = IdentifySettings(null_draws=10)
FREQUENCY = np.arange(5.0, 1500.0, 5.0)


def accelerance(model, residue):
    omega = 2.0 * np.pi * FREQUENCY[:, None]
    s = continuous_pole(model.frequency, model.damping)
    return 0.5 * (residue / (1j * omega - s) + residue.conj() / (1j * omega - s.conj())).sum(axis=1)


def receptance(model, passed, residue=None):
    residue = model.residue if residue is None else residue
    h = -accelerance(model, residue) / (2.0 * np.pi * FREQUENCY) ** 2
    level = np.where(passed, 0.95, 0.3)
    return Receptance(FREQUENCY, h, h, h, level, level, level, level, passed, 10, 1500.0)


def test_a_gate_that_stops_the_railpad_band_leaves_a_second_order_model():
    test = hammer_test("CP A7", 10, 1)
    model = identify(test.decays(), test.rate, SETTINGS, receptance(published_model("CP A7"), FREQUENCY < 300.0))
    assert model.status == "second_order_only"
    assert (model.order, [m.band for m in model.modes]) == (2, ["ballast"])
    (rejection,) = model.rejections
    assert (rejection.reason, rejection.value) == ("low_coherence", 0.0)
    assert rejection.detail == "railpad mode: share of its half-power band that passes the gate; lowest level 0.30"
    assert [m["reason"] for m in model.rejected_modes if m["value"] == 0.0] == ["fails the coherence gate"]
    # The railpad mode stays in the fit, so the ballast mode is not biased by leaving it out.
    assert len(model.diagnostics["modes_in_fit"]) == 2
    assert abs(model.modes[0].frequency - test.frequency[0, 0]) < 6.0 * model.modes[0].frequency_se


def test_a_gate_that_stops_everything_gives_no_model():
    test = hammer_test("CP A7", 10, 2)
    gated = receptance(published_model("CP A7"), np.zeros(len(FREQUENCY), dtype=bool))
    model = identify(test.decays(), test.rate, SETTINGS, gated)
    assert model.status == "rejected"
    assert [r.reason for r in model.rejections] == ["low_coherence", "low_coherence"]


def test_the_share_counts_the_lines_of_the_half_power_band():
    model = published_model("CP A7")
    share, level = passed_share(receptance(model, FREQUENCY <= 100.0), 100.0, 0.3)
    # 70 to 130 Hz in steps of 5: thirteen lines, seven of them up to 100 Hz.
    assert share == pytest.approx(7 / 13)
    assert level == 0.3
    assert passed_share(receptance(model, FREQUENCY > 0.0), 2000.0, 0.1)[0] == 0.0


def test_residues_of_an_exact_receptance_are_found_with_a_rotated_phase():
    model = published_model("OT")
    residue = model.residue * np.exp(0.4j)
    found = residues_of_receptance(receptance(model, FREQUENCY < 900.0, residue), model.frequency, model.damping)
    np.testing.assert_allclose(found, residue, rtol=1e-8)


def test_too_few_lines_give_no_residues():
    model = published_model("OT")
    assert residues_of_receptance(receptance(model, FREQUENCY < 50.0), model.frequency, model.damping) is None


def test_with_a_receptance_the_model_answers_a_unit_impulse():
    """y at sample k is the impulse response at time k/rate, of the modes as identified."""
    test = hammer_test("SP", 10, 3)
    truth = published_model("SP")
    model = identify(test.decays(), test.rate, SETTINGS, receptance(truth, FREQUENCY < 900.0))
    assert model.diagnostics["scale"].startswith("unit impulse")
    k = np.arange(300)
    expected = (
        truth.residue[:, None] * np.exp(continuous_pole(truth.frequency, truth.damping)[:, None] * k / 20e3)
    ).real
    x, out = model.b, []
    for _ in k:
        out.append(model.c @ x)
        x = model.a @ x
    # The railpad frequency is good to 2e-5 and turns 7.5 times in 300 samples: 1e-3 of phase; damping likewise.
    np.testing.assert_allclose(out, expected.sum(axis=0), atol=5e-3 * np.abs(expected).max())
