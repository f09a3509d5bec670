"""Bern-Niederwangen: the closed form agrees with the meshed track, and the conclusions of the page are reproduced."""

import numpy as np
import pytest
from examples import niederwangen, niederwangen_page
from examples.decay_case import CHANGES, DecayCase, MeasuredRates, whitening
from examples.decay_model import BANDS, LATERAL, LINES, VERTICAL, Support, decay_rate

from turnout.simulate.decay_rate import track_decay_rate
from turnout.simulate.matrices import assemble
from turnout.simulate.rail import Rail
from turnout.simulate.track import uniform_track

PADS = {"pad_stiffness": 8e8, "pad_loss_factor": 0.2, "sleeper_mass": 150.0, "ballast_stiffness": 1e8}


def test_the_closed_form_agrees_with_the_meshed_track():
    """Vertical, 100 to 1600 Hz: 4 %, but 0.2 dB/m at the pinned-pinned band, whose depth is the mesh's damping."""
    rail = Rail(VERTICAL.bending, VERTICAL.mass, VERTICAL.shear, VERTICAL.rotary, damping=0.0)
    more = {"pad_damping": 0.0, "ballast_damping": 0.0, "ballast_loss_factor": 1.0, "elements_per_bay": 8}
    track = uniform_track(120.0, 0.6, rail, layers=2, end_length=9.0, end_damping=400.0, **PADS, **more)
    meshed = track_decay_rate(assemble(track), 36.3, 0.6, BANDS[:13], LINES)
    closed = decay_rate(VERTICAL, Support(8e8, 0.2, 150.0, 1e8, 1.0, 0.0))[:13]
    assert np.all(np.abs(closed - meshed) < 0.04 * meshed + np.where(BANDS[:13] == 1000.0, 0.2, 0.0)), (closed, meshed)


def test_the_decay_rate_of_a_free_rail_follows_from_its_loss_factor():
    """Far above the resonance of very soft pads: 8.686 eta k / 4, twice that as the near field doubles what the force's
    own place feels; k the wavenumber [rad/m]; 10 %."""
    beam, eta, f = LATERAL, 0.02, np.array([400.0])
    found = decay_rate(beam, Support(1e4, 0.0, 150.0, 1e9, 0.0, eta), f)
    omega = 2.0 * np.pi * f
    # Timoshenko: (k²)² B - k² w² (m B / S + rho I) - w² (m - w² m rho I / S) = 0
    b = omega**2 * (beam.mass * beam.bending / beam.shear + beam.rotary)
    c = omega**2 * (beam.mass - omega**2 * beam.mass * beam.rotary / beam.shear)
    k = np.sqrt((b + np.sqrt(b**2 + 4.0 * beam.bending * c)) / (2.0 * beam.bending))
    assert found == pytest.approx(2.0 * 8.686 * eta * k / 4.0, rel=0.1)


def test_whitened_errors_have_unit_variance():
    """C^(-1/2) C C^(-1/2) = 1 with C written down again."""
    octave, spread, repeat = np.log2(BANDS), np.linspace(0.1, 0.3, 18), np.linspace(0.4, 0.1, 18)
    shared = np.exp(-0.5 * ((octave[:, None] - octave[None, :]) / 0.5) ** 2)
    w = whitening(spread, repeat)
    assert w @ (np.diag(spread**2) + repeat[:, None] * shared * repeat) @ w == pytest.approx(np.eye(18), abs=1e-9)


@pytest.fixture(scope="module")
def folder(shared_data):
    folder = shared_data / "track_sbb_niederwangen"
    if not folder.is_dir():
        pytest.skip(f"no recordings: {folder} does not exist")
    return folder


@pytest.mark.slow
def test_the_conclusions_and_their_page_are_reproduced(folder, tmp_path):
    """As by the method without a model, docs/niederwangen_decay_rate.md: S1, S4, S5 changed by 2013-01, S2 did not."""
    measured, answers = niederwangen.read(folder), niederwangen.analyse(folder, report=lambda line: None)
    conclusions = {m.section: niederwangen.conclusion(answers[m.section][1]) for m in measured}
    assert {s for s, (what, _) in conclusions.items() if what == "changed"} == {"S1", "S4", "S5"}
    assert conclusions["S2"] == ("not changed", ())
    assert conclusions["S3"][0] == "left open"
    for section in ("S1", "S4", "S5"):
        assert set(conclusions[section][1]) <= niederwangen.DAMPING_EFFECTS
        assert {max(gains, key=gains.get) for gains in answers[section][2].values()} == {"2013-01"}
        for _, diagnosis in answers[section][1].values():
            assert diagnosis.verification.after > diagnosis.verification.before
            assert diagnosis.verification.decoy < diagnosis.verification.after
    niederwangen_page.draw(measured, answers, tmp_path / "page.svg")
    assert all(m.section in niederwangen_page.page(measured, answers) for m in measured)
    assert (tmp_path / "page.svg").stat().st_size


@pytest.mark.slow
def test_a_change_of_pads_would_have_been_distinguished_from_one_of_the_rail(folder):
    """S2's own numbers with the model's factor of another change in them: the right name, and no absorber."""
    quiet = next(m for m in niederwangen.read(folder) if m.section == "S2")
    priors = niederwangen.calibrate(quiet)
    values = {name: mean for name, (mean, _) in priors.items()}
    case = DecayCase(quiet, "2015-09", priors)
    change = next(c for c in case.candidates if c.family == "pads" and c.where["since"] == "2013-01")
    everything = (*case.observations, *case.reserved)
    log = {}
    for o in everything:
        with_it, without = (case.logarithm(values, terms, o) for terms in ((change.term([-1.2]),), ()))
        log[o.data_type, o.condition] = quiet.log[o.data_type, o.condition] + with_it - without
    planted = MeasuredRates("planted", log, quiet.spread, quiet.repeat, quiet.temperature, quiet.campaigns)
    verdict = niederwangen.diagnose(DecayCase(planted, "2015-09", priors)).verdict
    assert verdict.names and not set(verdict.names) & niederwangen.DAMPING_EFFECTS
    assert set(verdict.names) & {"pads", "vertical_pad", "lateral_pad"}
    assert set(verdict.names) <= set(CHANGES)
