"""The diagnosis of an open alarm from hammer tests of all visits and the newest trains, or why there is none."""

import os
import shutil
import signal
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import small_turnout as small

from turnout import physics
from turnout.config import load_configuration, with_raw
from turnout.mismatch.calibrated import GroupInformation, ModelAnswer, StretchEnds
from turnout.records import Unit
from turnout.stages import change_diagnosis, change_units
from turnout.stages.change_diagnosis import change_unit
from turnout.stages.change_finding import finding_of_change
from turnout.stages.change_text import sentence_of
from turnout.stages.change_trains import TrainTest, evidence_of_rise
from turnout.stages.mismatch_groups import visits
from turnout.stages.stored_visits import StoredVisit
from turnout.stages.visit_time import years_of
from turnout.stages.worklist import worklist_job
from turnout.workflow.batches import read_results
from turnout.workflow.plan import PlannedUnit, write_plans
from turnout.workflow.scan import scan
from turnout.workflow.shard import run_shard
from turnout.workflow.state import batch_paths
from turnout.workflow.tasks import Stage

DAYS = ("2025-08-01", "2025-11-01", "2026-02-01", "2026-05-01")


FACTOR = 0.4


def soft_ballast(track, n=1, factor=FACTOR):
    """Ballast with a share of its stiffness under ``n`` sleepers; the middle sleeper is at section A."""
    first = track.nearest_support(small.SLEEPER) - n // 2
    return tuple(physics.LocalBallast(first + k, factor) for k in range(n))


def write_softened(folder, repository, terms):
    """Four hammer tests with soft ballast in the last two, and five trains at the last visit."""
    small.write_configuration(folder, repository)
    for k, day in enumerate(DAYS):
        at = datetime.fromisoformat(f"{day}T09:00")
        small.write_hammer_tests(folder, terms if k > 1 else None, day=at, seed=10 * k)
    small.write_passages(folder, terms, (80.0, 90.0, 100.0, 110.0, 120.0), at)
    return folder


@pytest.fixture(scope="module")
def year(tmp_path_factory, repository):
    return write_softened(tmp_path_factory.mktemp("softened"), repository, soft_ballast)


