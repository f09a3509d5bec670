"""The coherence gate decides which modes may be reported, and H1 gives the response to a unit impulse."""

import numpy as np
import pytest
from benchmarks.published import hammer_test, published_model

from turnout.config.settings.identify import IdentifySettings
from turnout.config.settings.receptance import ReceptanceSettings
from turnout.hammer_test import find_impacts, receptance_of
from turnout.modal import identify
from turnout.modal.bands import fit_receptance, passed_share
from turnout.modal.poles import continuous_pole
from turnout.records import Channel, Receptance, Recording

SETTINGS = IdentifySettings(null_draws=10)
FREQUENCY = np.arange(5.0, 1500.0, 5.0)


def accelerance(model, residue, p):
    s = continuous_pole(model.frequency, model.damping)
    return 0.5 * (residue / (p[:, None] - s) + residue.conj() / (p[:, None] - s.conj())).sum(axis=1)


def receptance(model, passed, residue=None, decay=0.0):
    residue = model.residue if residue is None else residue
    p = 2j * np.pi * FREQUENCY + decay
    h = accelerance(model, residue, p) / p**2
    level = np.where(passed, 0.95, 0.3)
    return Receptance(FREQUENCY, h, h, h, level, level, level, level, passed, 10, 1500.0, decay=decay)


def test_a_gate_that_rejects_the_railpad_band_leaves_a_second_order_model():
    test = hammer_test("CP A7", 10, 1)
    model = identify(test.decays(), test.rate, SETTINGS, receptance(published_model("CP A7"), FREQUENCY < 300.0))
    assert model.status == "second_order_only"
    assert (model.order, [m.band for m in model.modes]) == (2, ["ballast"])
    (rejection,) = model.rejections
    assert (rejection.reason, rejection.value) == ("low_coherence", 0.0)
    assert rejection.detail == "railpad mode: share of its half-power band that passes the gate; lowest level 0.30"
    assert [m["reason"] for m in model.rejected_modes if m["value"] == 0.0] == ["fails the coherence gate"]
    # The railpad mode stays in the fit, so that the ballast mode has no bias.
    assert len(model.diagnostics["modes_in_fit"]) == 2
    assert abs(model.modes[0].frequency - test.frequency[0, 0]) < 6.0 * model.modes[0].frequency_se


def test_a_gate_that_rejects_all_lines_gives_no_model():
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


@pytest.mark.parametrize("decay", [0.0, 30.0, 100.0])
def test_residues_of_an_exact_receptance_are_found_with_a_rotated_phase(decay):
    """Behind an exponential window the response is that on a line to the right of the imaginary axis."""
    model = published_model("OT")
    residue = model.residue * np.exp(0.4j)
    exact = receptance(model, FREQUENCY < 900.0, residue, decay)
    found = fit_receptance(exact, model.frequency, model.damping).residue
    np.testing.assert_allclose(found, residue, rtol=1e-8)


def test_the_response_to_a_unit_impulse_does_not_depend_on_the_exponential_window():
    """The same ten impacts at 60 dB: residues and b of their model as without a window, to 1 %."""
    test, found = hammer_test("SP", 10, 3, snr_db=60, duration=0.25, pre_trigger=5e-3), []
    channels = Channel("h", "force"), Channel("r", "acceleration")
    recordings = [
        Recording(np.stack(pair), test.rate, channels, record=i)
        for i, pair in enumerate(zip(test.force, test.acceleration))
    ]
    for decay in (0.0, 30.0, 100.0):
        settings = ReceptanceSettings(exponential_window=decay)
        impacts = [i for i in find_impacts(recordings, "h", "r", settings) if i.accepted]
        curve = receptance_of(impacts, settings)
        model = identify([i.decay for i in impacts], test.rate, SETTINGS, curve)
        assert model.diagnostics["scale"].startswith("unit impulse")
        modes = [m.frequency for m in model.modes], [m.damping for m in model.modes]
        found.append((fit_receptance(curve, *modes).residue, model.b))
    for residue, b in found[1:]:
        np.testing.assert_allclose(residue, found[0][0], rtol=1e-2)
        np.testing.assert_allclose(b, found[0][1], atol=1e-2 * np.abs(found[0][1]).max())


def test_too_few_lines_give_no_residues():
    model = published_model("OT")
    assert fit_receptance(receptance(model, FREQUENCY < 50.0), model.frequency, model.damping) is None


def test_with_a_receptance_the_model_gives_the_response_to_a_unit_impulse():
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
    # The railpad frequency is known to 2e-5 and has 7.5 periods in 300 samples: 1e-3 of phase; damping likewise.
    np.testing.assert_allclose(out, expected.sum(axis=0), atol=5e-3 * np.abs(expected).max())
