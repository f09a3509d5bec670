"""Number of simulations for derivatives of passages: no result is computed twice."""

import numpy as np
import pytest
from tests.unit.mismatch.intact_campaigns import intact_campaign

from turnout import physics
from turnout.mismatch.turnout import TrackCase, pseudo_forces, track_under_wheels
from turnout.mismatch.turnout.prediction import Predictor

N_SIMULATED = 5  # values of a passage without a closed form: wheels, load, pads, ballast, ballast damping


@pytest.fixture(scope="module")
def case():
    return TrackCase(intact_campaign((24.0,), 7))


@pytest.fixture
def simulated(monkeypatch):
    """Names of the passages that are simulated."""
    names, simulate = [], Predictor._simulate

    def counted(self, values, terms, aligned, *rest):
        names.append(aligned.name)
        return simulate(self, values, terms, aligned, *rest)

    monkeypatch.setattr(Predictor, "_simulate", counted)
    return names


def aligned_observations(case):
    return [o for o in case.observations if o.name in case.aligned_passages]


def start_values(case):
    return {n.name: case.start_values.get(n.name, n.mean) for n in case.nuisances}


def test_derivatives_of_passages_simulate_once_by_each_value_without_a_closed_form(case, simulated):
    """By wheels, load, stiffness of pads and of ballast, ballast damping. The motion at supports is that of the
    prediction, for any number of passages in between."""
    values, passages = start_values(case), aligned_observations(case)
    predicted = case.predict(values, (), passages)
    simulated.clear()
    case.nuisance_jacobian(values, (), passages, predicted)
    assert sorted(simulated) == sorted([o.name for o in passages] * N_SIMULATED)


def test_derivatives_by_an_effect_leave_the_motion_at_its_supports_in_the_cache(case, simulated):
    values, passages = start_values(case), aligned_observations(case)
    before, after = (physics.LocalBallast(39, share) for share in (0.5, 0.51))
    predicted = case.predict(values, (before,), passages)
    for _ in range(3):
        case.predict_near(values, (before,), (after,), passages, predicted)
    simulated.clear()
    case.nuisance_jacobian(values, (before,), passages, predicted)
    assert sorted(simulated) == sorted([o.name for o in passages] * N_SIMULATED)


def test_passages_on_one_track_share_its_responses_and_on_another_do_not(case, monkeypatch):
    """The same column as without stored results; a changed pad needs new responses, a changed speed does not."""
    solved, responses = [], track_under_wheels.responses

    def counted(*arguments, **options):
        solved.append(1)
        return responses(*arguments, **options)

    for module in (track_under_wheels, pseudo_forces):
        monkeypatch.setattr(module, "responses", counted)
    values, passages = start_values(case), aligned_observations(case)
    predicted = case.predict(values, (), passages)
    case.predictor.differences.clear()
    shared = case.nuisance_jacobian(values, (), passages, predicted)
    n_shared = len(solved)
    assert n_shared <= 3  # waves, forces at supports, static deflection
    speed = f"speed@{passages[0].name}"
    case.nuisance_jacobian({**values, speed: values[speed] + 1e-3}, (), passages, predicted)
    assert len(solved) == n_shared
    stiff = {**values, "pad_40": values["pad_40"] + 0.3}
    case.nuisance_jacobian(stiff, (), passages, case.predict(stiff, (), passages))
    assert len(solved) > n_shared
    monkeypatch.setattr(Predictor, "track_transfer", lambda self, key, compute: compute())
    case.predictor.differences.clear()
    for a, b in zip(shared, case.nuisance_jacobian(values, (), passages, predicted)):
        assert np.array_equal(a, b)