@pytest.fixture
def turnout(tmp_path, year, monkeypatch):
    shutil.copytree(year, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def unit_of_all(configured):
    files = tuple(sorted(f for u in scan(configured, Path("raw")).units for f in u.files))
    return Unit("t1", "change", "A+B", files, "")


def row_of(turnout):
    configured = with_raw(load_configuration("config").turnout("t1"), Path("raw"))
    (row,) = change_unit(unit_of_all(configured), configured, "raw", {}, "x")["change_findings"]
    return row


def test_soft_ballast_below_three_sleepers_is_diagnosed_with_onset_and_fit_of_held_out_trains(
    tmp_path, repository, monkeypatch
):
    write_softened(tmp_path, repository, partial(soft_ballast, n=3, factor=0.5))
    monkeypatch.chdir(tmp_path)
    row = row_of(tmp_path)
    assert (row["verdict"], row["term"], row["rival_term"]) == ("named", "local_ballast", None)
    assert row["first_m"] <= 18.0 <= row["last_m"] and abs(row["position_m"] - 18.0) <= 0.6
    assert row["component"] == "ballast" and not row["grows"]
    assert [f"{row[k]:%Y-%m-%d}" for k in ("onset_after_utc", "onset_by_utc")] == [DAYS[1], DAYS[2]]
    assert row["n_visits"] == 4 and row["n_recordings"] == 8 and row["n_held_out"] == 3
    assert row["fit_after_pct"] > row["fit_before_pct"] + 2.0 * row["fit_gain_se_pct"]
    assert "3 held-out trains" in row["sentence"] and "trains of 2026-05-01 name softer ballast" in row["sentence"]


def test_impacts_distinguish_one_soft_support_from_a_gap_by_its_damping_and_trains_do_not(turnout):
    row = row_of(turnout)
    assert (row["verdict"], row["term"], row["rival_term"]) == ("named", "local_ballast", None)
    assert row["position_m"] == 18.0 and "trains of 2026-05-01 agree with more than one effect" in row["sentence"]
    assert [f"{row[k]:%Y-%m-%d}" for k in ("onset_after_utc", "onset_by_utc")] == [DAYS[1], DAYS[2]]
    assert abs(row["change"] - np.log(FACTOR)) < 3.0 * row["change_se"] + 0.05  # linear in the logarithm
    assert row["fit_after_pct"] > row["fit_before_pct"] + 2.0 * row["fit_gain_se_pct"]


def test_without_trains_the_damping_distinguishes_soft_ballast_from_a_gap(turnout):
    shutil.rmtree("raw/t1/passages")
    row = row_of(turnout)
    assert (row["verdict"], row["term"], row["rival_term"]) == ("named", "local_ballast", None)
    assert "no train since then is recorded" in row["sentence"]


def test_without_a_track_file_or_a_simulation_the_answer_states_the_reason(turnout, monkeypatch):
    def fails(*_, **__):
        raise change_diagnosis.SimulationError("the matrix is singular")

    monkeypatch.setattr(change_diagnosis, "change_of", fails)
    row = row_of(turnout)
    assert row["verdict"] == "no_decision" and row["sentence"] == "no diagnosis: the matrix is singular"
    Path("config/tracks/small.yaml").unlink()
    row = row_of(turnout)
    assert row["verdict"] == "no_decision" and row["sentence"].startswith("no diagnosis: no track file")
    assert row["found_at_utc"] == datetime(2026, 5, 1, 23, 59)


def nightly_run():
    """Run the stage of open alarms in the current folder."""
    stage = Stage("change", change_unit, "v1", lambda turnout, settings: ("", {}), change_units.alarmed_groups)
    configuration = load_configuration("config")
    write_plans(configuration, Path("raw"), Path("work/plan"), 2)
    return run_shard(Path("work/plan"), Path("work/change/00of01.json"), stage, configuration, Path("raw"))


def test_a_visit_is_fitted_once_and_a_second_nightly_run_computes_nothing(turnout, monkeypatch):
    alarms = {"t1": ["B"]}
    monkeypatch.setattr(change_units, "open_alarms", lambda registry: alarms)
    monkeypatch.setattr(change_diagnosis, "trains_of_change", lambda *_: None)
    fitted = []
    store = change_diagnosis.store_visit
    monkeypatch.setattr(change_diagnosis, "store_visit", lambda *a, **k: (fitted.append(a[4]["visit"]), store(*a, **k)))
    assert nightly_run().processed == 1 and fitted == list(DAYS)
    assert nightly_run().processed == 0 and fitted == list(DAYS)
    small.write_hammer_tests(turnout, soft_ballast, day=datetime(2026, 6, 1, 9), seed=50)
    assert nightly_run().processed == 1 and fitted == [*DAYS, "2026-06-01"]
    alarms.clear()
    assert nightly_run().processed == 0


def test_a_killed_diagnosis_continues_after_the_last_visit_and_gives_the_same_result(year, tmp_path, monkeypatch):
    monkeypatch.setattr(change_units, "open_alarms", lambda registry: {"t1": ["B"]})
    monkeypatch.setattr(change_diagnosis, "trains_of_change", lambda *_: None)
    store, fitted, deadly = change_diagnosis.store_visit, tmp_path / "fitted", tmp_path / "deadly"

    def store_visit(*args, **more):
        store(*args, **more)
        with open(fitted, "a") as stream:  # a unit that was killed is computed in a separate process
            stream.write(f"{args[4]['visit']}\n")
        if deadly.exists() and args[4]["visit"] == DAYS[1]:
            os.kill(os.getpid(), signal.SIGKILL)

    monkeypatch.setattr(change_diagnosis, "store_visit", store_visit)
    rows = {}
    for name in ("killed", "calm"):
        shutil.copytree(year, tmp_path / name)
        monkeypatch.chdir(tmp_path / name)
        if name == "killed":
            deadly.touch()
            if (child := os.fork()) == 0:
                nightly_run()
                os._exit(0)
            assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
            assert not Path("work/change/00of01.json").exists() or not batch_paths([Path("work/change/00of01.json")])
            deadly.unlink()
        assert nightly_run().processed == 1 and nightly_run().processed == 0
        (batch,) = batch_paths([Path("work/change/00of01.json")])
        (result,) = read_results(batch)
        rows[name] = result.tables
    assert fitted.read_text().split() == [*DAYS, *DAYS]  # no visit is fitted twice
    assert rows["killed"] == rows["calm"] and len(rows["calm"]["change_findings"]) == 1


def test_trains_are_those_of_the_two_first_and_the_two_newest_visits_with_hammer_tests_and_trains():
    def at(kind, day):
        if kind == "passage":
            return PlannedUnit(Unit("t1", kind, f"{day.replace('-', '')}T090000Z.h5", (), "", None, None), "")
        return PlannedUnit(Unit("t1", kind, f"A/{day}", (), "", None, day), "")

    days = [f"2026-0{month}-01" for month in range(1, 8)]
    tests = [at("hammer", day) for day in days]
    trains = [at("passage", day) for day in days[1:]]  # no train at the first visit
    chosen = change_units._trains_of_first_and_newest_visits(tests, trains, [])
    assert [p.unit.label[:8] for p in chosen] == ["20260201", "20260301", "20260601", "20260701"]
    by_visit = visits((p.unit for p in (*tests, *trains)), [])
    wanted = change_diagnosis._first_and_newest_with_trains(by_visit)
    assert list(wanted) == [days[1], days[2], days[5], days[6]]
    assert change_diagnosis._first_and_newest_with_trains({day: by_visit[day] for day in days[:2]}) == {}
    assert [p.unit.label for p in change_units._trains_of_first_and_newest_visits([], trains, [])] == [
        trains[-1].unit.label
    ]


def test_the_sentence_states_the_number_of_visits_with_used_trains():
    def at(visit, *groups):
        information = tuple(GroupInformation(g, 1, (), np.zeros((0, 0)), np.zeros(0)) for g in groups)
        return StoredVisit(visit, "A", "", information, ())

    impacts, train = "A: impacts at 18.00 m", "A: locomotive, 120 km/h"
    stored = [
        at("2026-01-01", impacts),
        at("2026-02-01", impacts, train),
        at("2026-03-01", train),
        at("2026-03-01", train),
    ]
    assert change_diagnosis._count_with_trains(stored) == 2
    row = finding_of_change(answer(), None, 4, 8, 12.0, 2)
    assert "8 hammer tests of 4 visits, and the trains of 2 of them" in row["sentence"]
    assert "trains of" not in finding_of_change(answer(), None, 4, 8, 12.0)["sentence"].partition(";")[0]


@pytest.mark.parametrize(
    ("nats", "rise", "error", "expected"),
    [(2.0, 0.5, 0.25, 2.0), (5.0, 0.2, 0.2, 0.5), (2.0, -0.2, 0.2, 0.0), (-1.0, -0.2, 0.2, -1.0), (5.0, 0.1, 0.0, 0.5)],
)
def test_a_worse_fit_of_held_out_trains_adds_no_evidence(nats, rise, error, expected):
    assert evidence_of_rise(nats, rise, error) == pytest.approx(expected)


def answer(verdict="a_or_b", names=("local_ballast", "hanging_sleeper"), **more):
    return ModelAnswer(
        "2026-05-01", "change", verdict, names, "ballast@18.00", "ballast", 18.0, -1.0, 0.1, "-",
        (years_of("2026-02-01"), years_of("2026-05-01")), 40.0,
        changed=("ballast@18.00",), total=-1.0, **more,
    )  # fmt: skip


def trains(verdict, term):
    fits = {"fit_before_pct": 40.0, "fit_after_pct": 60.0, "fit_gain_se_pct": 1.0, "n_held_out": 2}
    return TrainTest("2026-05-01", {"verdict": verdict, "term": term, "parameters_json": None, **fits})


@pytest.mark.parametrize(
    ("given", "test", "expected"),
    [
        (answer(), None, ("a_or_b", "local_ballast", "hanging_sleeper")),
        (answer(), trains("named", "hanging_sleeper"), ("named", "hanging_sleeper", None)),
        (answer(), trains("a_or_b", "hanging_sleeper"), ("a_or_b", "hanging_sleeper", "local_ballast")),
        (answer(), trains("unknown", None), ("a_or_b", "local_ballast", "hanging_sleeper")),
        (answer("named", ("local_pad",)), trains("named", "local_ballast"), ("a_or_b", "local_pad", "local_ballast")),
        (answer("named", ("local_pad",)), trains("none", None), ("named", "local_pad", None)),
    ],
    ids=["no train", "trains decide", "trains fit either", "trains fail", "trains differ", "trains say nothing"],
)
def test_hammer_tests_and_trains_give_one_answer(given, test, expected):
    row = finding_of_change(given, test, 4, 8)
    assert (row["verdict"], row["term"], row["rival_term"]) == expected
    assert "-63 % (-70 to -55, 95 %)" in row["sentence"] and "8 hammer tests of 4 visits" in row["sentence"]


@pytest.mark.parametrize(
    ("changed", "first", "last", "words"),
    [
        ((18.0, 18.6), (18.0, 18.0), (18.6, 18.6), "softer pad from 18.0 to 18.6 m: "),
        ((18.0,), (17.4, 18.0), (18.0, 18.6), "18.0 m (first support at 17.4 to 18.0 m, last support at 18.0 to 18.6"),
        ((18.0, 18.6), (18.0, 18.0), (18.6, None), "from 18.0 to 18.6 m (last support at 18.6 m or beyond, 95 %): "),
        ((18.0, 18.6), (None, 18.0), (18.0, 18.6), "(first support at 18.0 m or before, last support at 18.0 to 18.6"),
    ],
)  # fmt: skip
def test_the_sentence_states_the_possible_extent_of_a_change(changed, first, last, words):
    named = replace(
        answer("named", ("local_pad",)), changed=tuple(f"pad@{x:.2f}" for x in changed), ends=StretchEnds(first, last)
    )
    row = finding_of_change(named, None, 4, 8)
    assert words in row["sentence"]
    are_ends_certain = (first, last) == ((18.0, 18.0), (18.6, 18.6))
    assert ("with the sleepers beside them unchanged" in row["sentence"]) is are_ends_certain
    assert (row["first_low_m"], row["last_high_m"]) == (first[0], last[1])


def test_no_change_too_few_visits_and_an_unknown_change_give_no_name():
    nothing = ModelAnswer("2026-05-01", "change", "none")
    assert "no change at any support has enough evidence" in finding_of_change(nothing, None, 4, 8)["sentence"]
    assert "at least two visits are needed" in finding_of_change(nothing, None, 1, 2)["sentence"]
    unknown = ModelAnswer("2026-05-01", "change", "unknown", (), "pad@18.00", "pad", 18.0)
    row = finding_of_change(unknown, None, 4, 8)
    assert row["verdict"] == "unknown"
    assert "something has changed at 18.0 m, and no effect of a support explains it" in row["sentence"]


@pytest.mark.parametrize(("nats", "verdict"), [(3.0, "none"), (6.0, "named")])
def test_held_out_trains_can_add_the_evidence_that_a_candidate_effect_lacks(nats, verdict):
    test = trains("named", "local_ballast")
    test.finding["gain_nats"] = nats
    weak = ModelAnswer(**{**vars(answer("named", ("local_ballast",))), "gain": 8.0})
    row = finding_of_change(weak, test, 4, 8, 12.0)
    assert row["verdict"] == verdict and row["gain_nats"] == 8.0 + nats
    is_name = verdict == "named"
    assert (row["term"] == "local_ballast") == is_name
    assert row["sentence"].startswith("no effect is named; the most likely one has") != is_name
    assert "softer ballast at 18.0 m" in row["sentence"]


def test_the_worklist_contains_the_newest_diagnoses(tmp_path, monkeypatch):
    from turnout.registry.database import open_registry
    from turnout.registry.job import register
    from turnout.workflow.batches import UnitResult

    root = tmp_path / "registry"
    register([], root, read=iter, tables={"turnouts": [{"turnout_id": "t1", "layout": "small", "config_hash": "h"}]})
    row = {"turnout_id": "t1", "sections": "A, B", "found_at_utc": pd.Timestamp("2026-05-01T23:59")}
    row |= {"verdict": "no_decision", "sentence": "no diagnosis: no track file"}
    row |= {"change": float("nan"), "change_se": float("inf")}
    result = UnitResult("t1/change/A+B", "t1", "change", "k", "v", "ok", {"change_findings": [row]})
    monkeypatch.setattr("turnout.stages.worklist.current_results", lambda work, stage, turnout: [result])
    for _ in range(2):
        assert worklist_job(root / "_generation.json", tmp_path / "list.csv", tmp_path) == 1
        with open_registry(root) as connection:
            query = "select turnout_id, sections, sentence, change, change_se from change_findings"
            rows = connection.execute(query).fetchall()
            assert rows == [("t1", "A, B", "no diagnosis: no track file", None, None)]
    assert (tmp_path / "list.csv").exists()


def test_the_sentence_of_growth_states_its_rate_and_the_change_so_far():
    """For a step the change so far is the change itself, so the sentence does not repeat it."""
    row = {
        "verdict": "named", "term": "local_ballast", "rival_term": None, "component": "ballast", "position_m": 3.6,
        "n_visits": 6, "n_recordings": 12, "onset_after_utc": datetime(2025, 3, 1), "trains_visit": None,
        "onset_by_utc": datetime(2025, 6, 1), "change": np.log(0.9), "change_se": 0.0, "change_unit": "-",
        "change_so_far": np.log(0.75), "change_so_far_se": 0.0,
    }  # fmt: skip
    rate, so_far = "-10 % (-10 to -10, 95 %) a year", "-25 % (-25 to -25, 95 %) so far"
    assert f"stiffness of the ballast under impacts {rate}, {so_far}, since" in sentence_of({**row, "grows": True})
    assert "so far" not in sentence_of({**row, "grows": False})
