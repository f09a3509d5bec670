"""A visit whose fit from the file ends at a wrong maximum counts as fitted from the values of the earlier visits."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.mismatch.calibrated import GroupInformation, StateParameter, VisitInformation
from turnout.mismatch.engine.case import Case
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.engine.observation import Observation
from turnout.stages import restarted_visits as restarted
from turnout.stages import visit_fits
from turnout.stages.agreeing_visits import FittedGroup, KeyedFits
from turnout.stages.restarted_visits import restarted_visits
from turnout.stages.visit_fits import VisitFits

ERROR = 0.1
FILE, OWN = 0.0, 1.0  # where fits begin: from 0 they end at the maximum of the cosine at 0.03 if the length is 1.3
PARAMETER = StateParameter("length", 0.0, 2.0, group="pad", walk_sd=0.01)


class Waves(Case):
    """A length is measured twelve times as cos 4L + L/2, which falls from 0 to 0.75, and rises from there to 1.6."""

    nuisances = (Nuisance("length", "-", 0.0, 2.0),)

    def __init__(self, length, seed):
        noise = 0.7 * ERROR * np.random.default_rng(seed).standard_normal(12)
        exact = self.predict({"length": length}, (), ())[0]
        self.observations = (Observation("train", "train", exact + noise, ERROR),)

    def predict(self, values, terms, observations):
        return [np.full(12, np.cos(4.0 * values["length"]) + 0.5 * values["length"])]


def information_of(case, fit, sections="S1", route="main"):
    rows = np.asarray(fit.jacobian[0], dtype=float)
    vector = rows.T @ (fit.white[0] + rows @ [fit.values["length"]])
    return (GroupInformation(f"{sections}: train, 100 km/h", 1, ("length",), rows.T @ rows, vector),)


@pytest.fixture
def history(monkeypatch):
    """Lengths of the visits and where the fits of each begin -> lengths by the information before and after."""
    monkeypatch.setattr(restarted, "visit_groups", information_of)
    monkeypatch.setattr(restarted, "channel_levels", lambda case, fit: {"train": float(np.mean(fit.white[0] ** 2))})

    def of(lengths, starts, fit_from=None, store=None, scale=None, unlike=()):
        cases = {f"{2020 + k}-01-01": Waves(length, k) for k, length in enumerate(lengths)}
        fits = {day: fit_jointly(c, values={"length": s}) for (day, c), s in zip(cases.items(), starts)}
        if scale:
            fits = {day: replace(fit, scale=dict.fromkeys(fit.scale, scale)) for day, fit in fits.items()}
        visits = [VisitInformation(day, float(day[:4]), information_of(cases[day], fits[day])) for day in cases]
        begun = {}

        def group(day, fit):
            return [FittedGroup(cases[day], fit, {"length": PARAMETER}, "S1", "main")]

        def from_belief(day, belief):
            begun[day] = belief.mean.item()
            return group(day, fit_jointly(cases[day], values={"length": begun[day]}))

        after, levels = restarted_visits(
            [PARAMETER], visits, (), lambda day: group(day, fits[day].without_jacobian()), fit_from or from_belief,
            {} if store is None else store, unlike,
        )  # fmt: skip
        means = [[(v.groups[0].vector / v.groups[0].matrix).item() for v in of_visits] for of_visits in (visits, after)]
        return SimpleNamespace(before=means[0], after=means[1], begun=begun, levels=levels)

    return of


def test_a_change_is_found_from_the_earlier_values_where_the_fit_from_the_file_misses_it(history):
    result = history([1.0, 1.0, 1.3], [OWN, OWN, FILE])
    assert abs(result.before[2]) < 0.5
    assert result.begun == {"2022-01-01": pytest.approx(1.0, abs=0.1)}
    assert result.after == [*result.before[:2], pytest.approx(1.3, abs=0.1)]


@pytest.mark.parametrize(("k", "begin"), [(0, 1.0), (1, 1.0), (3, 1.0)])
def test_a_visit_unlike_the_others_is_fitted_again_from_their_values_also_if_it_is_the_first(history, k, begin):
    """Its fit leaves no more than the noise of any turnout, but more than the others."""
    starts = [FILE if v == k else OWN for v in range(4)]
    lengths = [1.3 if v == k else 1.0 for v in range(4)]
    day = f"{2020 + k}-01-01"
    result = history(lengths, starts, scale=1.0, unlike=(day,))
    assert abs(result.before[k]) < 0.5 and result.begun[day] == pytest.approx(begin, abs=0.1)
    assert result.after[k] == pytest.approx(1.3, abs=0.1)
    assert result.levels[day, "S1"]["train"] < 2.0
    others = [v for v in range(4) if v != k]
    assert [result.after[v] for v in others] == pytest.approx([result.before[v] for v in others], abs=1e-3)


def test_a_visit_unlike_the_others_stays_where_its_fit_was_right(history):
    """A logger was wrong: from the values of the others the fit ends at the same maximum."""
    result = history([1.0, 1.0, 1.0], [OWN, OWN, OWN], unlike=("2021-01-01",))
    assert list(result.begun) == ["2021-01-01"]
    assert result.after == pytest.approx(result.before, abs=1e-4)  # a hundredth of the standard error


def test_later_visits_begin_where_all_corrected_ones_predict_them(history):
    result = history([1.0, 1.3, 1.3], [OWN, FILE, FILE])
    assert list(result.begun) == ["2021-01-01", "2022-01-01"] and result.begun["2022-01-01"] > 1.1
    assert result.after[1:] == pytest.approx([1.3, 1.3], abs=0.1)


def test_a_visit_that_agrees_is_not_fitted_again_and_one_that_differs_rightly_stays(history):
    """Both fits of the change to 1.3 end at the same maximum."""
    assert history([1.0, 1.0, 1.0], [OWN, OWN, OWN], scale=2.0).begun == {}
    changed = history([1.0, 1.0, 1.3], [OWN, OWN, OWN])
    assert list(changed.begun) == ["2022-01-01"] and changed.after == pytest.approx(changed.before, abs=1e-3)


def test_the_fit_with_more_evidence_counts(history):
    """The other fit is that from the file with a worse end."""

    def worse(day, belief):
        case = Waves(1.3, 2)
        fit = fit_jointly(case, values={"length": FILE})
        return [FittedGroup(case, replace(fit, evidence=fit.evidence - 1.0), {"length": PARAMETER}, "S1", "main")]

    result = history([1.0, 1.0, 1.3], [OWN, OWN, FILE], worse)
    assert result.after == result.before


def test_a_visit_that_cannot_be_fitted_again_stays(history):
    def failing(day, belief):
        raise SimulationError("the wheel leaves the track")

    result = history([1.0, 1.0, 1.3], [OWN, OWN, FILE], failing)
    assert result.after == result.before


def test_stored_fits_are_used_until_an_earlier_visit_changes(history, tmp_path):
    versions = {f"{2020 + k}-01-01": {"code": "a"} for k in range(3)}
    first, again, other = (
        history([length, 1.0, 1.3], [OWN, OWN, FILE], store=KeyedFits(tmp_path, versions))
        for length in (1.0, 1.0, 1.02)
    )
    assert list(first.begun) == list(other.begun) == ["2022-01-01"] and again.begun == {}
    assert again.after == first.after


def test_what_could_not_be_fitted_is_stated_once_and_not_for_a_second_fit_of_a_visit(monkeypatch):
    reasons = iter((["layout"], ["layout", "the wheel leaves the track"], ["the second fit ends in an error"]))
    monkeypatch.setattr(visit_fits, "_fit_visit", lambda *_: ([], next(reasons)))
    files = {"units": {"v": ()}, "versions": {"v": {}}, "answers": {}, "raw_root": "", "work": "", "track": None}
    fits = VisitFits(SimpleNamespace(id="t1"), Path(), **files, without=(), notes=[])
    fits.fit_all(["v"])
    fits.of_visit("v")
    fits.from_belief("v", SimpleNamespace())
    assert fits.notes == ["layout", "the wheel leaves the track"]
