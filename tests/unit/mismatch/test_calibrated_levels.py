"""Errors of the model that repeat at each visit: they cancel in a change and widen the comparison with the file."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.calibrated import (
    GroupInformation,
    StateParameter,
    VisitInformation,
    change_answer,
    change_candidates,
    deviations_from_file,
    estimate_history,
    track_sds,
)
from turnout.mismatch.calibrated.file_comparison import model_error, model_error_sds
from turnout.mismatch.calibrated.history import Event
from turnout.mismatch.calibrated.levels import error_levels
from turnout.mismatch.turnout.nose_starts import fit_from_nose_positions

SUPPORTS = tuple(StateParameter(f"ballast@{0.6 * k:.2f}", 0.0, 0.1, 0.0, "ballast", k, 0.6 * k) for k in range(9))
NAMES = tuple(p.name for p in SUPPORTS)
ROWS = np.array([0.5 ** abs(i - j) for i in range(9) for j in range(9)]).reshape(9, 9)


def visits_with(rng, repeated, n_visit=5, change=0.0, first=2, group="A: impacts at 1.20 m", sd=0.05):
    """Visits whose errors repeat with this share of their variance; one support changes."""
    x, same = rng.normal(0.0, 0.1, 9), np.sqrt(repeated) * sd * rng.normal(size=9)
    visits = []
    for v in range(n_visit):
        y = ROWS @ (x + change * (v >= first) * (np.arange(9) == 4)) + same
        y = y + np.sqrt(1.0 - repeated) * sd * rng.normal(size=9)
        information = GroupInformation(group, 1, NAMES, ROWS.T @ ROWS / sd**2, ROWS.T @ y / sd**2)
        visits.append(VisitInformation(f"v{v}", 0.5 * v, (information,)))
    return visits


@pytest.mark.parametrize("repeated", [0.0, 0.8])
def test_the_level_is_the_share_of_the_variance_that_does_not_repeat(repeated):
    """Mean of n = 200 turnouts with 4 later visits, of which the stated variance counts as a fifth."""
    rng = np.random.default_rng(5)
    found = [error_levels(SUPPORTS, visits_with(rng, repeated, sd=0.005))["A: impacts at 1.20 m"] for _ in range(200)]
    if repeated:
        assert np.mean(found) == pytest.approx((1.0 + 4 * (1.0 - repeated)) / 5, abs=0.02)
    else:
        assert 0.9 < np.mean(found) <= np.max(found) == 1.0  # never above 1, and close to it


def test_the_level_is_the_same_if_a_visit_has_less_information_than_the_file():
    """A visit has 1 to 5 % of the information of the file: a level of 1 if the first visit shows no constant error.

    Of n visits with the stated errors, the constant one has the variance 1 before. The mean of k visits leaves
    1 / (k + 1) of it, so that the next innovation has the variance 0.8 / (k + 1)^2 + 0.2 (1 + k / (k + 1)^2) of the
    1 + 1 / (k + 1) that is expected.
    """
    rng = np.random.default_rng(15)
    found = [error_levels(SUPPORTS, visits_with(rng, 0.8, sd=1.0))["A: impacts at 1.20 m"] for _ in range(200)]
    k = np.arange(1, 5)
    innovations = (0.8 / (k + 1) ** 2 + 0.2 * (1.0 + k / (k + 1) ** 2)) / (1.0 + 1.0 / (k + 1))
    assert np.mean(found) == pytest.approx((1.0 + innovations.sum()) / 5, abs=0.02)


def test_the_constant_error_is_that_of_a_joint_state_with_the_values():
    """Values x and error b of one state, of which each visit measures x + b: the same estimate of the sum, to 1e-9."""
    rng = np.random.default_rng(16)
    visits = visits_with(rng, 0.8, 3, sd=0.3)
    levels = {"A: impacts at 1.20 m": 0.2}
    history = estimate_history(
        SUPPORTS, visits, repeats_between_visits=False, accepted=None, levels=levels, constant_errors=True
    )
    n = len(SUPPORTS)
    stated = visits[0].groups[0].matrix
    covariance = np.zeros((2 * n, 2 * n))
    covariance[:n, :n], covariance[n:, n:] = 0.01 * np.eye(n), np.linalg.inv(stated)
    gradients = np.hstack([np.eye(n), np.eye(n)])
    precision, vector = np.linalg.inv(covariance), np.zeros(2 * n)
    for visit in visits:
        precision = precision + gradients.T @ (stated / 0.2) @ gradients
        vector = vector + gradients.T @ visit.groups[0].vector / 0.2
    posterior = np.linalg.inv(precision)
    assert history.belief.mean == pytest.approx(gradients @ posterior @ vector, abs=1e-9)
    assert history.belief.covariance == pytest.approx(gradients @ posterior @ gradients.T, abs=1e-9)


@pytest.mark.parametrize("repeated", [0.0, 0.5, 0.9])
def test_intact_turnouts_with_little_information_of_visits_have_no_changed_support(repeated):
    """The best candidate of n = 100 intact turnouts has less than 6 nats; a name needs 12 and a penalty."""
    rng = np.random.default_rng(17)
    answers = [
        change_answer(SUPPORTS, visits_with(rng, repeated, sd=0.5), [], change_candidates(SUPPORTS), 3.0, 6.0)
        for _ in range(100)
    ]
    assert not any(a.names for a in answers)


def test_a_group_that_first_appears_at_a_later_visit_has_its_full_error():
    rng = np.random.default_rng(6)
    visits = visits_with(rng, 0.8)
    other = visits_with(rng, 0.8, 3, group="A: impacts at 3.00 m")
    mixed = [*visits, *(VisitInformation(f"w{k}", 3.0 + k, v.groups) for k, v in enumerate(other))]
    assert set(error_levels(SUPPORTS, mixed)) == {"A: impacts at 1.20 m"}
    fast = visits_with(rng, 0.8, group="A: locomotive, 120 km/h")
    slow = visits_with(rng, 0.8, 1, group="A: locomotive, 110 km/h")
    assert set(error_levels(SUPPORTS, [*fast, VisitInformation("w", 4.0, slow[0].groups)])) == {
        "A: locomotive, 120 km/h", "A: locomotive, 110 km/h",
    }  # fmt: skip


def test_a_change_below_the_stated_errors_is_named_by_the_scatter_of_the_turnout():
    """The named share of n = 40 rises; of 100 intact turnouts none has a name."""
    candidates = change_candidates(SUPPORTS)

    def named(change, seed, n, repeated):
        rng = np.random.default_rng(seed)
        found = [
            change_answer(SUPPORTS, visits_with(rng, repeated, change=change, sd=0.12), [], candidates, 12.0, 6.0)
            for _ in range(n)
        ]
        assert all(a.position == 2.4 for a in found if a.names)
        return sum(a.verdict in ("named", "a_or_b") for a in found)

    assert named(-0.4, 7, 40, 0.0) < 15
    assert named(-0.4, 7, 40, 0.9) > 30
    assert named(0.0, 8, 100, 0.9) == 0


def test_a_change_does_not_raise_the_level_once_it_is_modelled():
    visits = visits_with(np.random.default_rng(9), 0.9, change=-1.2)
    raised = error_levels(SUPPORTS, visits)["A: impacts at 1.20 m"]
    explained = error_levels(SUPPORTS, visits, [Event(1.0, {NAMES[4]: 1.0})])["A: impacts at 1.20 m"]
    assert explained < 0.5 < raised


def test_an_error_of_the_model_is_no_difference_from_the_file():
    """Precise data of values with an error of 0.04 each: n = 300 tracks have the expected rate of deviations."""
    rng, error = np.random.default_rng(10), model_error(SUPPORTS)
    assert model_error_sds(SUPPORTS) == pytest.approx(0.04)
    counts = {False: 0, True: 0}
    for _ in range(300):
        y = rng.normal(0.0, 0.1, 9) + rng.normal(0.0, 0.04, 9)
        group = GroupInformation("A: impacts at 1.20 m", 1, NAMES, np.eye(9) / 0.01**2, y / 0.01**2)
        history = estimate_history(SUPPORTS, [VisitInformation("v0", 0.0, (group,))], [error], accepted=None)
        counts[True] += bool(deviations_from_file(history, SUPPORTS, {"ballast": 0.2}))
        # with the scatter of the file alone
        small = abs(history.belief.mean) > 3.0 * history.belief.sd
        counts[False] += bool(np.any(small & (abs(history.belief.mean) > 0.2)))
    assert counts[True] <= 3 < 100 < counts[False]


def test_a_difference_beyond_scatter_and_error_of_the_model_is_stated_with_both():
    y = np.zeros(9)
    y[4] = -0.9
    group = GroupInformation("A: impacts at 1.20 m", 1, NAMES, np.eye(9) / 0.01**2, y / 0.01**2)
    visit = VisitInformation("v0", 0.0, (group,))
    history = estimate_history(SUPPORTS, [visit], [model_error(SUPPORTS)], accepted=None)
    (found,) = deviations_from_file(history, SUPPORTS, {"ballast": 0.2})
    assert found.names == (NAMES[4],) and found.size == pytest.approx(-0.9, abs=0.02)
    assert found.sd == pytest.approx(np.hypot(0.04, 0.01), rel=0.02)
    assert found.ordinary_sd == pytest.approx(np.sqrt(0.1**2 + 0.04**2 - 0.01**2), rel=0.01)


class Valleys:
    """Search over a nose whose evidence has two maxima; a fit goes to the nearer one."""

    best, other = 0.15, 0.0
    case = SimpleNamespace(nuisances=(SimpleNamespace(name="surface_0_place", mean=0.0, sd=0.05),))

    def fit(self, terms, sizes, at):
        place = self.best if at.get("surface_0_place", 0.0) > 0.075 else self.other
        evidence = 0.0 if place == self.best else -400.0
        values = {"surface_0_place": place, "surface_0_depth": at.get("surface_0_depth", 0.0), "ballast": at["ballast"]}
        return SimpleNamespace(values=values, evidence=evidence, scale={"passage": 8.0})

    def converge(self, fit):
        return fit


def test_a_fit_with_a_large_residual_is_repeated_from_other_positions_of_the_nose():
    search, at = Valleys(), {"surface_0_place": 0.0, "surface_0_depth": -0.9, "ballast": 0.3}
    stuck = search.fit((), np.zeros(0), at)
    assert stuck.evidence == -400.0
    found = fit_from_nose_positions(search, stuck, ["surface_0_place"])
    assert found.evidence == 0.0 and found.values["ballast"] == 0.3 and found.values["surface_0_depth"] == 0.0
    assert fit_from_nose_positions(search, stuck, []) is stuck
    good = SimpleNamespace(**{**vars(stuck), "scale": {"passage": 1.0}})
    assert fit_from_nose_positions(search, good, ["surface_0_place"]) is good


def test_intervals_of_values_of_the_track_contain_the_true_values():
    """Without recordings those of the file; n = 2700 values of 300 tracks: 95 % of the intervals contain the value."""
    rng, error = np.random.default_rng(11), model_error(SUPPORTS)
    nothing = estimate_history(SUPPORTS, [], [error])
    assert track_sds(nothing.belief, SUPPORTS) == pytest.approx(0.1)
    inside = []
    for _ in range(300):
        x = rng.normal(0.0, 0.1, 9)
        y = x + rng.normal(0.0, 0.04, 9) + rng.normal(0.0, 0.02, 9)
        group = GroupInformation("A: impacts at 1.20 m", 1, NAMES, np.eye(9) / 0.02**2, y / 0.02**2)
        belief = estimate_history(SUPPORTS, [VisitInformation("v0", 0.0, (group,))], [error], accepted=None).belief
        inside += list(abs(belief.mean - x) < 1.96 * track_sds(belief, SUPPORTS))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.013)
