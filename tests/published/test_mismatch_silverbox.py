"""A recorded oscillator whose missing physics is known: the cubic spring of the Silverbox benchmark.

Wigren and Schoukens 2013, Three free data sets for development and benchmarking in nonlinear system identification.
The engine has no prior knowledge; its library holds ten effects. Samples 0 to 40000 are the growing arrow, behind them
ten realisations of a multisine.
"""

import numpy as np
import pytest
from examples import silverbox
from examples.oscillator_case import LAWS, OscillatorCase
from examples.recorded import DOCS, folder_of

from turnout.mismatch import diagnose


@pytest.fixture(scope="module")
def folder(shared_data):
    return shared_data / "nonlinear_silverbox"


@pytest.fixture(scope="module")
def results(folder):
    """The two diagnoses of the page: with all effects, and without the right one."""
    return silverbox.analyse(folder)


@pytest.fixture(scope="module")
def all_laws(results):
    """(case, diagnosis) with all effects of the library."""
    return results["without prior knowledge"]


def reserved_fits(case, fit):
    """Fit [%] and residual [mV] of the reserved multisine and of the arrow."""
    return zip(*silverbox.held_out(case, fit))


@pytest.mark.slow
def test_the_cubic_spring_is_named_and_predicts_reserved_recordings(all_laws):
    case, found = all_laws
    assert len(LAWS) >= 8
    assert found.verdict.answer == "named" and found.names == ("cubic_spring",)
    (multisine, arrow), residuals = reserved_fits(case, found.fit)
    assert multisine >= 98.0 and arrow >= 96.0
    assert max(residuals) < 1.0  # mV; 0.9 to 1.0 by the best of simple models, the sensor's noise is below 0.3
    assert found.verification.after > found.verification.rival > found.verification.before
    assert found.verification.decoy < found.verification.before + 0.5


@pytest.mark.slow
def test_the_linear_base_predicts_as_published(all_laws):
    """A linear second-order model reaches 88 % on the multisine and 73 % on the arrow."""
    case, found = all_laws
    (multisine, arrow), _ = reserved_fits(case, found.base)
    assert multisine == pytest.approx(88.0, abs=1.0) and arrow == pytest.approx(73.0, abs=2.0)


@pytest.mark.slow
def test_without_the_right_effect_the_answer_is_unknown_and_the_force_is_shown(results):
    case, found = results["law removed"]
    assert silverbox.missing_force(case, found.base).best_covariate == "displacement"
    assert found.verdict.answer == "unknown" and not found.names
    assert found.latent.best_covariate == "displacement"
    centre, force, _ = found.latent.curves["displacement"]
    odd = np.polyfit(centre, force, 3)
    assert odd[0] > 0.0  # the force that the base model lacks is that of a hardening spring
    assert found.latent.r2["displacement"] > 10 * max(found.latent.r2["velocity"], found.latent.r2["time"])


@pytest.mark.slow
def test_without_the_offset_of_the_sensor_a_wrong_effect_has_evidence(folder, all_laws):
    """A missing nuisance parameter of the model appears as a false effect."""
    with_offset, _ = all_laws
    without = OscillatorCase(*silverbox.recordings(folder), silverbox.RATE, **silverbox.PRIORS, offset=0.0)
    blind = diagnose(without)
    _, left = reserved_fits(with_offset, all_laws[1].fit)
    _, hidden = reserved_fits(without, blind.fit)
    assert min(hidden) > 4.0 and max(left) < 1.0
    assert blind.verdict.grade != "A"
    assert any(s.family == "quadratic_spring" and s.gain > 50.0 for s in blind.verdict.scores)  # one-sided: false
    assert all(s.gain < 50.0 for s in all_laws[1].verdict.scores if s.family == "quadratic_spring")


@pytest.mark.slow
def test_only_another_condition_reveals_the_wrong_effect(all_laws):
    """|y|y fits well at the amplitude of the fit and fails at larger ones; the cubic spring does not."""
    case, found = all_laws
    scores = {s.family: s for s in found.verdict.scores}
    ratios = {}
    for name in ("cubic_spring", "absolute_quadratic_spring"):
        _, (same, larger) = reserved_fits(case, scores[name].fit)
        ratios[name] = larger / same
    assert scores["absolute_quadratic_spring"].explained > 0.9
    assert ratios["cubic_spring"] < 1.4 and ratios["absolute_quadratic_spring"] > 2.0


def test_the_page_follows_from_the_recording(results):
    text = silverbox.page(results)
    assert "**named: cubic spring**" in text and "**unknown**" in text
    assert text.splitlines()[0] == (DOCS / "silverbox.md").read_text(encoding="utf-8").splitlines()[0]


def test_a_missing_recording_is_reported(tmp_path):
    with pytest.raises(SystemExit, match=r"skipped: .* does not exist"):
        folder_of("nonlinear_silverbox", [str(tmp_path / "nowhere")])
