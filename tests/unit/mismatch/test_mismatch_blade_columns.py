"""Gaps of slide chairs and a loose heel in hammer tests: closed-form columns allow a search over all chairs."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.mismatch.blade_turnout import with_blade

from turnout.errors import SimulationError
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.turnout import TrackCase, screening
from turnout.mismatch.turnout.planned_case import measured_campaign, small_plan


@pytest.fixture(scope="module")
def case():
    plan = small_plan((15.0,), passages=False, hammer_positions=(24.0,))
    turnout = with_blade(plan.turnout)
    campaign = replace(measured_campaign(plan, (), 3), turnout=turnout)
    return TrackCase(campaign, families=("slide_chair_gap", "heel_support"))


def test_columns_in_hammer_tests_are_the_exact_change(case):
    hammer = case.hammer_case()
    fit = fit_jointly(hammer, iterations=0)
    columns = hammer.screen(fit)
    chairs = [c for c in hammer.candidates if c.family == "slide_chair_gap"]
    assert len(chairs) >= 3
    for candidate in hammer.candidates:
        for k, start in enumerate(candidate.starts):
            exact = hammer.predict(fit.values, (candidate.term(start),), hammer.observations)
            for column, new, old in zip(columns[candidate.key, k], exact, fit.predictions):
                size = np.max(np.abs(new - old))
                assert column == pytest.approx(new - old, abs=1e-4 * size + 1e-15), candidate.key


def test_every_chair_is_tried_on_hammer_tests(case):
    assert {c.refit.prescreen_group for c in case.candidates} == {"chair", "heel_support"}


@pytest.mark.parametrize("name", ["rail_bending", "rail_shear"])
def test_derivatives_by_the_rail_contain_the_closure_rail_behind_the_heel(case, name):
    """Against models on a rail 5 % stiffer and softer; without the closure rail the error is 26 to 31 %."""
    hammer = case.hammer_case()
    values = {n.name: 0.0 for n in hammer.nuisances}
    base = hammer.predict(values, (), hammer.observations)
    column = [n.name for n in hammer.nuisances].index(name)
    jacobian = hammer.nuisance_jacobian(values, (), hammer.observations, base)
    plus, minus = (hammer.predict({**values, name: by}, (), hammer.observations) for by in (0.05, -0.05))
    exact = np.concatenate([(a - b) / 0.1 for a, b in zip(plus, minus)])
    linear = np.concatenate([j[:, column] for j in jacobian])
    assert np.linalg.norm(linear - exact) < 5e-3 * np.linalg.norm(exact)


@pytest.mark.parametrize("name", ["chair_stiffness", "chair_damping"])
@pytest.mark.parametrize("effect", ["", "slide_chair_gap", "heel_support"])
def test_derivatives_by_the_chairs_follow_those_that_an_effect_leaves(case, name, effect):
    """Against central differences. A chair without contact does not follow."""
    hammer = case.hammer_case()
    candidates = [c for c in hammer.candidates if c.family == effect]
    terms = tuple(c.term(c.starts[-1]) for c in candidates[1:2] or candidates[:1])
    assert bool(terms) is bool(effect)
    values = {n.name: 0.0 for n in hammer.nuisances} | {name: 0.2}
    base = hammer.predict(values, terms, hammer.observations)
    column = [n.name for n in hammer.nuisances].index(name)
    jacobian = hammer.nuisance_jacobian(values, terms, hammer.observations, base)
    plus, minus = (hammer.predict({**values, name: 0.2 + by}, terms, hammer.observations) for by in (1e-3, -1e-3))
    exact = np.concatenate([(a - b) / 2e-3 for a, b in zip(plus, minus)])
    linear = np.concatenate([j[:, column] for j in jacobian])
    assert np.linalg.norm(exact) > 0.0
    assert np.linalg.norm(linear - exact) < 1e-3 * np.linalg.norm(exact)


def test_a_start_at_which_the_model_cannot_be_simulated_has_no_column(monkeypatch):
    """Such a start is not tried; all others keep their columns."""
    plan = small_plan((15.0,), passages=False, hammer_positions=(24.0,))
    hammer = TrackCase(measured_campaign(plan, (), 3), families=("rail_shear", "sensor_gain")).hammer_case()
    fit = fit_jointly(hammer, iterations=0)
    shear, gains = ([c for c in hammer.candidates if c.family == f] for f in ("rail_shear", "sensor_gain"))
    before = hammer.screen(fit)
    assert shear and gains and all((c.key, 0) in before for c in (*shear, *gains))

    def failing(*_):
        raise SimulationError("Newton's iteration did not converge at 0.1 s.")

    monkeypatch.setattr(screening, "_whole_track_changes", failing)
    columns = hammer.screen(fit)
    assert not any(key == c.key for key, _ in columns for c in shear)
    for c in gains:
        assert all(np.array_equal(a, b) for a, b in zip(columns[c.key, 0], before[c.key, 0], strict=True))
