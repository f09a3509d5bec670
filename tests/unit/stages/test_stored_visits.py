"""Stored files of visits: only those that are no longer needed are removed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.mismatch.calibrated import GroupInformation, StateParameter
from turnout.mismatch.turnout import TrackCase
from turnout.stages import stored_visits, visit_fits
from turnout.stages.combined_visits import complete_visits, parameters_of, visits_of
from turnout.stages.stored_visits import StoredVisit, read_visits
from turnout.stages.visit_files import remove_other_visits
from turnout.stages.visit_fits import VisitFits


def test_only_files_of_other_visits_of_the_same_turnout_are_removed(tmp_path):
    digests = "0123456789ab", "ba9876543210"  # of two groups of sections
    for turnout in ("T1", "T10"):
        (tmp_path / turnout).mkdir()
        for visit in ("2026-01-05", "2026-01-05-2", "2026-02-05"):
            for digest in digests:
                (tmp_path / turnout / f"{visit}-{digest}.npz").touch()
    (tmp_path / "T1" / "notes.txt").touch()
    remove_other_visits(tmp_path, "T1", {"2026-01-05": [], "2026-03-05": []})
    left = {path.name for path in (tmp_path / "T1").iterdir()}
    assert left == {*(f"2026-01-05-{digest}.npz" for digest in digests), "notes.txt"}
    assert len(list((tmp_path / "T10").iterdir())) == 6


def test_a_folder_that_does_not_exist_yet_is_no_error(tmp_path):
    remove_other_visits(tmp_path, "T1", ())
    assert not (tmp_path / "T1").exists()


@pytest.mark.parametrize(
    ("parameter", "expected"), [(f"{stored_visits.NOSE_POSITION} at 7.37 m", True), ("rail", False)]
)
def test_a_visit_is_fitted_again_with_all_trains_if_the_file_has_a_nose(monkeypatch, tmp_path, parameter, expected):
    """The second fit is stored. The tests of worn noses test the fits themselves; here, fits are only names."""
    case, parameters = object.__new__(TrackCase), {"n": StateParameter(parameter, 0.0, 0.1, 0.0, "surface")}
    first, again = (SimpleNamespace(name=name) for name in ("first", "again"))
    first.without_jacobian, again.without_jacobian = lambda: first, lambda: again
    written = {}
    replaced = {
        "fit_base": lambda search, values: (SimpleNamespace(case=case), first),
        "calibrated_parameters": lambda *_: parameters,
        "fit_from_nose_positions": lambda search, fit, positions: fit,
        "fit_large_values": lambda search, fit, *_: fit,
        "one_of_each_group": lambda case: (),
        "with_reserved_passages": lambda case, fit, *_: (case, fit),
        "_fit_again": lambda *_: again,
        "visit_groups": lambda case, fit, *_: fit.name,
        "channel_levels": lambda case, fit: {"channel A1 in the passages": 0.5},
        "packed_groups": lambda groups: groups,
        "write_value": lambda path, value: written.update(value),
    }
    for name, function in replaced.items():
        monkeypatch.setattr(stored_visits, name, function)
    monkeypatch.setattr(stored_visits.Search, "of", lambda *_: None)
    turnout = SimpleNamespace(id="t1", settings={"mismatch": None})
    description = {"turnout": turnout, "visit": "2026-01-01", "version": {}}
    group = SimpleNamespace(labels=("A",), route="main", neighbours=("A",))
    stored = stored_visits.store_visit(tmp_path, group, case, "", description)
    assert written["groups"] == stored.fit.name == ("again" if expected else "first")
    assert written["levels"] == {"channel A1 in the passages": 0.5}


def of_one_visit(visit, *parameters):
    return StoredVisit(visit, "A", "", (GroupInformation(visit, 1, ("pad",), np.eye(1), np.zeros(1)),), parameters)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_support_is_an_outer_one_only_at_visits_where_it_is(order):
    """In whatever order: a first visit with fewer sensors does not hide later changes, and later ones add no false."""
    inner = StateParameter("pad", 0.0, 0.1, 0.02, "pad", 30, 18.0)
    outer = replace(inner, may_change=False, is_beyond_sensors=True, visit_sd=0.5)
    other = StateParameter("gain_A", 0.0, 0.02)
    roles = [outer, inner]
    stored = [of_one_visit(f"2026-0{k + 1}-01", roles[role], other) for k, role in enumerate(order)]
    assert parameters_of(stored) == (inner, other)
    assert [v.own_sds["pad"] for v in visits_of(stored)] == [roles[role].visit_sd for role in order]
    assert parameters_of(stored[:1]) == (roles[order[0]], other)


def test_a_visit_is_complete_with_all_of_its_groups():
    """A diagnosis that is ended before its last group leaves the others to the calibrated model."""
    every = {"every_group": ("A, B", "C"), "levels": {}}
    stored = {
        name: StoredVisit("2026-01-01", name, "", (), (), (), fitted, neighbours=name, **every)
        for name, fitted in (("A, B", True), ("C", True))
    }
    unfitted = replace(stored["C"], fitted=False)
    assert complete_visits(stored.values()) == {"2026-01-01"}
    assert complete_visits([stored["A, B"]]) == complete_visits([stored["A, B"], unfitted]) == set()
    assert visits_of(stored.values()) == []  # without information there is no visit


def test_a_visit_with_an_open_finding_keeps_it_if_it_cannot_be_fitted(monkeypatch, tmp_path):
    """`turnout twin` lists it among the visits that it does not use."""
    group = SimpleNamespace(labels=("A",), route="main", neighbours=("A", "B"), campaign=None)
    replaced = {
        "track_of": lambda *_: (None, ()), "mismatch_context": lambda *_, **__: ("", {}),
        "gather_inputs": lambda *_: SimpleNamespace(notes=[]), "neighbours_of": lambda *_: [("main", ("A", "B"))],
        "groups": lambda *_: [group],
    }  # fmt: skip
    for name, function in replaced.items():
        monkeypatch.setattr(visit_fits, name, function)

    def no_case(*_, **__):
        raise SimulationError("the wheel leaves the track")

    monkeypatch.setattr(visit_fits, "TrackCase", no_case)
    turnout, version = SimpleNamespace(id="t1", settings={"mismatch": None}), {"code": "1"}
    answers = {("2026-01-01", "A, B"): "named"}
    paths = {"raw_root": "", "work": "", "track": None}
    fits = VisitFits(
        turnout, tmp_path, {"2026-01-01": ()}, {"2026-01-01": version}, answers, **paths, without=(), notes=[]
    )
    fits.fit_all(["2026-01-01"])
    (stored,) = read_visits(tmp_path, "t1", {"2026-01-01": version})
    assert (stored.answer, stored.groups, stored.neighbours) == ("named", (), "A, B")
    assert [words for _, words, _ in stored.notes] == ["sections A: the wheel leaves the track"]


def test_a_fit_begins_at_the_means_of_a_belief_by_the_names_of_the_turnout(monkeypatch):
    """The belief also has parameters of other sections; a parameter that it does not know begins as in the file."""
    case, begun = object.__new__(TrackCase), []
    parameters = {n: StateParameter(name, 0.0, 0.1, 0.0, "surface") for n, name in (("a", "pad 3"), ("b", "gain A1"))}
    first = SimpleNamespace(name="first")

    def fit_base(search, values):
        begun.append(values)
        return SimpleNamespace(case=case), first

    replaced = {
        "fit_base": fit_base,
        "calibrated_parameters": lambda *_: parameters,
        "fit_from_nose_positions": lambda search, fit, positions: SimpleNamespace(name="moved"),
        "fit_large_values": lambda search, fit, *_: fit,
        "one_of_each_group": lambda case: (),
        "with_reserved_passages": lambda case, fit, *_: (case, fit),
    }
    for name, function in replaced.items():
        monkeypatch.setattr(stored_visits, name, function)
    monkeypatch.setattr(stored_visits.Search, "of", lambda *_: None)
    group = SimpleNamespace(labels=("A",), route="main", neighbours=("A",))
    belief = SimpleNamespace(names=("gain B7", "pad 3"), mean=np.array([0.7, 0.3]))
    fits = [stored_visits.fit_group(group, case, None, start=start).fit for start in (None, belief)]
    assert begun == [{}, {"a": 0.3}]
    assert [fit.name for fit in fits] == ["moved", "first"]
