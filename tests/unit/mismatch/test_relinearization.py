"""Visits whose fits end in another minimum than earlier ones agree after a new linearization, unless changed."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import optimize, stats

from turnout.mismatch.calibrated import GroupInformation, StateParameter, VisitInformation
from turnout.mismatch.calibrated.belief import Belief
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.relinearization import NormalPrior, fit_all_recordings, fit_given_belief
from turnout.stages import agreeing_visits as agreeing
from turnout.stages.agreeing_visits import FittedGroup, KeyedFits, agreeing_visits

ERROR = 0.1
SHARED = {name: StateParameter(name, 0.0, 2.0, group="surface") for name in ("length", "depth")}


class Valleys(Case):
    """A train measures the square of a length, twelve times, and the sum of depth, length, and a number of this
    train."""

    nuisances = (
        Nuisance("length", "-", 0.0, 2.0),
        Nuisance("depth", "-", 0.0, 2.0),
        Nuisance("load", "-", 0.0, 0.05, owner="train"),
    )

    def __init__(self, length, depth, load=0.02, seed=0):
        noise = ERROR * np.random.default_rng(seed).standard_normal(24)
        exact = self.predict({"length": length, "depth": depth, "load": load}, (), ())[0]
        self.observations = (Observation("train", "train", exact + noise, ERROR),)

    def predict(self, values, terms, observations):
        length, depth, load = (values[n] for n in ("length", "depth", "load"))
        return [np.repeat([length**2, depth + 0.3 * length**2 + load], 12)]


def belief_of(length, depth, sd=0.05):
    return Belief(("depth", "length"), np.array([depth, length]), sd**2 * np.array([[1.0, 0.4], [0.4, 1.0]]))


def cost(case, prior, x):
    values = dict(zip(("length", "depth", "load"), x))
    return float(np.sum(((case.observations[0].data - case.predict(values, (), ())[0]) / ERROR) ** 2)) + prior.cost(x)


def fit_from(case, start):
    return fit_jointly(case, values={"length": start, "depth": 0.0})


def test_steps_end_at_the_maximum_of_a_normal_prior_and_the_data():
    """Against a general optimizer, with a correlated prior and a deviation of the depth of this visit alone."""
    case = Valleys(1.1, 0.4)
    with_own = SHARED | {"depth": replace(SHARED["depth"], visit_sd=0.02)}
    prior = NormalPrior.of_belief(case, with_own, belief_of(0.9, 0.5))
    assert prior.mean == pytest.approx([0.9, 0.5, 0.0])
    assert np.linalg.inv(prior.precision)[:2, :2] == pytest.approx(
        np.array([[0.05**2, 0.4 * 0.05**2], [0.4 * 0.05**2, 0.05**2 + 0.02**2]])
    )
    fit, reached = fit_all_recordings(case, fit_from(case, 1.0), prior, {"length": 0.9, "depth": 0.5, "load": 0.0})
    best = optimize.minimize(lambda x: cost(case, prior, x), prior.mean, method="Nelder-Mead", options={"xatol": 1e-7})
    assert [fit.values[n.name] for n in case.nuisances] == pytest.approx(best.x, abs=2e-3)
    assert reached == pytest.approx(best.fun, abs=0.05)


def test_steps_that_cost_more_are_damped():
    """From a length near 0 the undamped step leads to a length of 10 and more."""
    case = Valleys(1.0, 0.5)
    prior = NormalPrior.of_file(case)
    fit, _ = fit_all_recordings(case, fit_from(case, 1.0), prior, {"length": 0.05, "depth": 0.5, "load": 0.0})
    assert fit.values["length"] == pytest.approx(1.0, abs=0.1)


def test_the_excess_of_an_unchanged_visit_is_chi_squared_with_the_directions_that_the_data_inform():
    """Both minima are equally probable alone. Two directions: 200 visits have a mean of 2 ± 0.14, 95 % below 6.0."""
    excess = []
    rng = np.random.default_rng(1)
    for seed in range(200):
        belief = belief_of(1.0, 0.5)
        depth, length = rng.multivariate_normal(belief.mean, belief.covariance)
        case = Valleys(length, depth, 0.05 * rng.standard_normal(), seed)
        fit = fit_from(case, -1.0)
        assert fit.values["length"] < 0.0
        given = fit_given_belief(case, replace(fit, scale={"response": 1.0}), SHARED, belief)
        assert given.fit.values["length"] > 0.0 and given.linear_excess > 100.0
        excess.append(given.excess)
    assert np.mean(excess) == pytest.approx(2.0, abs=0.5)
    assert np.mean(np.array(excess) < stats.chi2.ppf(0.95, 2)) > 0.9


def visit_of(day, case, fit, sections="S1", route="main", recordings="train, 100 km/h"):
    """Information on the shared parameters; the number of the train is integrated out, as for real visits."""
    rows = np.asarray(fit.jacobian[0], dtype=float)
    full, at = rows.T @ rows, np.array([fit.values[n.name] for n in case.nuisances])
    vector = rows.T @ (fit.white[0] + rows @ at)
    weight = full[:2, 2] / (full[2, 2] + 0.05**-2)
    matrix, vector = full[:2, :2] - np.outer(weight, full[2, :2]), vector[:2] - weight * vector[2]
    group = GroupInformation(f"{sections}: {recordings}", 1, ("length", "depth"), matrix, vector)
    return VisitInformation(day, float(day[:4]), (group,))


@pytest.fixture
def history(monkeypatch):
    """Visits from lengths and the minima in which their fits end -> (visits, call of ``agreeing_visits``)."""

    def of(lengths, valleys, store=None, recordings="train, 100 km/h"):
        linearize = partial(visit_of, recordings=recordings)
        monkeypatch.setattr(agreeing, "visit_groups", lambda *given: linearize("2000", *given).groups)
        cases = {f"{2020 + k}-01-01": Valleys(length, 0.5, seed=k) for k, length in enumerate(lengths)}
        fits = {day: fit_from(case, valley) for (day, case), valley in zip(cases.items(), valleys)}
        visits = [linearize(day, cases[day], fits[day]) for day in cases]
        calls = []

        def fitted_groups(day):
            calls.append(day)
            return [FittedGroup(cases[day], fits[day].without_jacobian(), SHARED, "S1", "main")]

        parameters = [replace(p, walk_sd=0.01) for p in SHARED.values()]
        result = agreeing_visits(parameters, visits, (), fitted_groups, {} if store is None else store, 12.0)
        return SimpleNamespace(before=visits, after=result, asked=calls)

    return of


@pytest.mark.parametrize("recordings", ["train, 100 km/h", "impacts at 18.00 m"])
def test_a_visit_in_the_other_minimum_agrees_if_linearized_at_the_earlier_values(history, recordings):
    """Hammer tests alone are no exception: their shear stiffness of the rail can have two minima."""
    result = history([1.0, 1.0, 1.0], [1.0, -1.0, 1.0], recordings=recordings)
    assert result.asked == ["2021-01-01"]
    assert [a is b for a, b in zip(result.before, result.after)] == [True, False, True]
    matrix, vector = result.after[1].total(("length", "depth"))
    assert np.linalg.solve(matrix, vector) == pytest.approx([1.0, 0.5], abs=0.1)


@pytest.mark.parametrize("valley", [1.0, -1.0])
def test_a_change_stays_and_ends_the_new_linearizations(history, valley):
    """A length of 1.6 after 1.0: no fit from the earlier values explains it, whichever minimum its own fit is in."""
    result = history([1.0, 1.0, 1.6, 1.6], [1.0, 1.0, valley, -1.0])
    assert result.asked == ["2022-01-01"]
    assert all(a is b for a, b in zip(result.before, result.after))


def test_a_linear_model_has_the_excess_that_its_derivatives_predict(monkeypatch):
    """Length, depth + load and load measured eight times: against the optimum of the three, by linear algebra."""
    rows = np.repeat([[1.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]], 8, axis=0)
    monkeypatch.setattr(Valleys, "predict", lambda self, v, *a: [rows @ [v["length"], v["depth"], v["load"]]])
    case, belief = Valleys(1.3, 0.2, load=0.12), belief_of(1.0, 0.5)
    fit = replace(fit_from(case, 1.0), scale={"response": 1.0})
    given = fit_given_belief(case, fit, SHARED, belief)
    prior, y = NormalPrior.of_belief(case, SHARED, belief), case.observations[0].data

    def least(mean, precision):
        x = np.linalg.solve(rows.T @ rows / ERROR**2 + precision, rows.T @ y / ERROR**2 + precision @ mean)
        return x, float(np.sum(((y - rows @ x) / ERROR) ** 2))

    x, of_data = least(prior.mean, prior.precision)
    alone, of_data_alone = least(np.zeros(3), np.diag([0.25, 0.25, 400.0]))
    own = 400.0 * alone[2] ** 2  # of the train's number, which belongs to the data
    assert own > 1.0
    expected = of_data + prior.cost(x) - of_data_alone - own
    assert given.fit.scale == {"response": 1.0}
    assert (given.excess, given.linear_excess) == pytest.approx((expected, expected), abs=0.01)


def test_a_change_without_a_derivative_at_the_earlier_values_keeps_its_excess(monkeypatch):
    """A signal that rises from -1 to 1 about a length of 1.3: at 1.0 its derivative is 0, and a fit does not move."""

    def predict(self, values, terms, observations):
        return [np.repeat([np.tanh((values["length"] - 1.3) / 0.02), values["depth"] + values["load"]], 12)]

    monkeypatch.setattr(Valleys, "predict", predict)
    case = Valleys(1.31, 0.5)
    given = fit_given_belief(case, fit_from(case, 1.31), SHARED, belief_of(1.0, 0.5))
    assert given.fit.values["length"] == pytest.approx(1.0, abs=0.05)
    assert given.excess > 12 * ((1.0 + np.tanh(0.5)) / ERROR) ** 2 * 0.9


def test_a_fit_that_agrees_but_has_a_much_larger_residual_does_not_count(history, monkeypatch):
    monkeypatch.setattr(agreeing, "fit_given_belief", lambda *a: replace(fit_given_belief(*a), excess=30.0))
    result = history([1.0, 1.0], [1.0, -1.0])
    assert result.asked == ["2021-01-01"]
    assert all(a is b for a, b in zip(result.before, result.after))


@pytest.mark.parametrize(("overstated", "stays"), [(23.9, True), (24.1, False)])
def test_a_visit_is_not_linearized_again_if_its_linear_model_errs_by_less_than_a_threshold(
    history, monkeypatch, overstated, stays
):
    def given(*a):
        found = fit_given_belief(*a)
        return replace(found, linear_excess=found.excess + overstated)

    monkeypatch.setattr(agreeing, "fit_given_belief", given)
    result = history([1.0, 1.0], [1.0, -1.0])
    assert result.asked == ["2021-01-01"] and (result.after[1] is result.before[1]) is stays


def test_stored_linearizations_are_used_until_earlier_visits_or_the_code_change(history, tmp_path):
    versions = {f"{2020 + k}-01-01": {"code": "a"} for k in range(3)}
    store = KeyedFits(tmp_path, versions)
    first = history([1.0, 1.0, 1.0], [1.0, -1.0, 1.0], store)
    again = history([1.0, 1.0, 1.0], [1.0, -1.0, 1.0], KeyedFits(tmp_path, versions))
    assert (first.asked, again.asked) == (["2021-01-01"], [])
    for a, b in zip(first.after, again.after):
        assert all(np.array_equal(x.matrix, y.matrix) for x, y in zip(a.groups, b.groups))
    assert history([1.02, 1.0, 1.0], [1.0, -1.0, 1.0], KeyedFits(tmp_path, versions)).asked == ["2021-01-01"]
    other_code = {day: {"code": "b"} for day in versions}
    assert history([1.0, 1.0, 1.0], [1.0, -1.0, 1.0], KeyedFits(tmp_path, other_code)).asked == ["2021-01-01"]
