"""Generic effects of single components (another value under trains, an unusual value) and names that they refute."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.candidate_search import changed_parts, shortlist
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.component_evidence import (
    evidence_by_position,
    evidence_of_any_component,
    local_changes,
    local_deviations,
)
from turnout.mismatch.engine.component_spread import spread_of_others
from turnout.mismatch.engine.diagnose import diagnose, grade_names
from turnout.mismatch.engine.findings import Findings
from turnout.mismatch.engine.localization import locate
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.engine.residual_space import ResidualSpace
from turnout.mismatch.engine.score import Score
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.engine.verdict import Verdict
from turnout.physics import Parameter

N_SUPPORT, SD, NOISE = 8, 0.1, 0.5
SIZE = (Parameter("size", "-", 0.0, (-9.0, 9.0), "of all supports", "made up 2026"),)


class Supports(Case):
    """Impacts and trains on eight supports, stiffer by ``deviations``; under a train also stiffer by ``changes``.

    The candidate is a change of all of them under trains: at no position, or at one.
    """

    def __init__(self, changes, where=(), deviations=0.0):
        rng = np.random.default_rng(4)
        self.nuisances = tuple(
            Nuisance(f"support_{j}", "-", 0.0, SD, group="support", index=j, at=("place", 0.6 * j))
            for j in range(N_SUPPORT)
        )
        self.jacobian = {name: 3.0 * rng.normal(size=(60, N_SUPPORT)) for name in ("hammer", "train")}
        self.candidates = (Candidate.of("preload", SIZE, dict, ((0.5,),), dict(where)),)
        self.truth = truth = SD * rng.normal(size=N_SUPPORT) + deviations
        data = {
            name: j @ (truth + (name == "train") * np.array(changes)) + NOISE * rng.normal(size=60)
            for name, j in self.jacobian.items()
        }
        self.observations = tuple(Observation(name, name, y, NOISE, data_type=name) for name, y in data.items())

    def is_hammer_test(self, observation):
        return observation.name == "hammer"

    def predict(self, values, terms, observations):
        under_trains = np.zeros(N_SUPPORT)
        for term in terms:
            under_trains[term.get("support", slice(None))] += term["size"]
        supports = np.array(list(values.values()))
        return [self.jacobian[o.name] @ (supports + under_trains * (o.name == "train")) for o in observations]


def in_one(change):
    return [change * (j == 2) for j in range(N_SUPPORT)]


def with_values(values, error=0.01, groups=("support",) * N_SUPPORT):
    """A case and a fit that has these values, with one standard error for all."""
    case = Supports(in_one(0.0))
    case.nuisances = tuple(replace(n, group=group) for n, group in zip(case.nuisances, groups))
    names = [n.name for n in case.nuisances]
    return case, SimpleNamespace(values=dict(zip(names, values)), covariance=error**2 * np.eye(N_SUPPORT))


@pytest.mark.parametrize("changes", [in_one(0.0), in_one(0.4), [0.2] * N_SUPPORT])
def test_the_evidence_is_that_of_dense_covariances(changes):
    """Mean over supports of N(0, S + (3 sd)² c cᵀ) / N(0, S), S of noise and values, c response of trains to a
    support."""
    case = Supports(changes)
    fit = fit_jointly(case)
    j, y = np.concatenate(list(case.jacobian.values())), np.concatenate([o.data for o in case.observations])
    noise = np.repeat([NOISE**2 * fit.scale[o.data_type] / o.effective for o in case.observations], 60)
    covariance = np.diag(noise) + SD**2 * j @ j.T
    trains = j * (np.arange(120) >= 60)[:, None] * THRESHOLDS.max_ordinary_spreads * SD
    gains = [
        multivariate_normal.logpdf(y, cov=covariance + np.outer(c, c)) - multivariate_normal.logpdf(y, cov=covariance)
        for c in trains.T
    ]
    expected = np.logaddexp.reduce(gains) - np.log(N_SUPPORT)
    assert evidence_of_any_component(local_changes(case, fit)) == pytest.approx(expected, rel=1e-6, abs=1e-6)


def test_impacts_or_trains_alone_show_no_difference():
    case = Supports(in_one(0.4))
    for name in ("hammer", "train"):
        case.observations = tuple(o for o in Supports(in_one(0.4)).observations if o.name == name)
        assert evidence_of_any_component(local_changes(case, fit_jointly(case))) == 0.0


def test_components_with_different_responses_have_no_position():
    case = Supports(in_one(0.4))
    case.nuisances = tuple(replace(n, index=None) for n in case.nuisances)
    assert evidence_of_any_component(local_changes(case, fit_jointly(case))) == 0.0


@pytest.mark.parametrize(
    "at_one, where, answer", [(0.0, {}, "named"), (0.35, {}, "unknown"), (0.35, {"place": 3.0}, "named")]
)
def test_an_effect_of_the_whole_track_has_no_name_if_a_change_of_one_support_remains(at_one, where, answer):
    """Stiffer supports everywhere explain most of it. A name at a position may leave an error of its shape."""
    verdict = diagnose(Supports([0.5 + at_one * (j == 2) for j in range(N_SUPPORT)], where)).verdict
    assert verdict.answer == answer and ("local_change_remains" in verdict.trail) is (answer == "unknown")


@pytest.mark.parametrize("place, gain, answer", [(2, 50.0, "named"), (5, 50.0, "unknown"), (5, 1e4, "named")])
@pytest.mark.parametrize(
    "where, frame", [({"place": 3.0}, "place"), ({"sensor": "A1"}, "sensor"), ({"sensor": "A1"}, "clock")]
)
def test_beside_a_name_at_a_position_or_in_a_channel_its_errors_of_shape_count(where, frame, place, gain, answer):
    """One support is stiffer. The effect at ``place`` explains it or not; strong evidence may leave as much."""
    case = Supports([0.5 + 0.45 * (j == 2) for j in range(N_SUPPORT)])
    local = Candidate.of("local", SIZE, lambda values: values | {"support": place}, ((0.5,),), where, frame=frame)
    case.candidates = (*case.candidates, local)
    fit = fit_jointly(case, case.candidates, np.array([0.5, 0.1]))
    scores = (Score(c, g, 0.0, 1.0, fit) for c, g in zip(case.candidates, (50.0, gain)))
    verdicts = tuple(Verdict("named", (s.family,), "", 0.9, {s.family: 0.9, "unknown": 0.1}, (s,)) for s in scores)
    graded = grade_names(Findings(Search(case), fit_jointly(case), fit, verdicts)).verdicts
    assert graded[0].answer == answer and len(graded) == (2 if answer == "named" else 1)
    assert ("local_change_remains" in graded[0].trail) is (answer == "unknown")


class SupportWithGap(Supports):
    """A large case with an effect at the third support that a small size does not show, as columns see it."""

    is_large = True

    def __init__(self, changes):
        super().__init__(changes)
        parts = (("hardening", "ballast", 2), ("wear", "", 2), ("hardening", "ballast", 5))
        self.candidates = tuple(
            Candidate.of(name, SIZE, lambda v: {"size": 0.0}, ((0.5,),), {"place": 0.6 * j}, component=component)
            for name, component, j in parts
        )


@pytest.mark.parametrize("change, sought", [(0.0, []), (0.4, [1.2])])
def test_effects_of_a_component_that_changes_under_trains_are_fitted_without_a_promise(change, sought):
    """A large effect that the base fit imitates need not promise anything. Only effects of components are sought, and
    beside another effect the change may be an error of its shape."""
    case = SupportWithGap(in_one(change))
    search, fit = Search.of(case), fit_jointly(case)
    assert changed_parts(case, fit, search.settings) == {("ballast", place) for place in sought}
    tasks = shortlist(search, fit)
    assert [t.candidate.position for t in tasks] == sought and not any(t.rival for t in tasks)
    beside_another = fit_jointly(case, case.candidates[2:])
    assert not shortlist(search, beside_another)


@pytest.mark.parametrize("changes, answer", [([0.0] * N_SUPPORT, "none"), (in_one(0.25), "unknown")])
def test_a_difference_in_one_support_is_located_there_without_a_name(changes, answer):
    """The other supports absorb it: the residual is that of intact recordings, and no candidate explains it."""
    case = Supports(changes)
    case.candidates, case.control_level = (), {"hammer": 2.0, "train": 2.0}
    diagnosis = diagnose(case)
    assert diagnosis.verdict.answer == answer and max(diagnosis.base.level.values()) < 2.0
    assert ("component_differs_under_trains" in diagnosis.verdict.trail) is (answer == "unknown")
    if answer == "unknown":
        assert diagnosis.where.frame == "place" and diagnosis.where.place == pytest.approx(1.2)


def test_the_evidence_of_a_deviation_is_that_of_dense_covariances():
    """Mean over supports of N(0, S + (9 - 1) sd² c cᵀ) / N(0, S): three times the scatter instead of the scatter."""
    case = Supports(in_one(0.0), deviations=np.array(in_one(0.4)))
    fit = fit_jointly(case)
    j, y = np.concatenate(list(case.jacobian.values())), np.concatenate([o.data for o in case.observations])
    covariance = np.diag(np.repeat([NOISE**2 / o.effective for o in case.observations], 60))
    spreads = [max(SD, spread_of_others(case, fit, n, without_outliers=True)) for n in case.nuisances]
    covariance = covariance + j @ np.diag(np.square(spreads)) @ j.T
    wider = (THRESHOLDS.max_ordinary_spreads**2 - 1.0) ** 0.5 * j * spreads
    gains = [
        multivariate_normal.logpdf(y, cov=covariance + np.outer(c, c)) - multivariate_normal.logpdf(y, cov=covariance)
        for c in wider.T
    ]
    expected = np.logaddexp.reduce(gains) - np.log(N_SUPPORT)
    assert evidence_of_any_component(local_deviations(case, fit)) == pytest.approx(expected, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(
    "deviations, answer",
    [(in_one(0.0), "none"), (in_one(1.2), "unknown"), ([0.1, 0.4, 0.5, -0.4, 0.2, -0.5, 0.4, -0.4], "none")],
)
def test_an_unusual_component_is_located_without_a_name(deviations, answer):
    """The base model explains it by a possible value. If all supports scatter as widely, it is not unusual."""
    case = Supports(in_one(0.0), deviations=np.array(deviations))
    case.candidates, case.control_level = (), {"hammer": 2.0, "train": 2.0}
    diagnosis = diagnose(case)
    assert diagnosis.verdict.answer == answer and max(diagnosis.base.level.values()) < 2.0
    assert ("component_unlike_its_kind" in diagnosis.verdict.trail) is (answer == "unknown")
    if answer == "unknown":
        assert diagnosis.where.frame == "place" and diagnosis.where.place == pytest.approx(1.2)


class AlsoDisturbed(Supports):
    """A second train has a disturbance that forces at 3.6 to 4.2 m would explain, or the train itself."""

    def __init__(self, changes, deviations=0.0, level=("place", (3.6, 4.2)), force=1.0):
        super().__init__(changes, deviations=deviations)
        self.level = level
        self.basis = np.linalg.qr(np.random.default_rng(11).normal(size=(60, 6)))[0]
        noise = NOISE * np.random.default_rng(12).normal(size=60)
        data = noise + force * self.basis @ np.array([9.0, -7.0, 8.0, 6.0, -8.0, 7.0])
        self.jacobian["other"] = np.zeros((60, N_SUPPORT))
        self.observations += (Observation("other", "other", data, NOISE, data_type="other"),)
        self.control_level = dict.fromkeys(("hammer", "train", "other"), 1.0)

    def residual_spaces(self, fit):
        yield ResidualSpace(("other",), np.eye(60), {self.level: self.basis})


@pytest.mark.parametrize(
    "changes, deviations, place",
    [(0.0, 0.0, 3.9), (0.4, 0.0, 1.2), (0.0, 1.2, 1.2), (0.0, -1.2, 1.2), (0.1, 0.0, 3.9)],
)
def test_an_unusual_component_is_the_position_if_its_evidence_is_sufficient(changes, deviations, place):
    case = AlsoDisturbed(in_one(changes), np.array(in_one(deviations)))
    location = locate(case, fit_jointly(case))
    assert location.frame == "place" and location.place == pytest.approx(place)


@pytest.mark.parametrize("force, place", [(1.0, 1.2), (3.0, 1.2), (10.0, 3.9)])
def test_the_residual_of_a_strong_cause_in_other_components_is_no_position(force, place):
    """The change has 27 nats in all three. The force has 81, 150 and 765, and 12 with a twentieth of it are needed."""
    case = AlsoDisturbed(in_one(0.4), force=force)
    assert locate(case, fit_jointly(case)).place == pytest.approx(place)


def test_a_cause_in_a_train_is_not_located_at_an_unusual_component():
    """An effect of one train also changes values of supports."""
    case = AlsoDisturbed(in_one(0.4), level=("train", "railcar"))
    assert locate(case, fit_jointly(case)).train == "railcar"


def test_an_error_of_the_shape_of_an_effect_is_not_located_at_an_unusual_component():
    case = AlsoDisturbed(in_one(0.4))
    fit = fit_jointly(case, case.candidates, np.array([0.01]))
    assert locate(case, fit).place == pytest.approx(3.9)


@pytest.mark.parametrize("deviations", [[0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 0.0, 0.0, 0.0, -1.0]])
def test_two_unusual_components_do_not_mask_each_other(deviations):
    deviations = np.concatenate([deviations, np.zeros(N_SUPPORT - len(deviations))])
    case = Supports(in_one(0.0), deviations=deviations)
    gains = [nats for _, nats in local_deviations(case, fit_jointly(case))]
    assert set(np.argsort(gains)[-2:]) == set(np.flatnonzero(deviations)) and min(np.sort(gains)[-2:]) > 12.0


@pytest.mark.parametrize("error", [0.0, 0.3])
def test_the_spread_is_that_of_the_other_values_of_a_group_with_their_errors(error):
    """The spread of the component itself, and that of another group, do not count."""
    values = np.array([9.0, -0.2, -0.1, 0.1, 0.2, -0.2, 0.2, -0.1])
    case, fit = with_values(values, error)
    others = values[1:]
    assert spread_of_others(case, fit, case.nuisances[0]) == pytest.approx(np.hypot(others.std(), error))
    robust = np.median(np.abs(others - np.median(others))) / 0.6745
    assert spread_of_others(case, fit, case.nuisances[0], True) == pytest.approx(np.hypot(robust, error), rel=1e-4)
    case, fit = with_values(values, error, ("support",) * 7 + ("pad",))  # six others are similar
    assert spread_of_others(case, fit, case.nuisances[0]) == pytest.approx(np.hypot(values[1:7].std(), error))
    case, fit = with_values(values, error, ("support",) * 6 + ("pad",) * 2)  # five others give no spread
    assert spread_of_others(case, fit, case.nuisances[0]) is None


def test_a_component_within_the_prior_is_no_deviation_where_all_others_are_equal():
    case = Supports(in_one(0.0), deviations=-Supports(in_one(0.0)).truth + np.array(in_one(2.0 * SD)))
    fit = fit_jointly(case)
    assert spread_of_others(case, fit, case.nuisances[2], without_outliers=True) < 0.7 * SD
    assert evidence_of_any_component(local_deviations(case, fit)) < 1.0


def test_a_value_that_the_data_do_not_determine_is_no_deviation():
    case = Supports(in_one(0.0))
    for jacobian in case.jacobian.values():
        jacobian[:] = 0.0
    assert [nats for _, nats in local_deviations(case, fit_jointly(case))] == [0.0] * N_SUPPORT


def test_the_evidence_of_components_at_one_position_is_combined():
    case = Supports(in_one(0.35))
    case.nuisances = tuple(replace(n, at=("place", 0.6 * (n.index // 2))) for n in case.nuisances)
    fit = fit_jointly(case)
    changes = local_changes(case, fit)
    gains = {n.index: nats for n, nats in changes}
    first = evidence_by_position(changes)[0]
    assert (first.frame, first.level) == ("place", 0.6)
    assert first.nats == pytest.approx(np.logaddexp(gains[2], gains[3]) - np.log(N_SUPPORT))


class TwoVisits(Supports):
    """The same impacts with the same errors at a second visit, at the same position or at another."""

    def __init__(self, *positions):
        super().__init__(in_one(0.0), deviations=np.array(in_one(0.6)))
        (hammer,) = (o for o in self.observations if o.name == "hammer")
        self.conditions = dict(zip(("hammer", "hammer again"), positions))
        self.jacobian["hammer again"] = self.jacobian["hammer"]
        sigma = 8.0 * hammer.sigma  # so that further data would count
        self.observations = tuple(replace(hammer, name=n, condition=n, sigma=sigma) for n in self.conditions)

    def hammer_positions(self):
        return self.conditions


def test_repeated_impacts_at_one_position_add_no_evidence_of_a_deviation():
    """With twice the same data at one position the gain is that of one; the fit of other supports hardly differs."""
    gains = [
        dict((n.name, g) for n, g in local_deviations(case, fit_jointly(case)))["support_2"]
        for case in (TwoVisits(2.1), TwoVisits(2.1, 2.1), TwoVisits(2.1, 4.2))
    ]
    assert gains[0] > 1.0
    assert gains[1] == pytest.approx(gains[0], rel=0.05)
    assert gains[2] > 1.5 * gains[0]
