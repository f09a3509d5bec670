"""A recorded oscillator whose missing physics is known: the cubic spring of the Silverbox benchmark.

Wigren and Schoukens 2013, Three free data sets for development and benchmarking in nonlinear system identification.
The engine has no prior knowledge; its library holds ten laws. Samples 0 to 40000 are the growing arrow, behind them
ten realisations of a multisine.
"""

import numpy as np
import pytest
from examples.oscillator_case import LAWS, OscillatorCase

from turnout.mismatch import diagnose
from turnout.mismatch.engine.reserved_data import fit_percent, predict_reserved

RATE = 1e7 / 2**14
START, LENGTH = 40650, 8692


@pytest.fixture(scope="module")
def records(shared_data):
    path = shared_data / "nonlinear_silverbox" / "SNLS80mV.csv"
    u, y = np.genfromtxt(path, delimiter=",", skip_header=1)[:, :2].T
    parts = [slice(START + k * LENGTH, START + (k + 1) * LENGTH) for k in range(10)]
    sines = [(f"multisine {k}", f"multisine {k}", u[part], y[part]) for k, part in enumerate(parts)]
    return sines[:5], [sines[8], ("arrow", "arrow", u[:40000], y[:40000])]


def case_of(records, **options):
    return OscillatorCase(*records, RATE, frequency=(60.0, 30.0), damping=(0.1, 0.1), gain=(1.0, 1.0), **options)


@pytest.fixture(scope="module")
def told_nothing(records):
    case = case_of(records)
    return case, diagnose(case)


def reserved_fits(case, fit):
    predictions = predict_reserved(case, fit, case.reserved)
    residuals = [1e3 * float(np.sqrt(np.mean((o.data - p) ** 2))) for o, p in zip(case.reserved, predictions)]
    return [fit_percent([o], [p]) for o, p in zip(case.reserved, predictions)], residuals


@pytest.mark.slow
def test_the_cubic_law_is_chosen_and_predicts_what_it_never_saw(told_nothing):
    case, found = told_nothing
    assert len(LAWS) >= 8
    assert found.verdict.answer == "named" and found.names == ("cubic_spring",)
    (multisine, arrow), residuals = reserved_fits(case, found.fit)
    assert multisine >= 98.0 and arrow >= 96.0
    assert max(residuals) < 1.0  # mV; 0.9 to 1.0 by the best of simple models, the sensor's noise is below 0.3
    assert found.verification.after > found.verification.rival > found.verification.before
    assert found.verification.decoy < found.verification.before + 0.5


@pytest.mark.slow
def test_the_linear_base_predicts_as_published(told_nothing):
    """A linear second-order model reaches 88 % on the multisine and 73 % on the arrow."""
    case, found = told_nothing
    (multisine, arrow), _ = reserved_fits(case, found.base)
    assert multisine == pytest.approx(88.0, abs=1.0) and arrow == pytest.approx(73.0, abs=2.0)


@pytest.mark.slow
def test_without_the_right_law_the_answer_is_unknown_and_the_force_is_shown(records):
    case = case_of(records, without=("cubic_spring",))
    found = diagnose(case)
    assert found.verdict.answer == "unknown" and not found.names
    assert found.latent.best_covariate == "displacement"
    centre, force, _ = found.latent.curves["displacement"]
    odd = np.polyfit(centre, force, 3)
    assert odd[0] > 0.0  # what the base lacks is a spring that hardens
    assert found.latent.r2["displacement"] > 10 * max(found.latent.r2["velocity"], found.latent.r2["time"])


@pytest.mark.slow
def test_a_forgotten_offset_of_the_sensor_hides_under_every_law(records, told_nothing):
    """Finding: a nuisance that is missing from the model comes back as false physics."""
    with_offset, _ = told_nothing
    blind = diagnose(case_of(records, offset=0.0))
    _, left = reserved_fits(with_offset, told_nothing[1].fit)
    without = case_of(records, offset=0.0)
    _, hidden = reserved_fits(without, blind.fit)
    assert min(hidden) > 4.0 and max(left) < 1.0
    assert blind.verdict.grade != "A"
    assert any(s.family == "quadratic_spring" and s.gain > 50.0 for s in blind.verdict.scores)  # one-sided: false
    assert all(s.gain < 50.0 for s in told_nothing[1].verdict.scores if s.family == "quadratic_spring")


@pytest.mark.slow
def test_only_another_condition_tells_the_wrong_law(told_nothing):
    """Finding: |y|y looks well at the amplitude it was fitted to and fails beyond it; the cubic law does not."""
    case, found = told_nothing
    scores = {s.family: s for s in found.verdict.scores}
    ratios = {}
    for name in ("cubic_spring", "absolute_quadratic_spring"):
        _, (same, larger) = reserved_fits(case, scores[name].fit)
        ratios[name] = larger / same
    assert scores["absolute_quadratic_spring"].explained > 0.9
    assert ratios["cubic_spring"] < 1.4 and ratios["absolute_quadratic_spring"] > 2.0
