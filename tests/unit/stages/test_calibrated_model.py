"""The calibrated model of a small turnout from its files: the joint result of visits, and repeated computations."""

import json
import re
import shutil
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
import small_turnout as small

from turnout.cli.input_warnings import events_in_doubt
from turnout.cli.main import main
from turnout.cli.twin import model_text
from turnout.config import load_configuration, with_raw
from turnout.constants import DAYS_PER_YEAR
from turnout.errors import SimulationError
from turnout.mismatch.calibrated import StateParameter, VisitInformation, estimate_history, track_sds
from turnout.mismatch.engine.diagnose import fit_base
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout import TrackCase
from turnout.mismatch.turnout.calibration import calibrated_parameters, visit_groups
from turnout.mismatch.turnout.further_passages import names_beyond, with_reserved_passages
from turnout.mismatch.turnout.unproven_panels import UNPROVEN_SWITCH
from turnout.number_text import evidence_in_words
from turnout.simulate.blade import Blade
from turnout.stages import calibrated_model as calibrated
from turnout.stages import mismatch, mismatch_groups, mismatch_results, visit_fits
from turnout.stages.mismatch_groups import every_visit, groups, visits
from turnout.stages.mismatch_inputs import gather_inputs
from turnout.stages.mismatch_results import diagnose_turnout
from turnout.stages.recorded_work import events_of
from turnout.stages.renewals import since_renewal
from turnout.stages.stored_visits import read_visits
from turnout.stages.track_files import track_of
from turnout.stages.visit_time import years_of
from turnout.workflow.scan import scan

DAYS = ("2025-08-01", "2025-11-01", "2026-02-01", "2026-05-01")


@pytest.fixture(scope="module")
def year(tmp_path_factory, repository):
    """Four hammer tests; the pad at 18.0 m is soft in the last one. Trains at the first visit."""
    folder = tmp_path_factory.mktemp("year")
    small.write_configuration(folder, repository)
    for k, day in enumerate(DAYS):
        terms = small.soft_pad if k == 3 else None
        small.write_hammer_tests(folder, terms, day=datetime.fromisoformat(f"{day}T09:00"), seed=10 * k)
    small.write_passages(folder, day=datetime.fromisoformat(f"{DAYS[0]}T09:00"))
    return folder


@pytest.fixture
def turnout(tmp_path, year, monkeypatch):
    shutil.copytree(year, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    families = ("local_ballast", "local_pad", "sensor_gain")
    monkeypatch.setattr(mismatch, "TrackCase", partial(TrackCase, families=families))
    return tmp_path


@pytest.fixture(scope="module")
def model(year, tmp_path_factory):
    work = tmp_path_factory.mktemp("work")
    return calibrated.calibrate_turnout("t1", year / "config", year / "raw", work), work


def test_a_softened_pad_is_reported_with_its_size_and_onset(model):
    best = model[0].changes[0]
    assert best.effect.name.startswith("pad@18.00") and best.gain > 100.0
    others = [c for c in model[0].changes if not c.effect.name.startswith("pad@18.00")]
    assert others[0].gain < best.gain - 6.0
    size, sd = best.size
    assert abs(size - np.log(small.SOFT)) < 3.0 * sd and sd < 0.1
    assert best.onset == DAYS[3]


def test_the_model_of_a_track_with_a_switch_states_that_its_answers_are_not_proven(model, year, monkeypatch):
    """The text and the rows state it; those of a track without a switch do not."""
    plain, work = model
    assert not any(UNPROVEN_SWITCH in line for line in model_text("t1", plain))
    assert all(row["reservation"] is None for row in calibrated.answer_rows(plain))
    track, accepted = track_of(load_configuration(year / "config").turnout("t1"))
    blade = Blade(12.0, 17.0, 22.0, track.track.rail, 3e8, 3e4)
    with_switch = replace(track, tracks={"diverging": track.track.with_(blade=blade)})
    monkeypatch.setattr(calibrated, "track_of", lambda *_: (with_switch, accepted))
    switch = calibrated.calibrate_turnout("t1", year / "config", year / "raw", work)
    assert switch.computed == () and list(model_text("t1", switch))[-1] == UNPROVEN_SWITCH
    rows = calibrated.answer_rows(switch)
    assert rows and all(row["reservation"] == UNPROVEN_SWITCH for row in rows)


def test_the_text_counts_the_hammer_tests_and_passages_that_were_used(model):
    """Two sections at each of the three visits that are used, and the trains of the first one."""
    n_trains = sum(s.n_recordings for s in model[0].history.used_steps) - 6
    assert n_trains > 0 and (model[0].n_hammer_tests, model[0].n_passages) == (6, n_trains)
    assert next(model_text("t1", model[0])).startswith(f"t1: 6 hammer tests and {n_trains} passage")


def test_a_change_without_an_answer_is_stated_with_the_evidence_that_an_answer_would_have(model):
    """It is that of one of many possible changes, as ``gain`` of an answer; formerly that of this one alone."""
    best = replace(model[0].changes[0], gains=np.full(3, 11.0))
    n = len(model[0].changes)
    found = replace(model[0], changes=(best, *model[0].changes[1:]), answers=())
    (line,) = [line for line in model_text("t1", found) if "possible changes" in line]
    assert n > 30 and evidence_in_words(11.0 - np.log(n)) in line and "too little for an answer" in line
    assert f"the most likely of {n} possible changes is pad@18.00" in line and "dampers" not in line


def test_the_table_has_the_standard_deviations_of_the_page(model):
    """With the error of the model. Formerly it had those of the belief."""
    history = model[0].history
    sds = track_sds(history.belief, history.parameters)
    expected = dict(zip((p.name for p in history.parameters), sds))
    rows = [line.split() for line in model_text("t1", model[0], show_all=True) if line.count("@") == 1]
    printed = {row[0]: float(row[-3]) for row in rows if row[0] in expected}
    assert len(printed) >= 40 and np.any(np.abs(sds - history.belief.sd) > 0.005)
    assert printed == pytest.approx({name: expected[name] for name in printed}, rel=0.01)


def test_a_logarithm_has_the_same_unit_in_the_rows_as_in_the_text(model):
    """Formerly "-" in the rows, as if -0.7 were a factor."""
    (row,) = [r for r in calibrated.answer_rows(model[0]) if r["question"] == "change"]
    assert row["parameter"] == "pad@18.00" and row["size"] < 0.0 and row["unit"] == "ln"


def test_the_channel_of_an_answer_may_have_an_underscore():
    answer = MagicMock(group="gain", parameter="diverging gain_rail_web", onset=None, names=(), position=None)
    (row,) = calibrated.answer_rows(MagicMock(answers=[answer], reservation=""))
    assert row["channel"] == "rail_web"


def test_a_visit_that_differs_is_not_used_and_the_others_agree_with_the_file(model):
    history = model[0].history
    assert [s.is_used for s in history.steps] == [True, True, True, False]
    assert history.steps[-1].innovation.parameter == "pad@18.00"
    (line,) = [line for line in model_text("t1", model[0]) if "is not used" in line]
    assert line.endswith(f"; turnout diagnose --turnout t1 --visit {DAYS[3]} examines it alone, faults of loggers too")
    assert not model[0].deviations
    sd = {p.name: s / p.sd for p, s in zip(history.parameters, history.belief.sd)}
    assert sd["ballast_stiffness"] < 0.4 and sd["pad@18.00"] < 0.8 and sd["pad@16.20"] > sd["pad@18.00"]


def test_visits_are_fitted_again_only_when_code_or_recordings_change(model, year, monkeypatch):
    _, work = model

    def again():
        return calibrated.calibrate_turnout("t1", year / "config", year / "raw", work)

    first = again()
    assert first.computed == ()
    assert first.history.belief.mean.tobytes() == model[0].history.belief.mean.tobytes()
    files = sorted((work / "calibrated-model" / "t1").iterdir())
    assert len(files) == 4
    files[0].write_bytes(b"damaged")
    repaired = again()
    assert repaired.computed == (DAYS[0],)
    assert repaired.history.belief.mean.tobytes() == first.history.belief.mean.tobytes()
    versions = {d: {"code": "other", "model": "", "recordings": ""} for d in DAYS}
    assert read_visits(work / "calibrated-model", "t1", versions) == []


def test_a_withdrawn_visit_has_no_effect_on_the_model(turnout, model):
    work = turnout / "work"
    shutil.copytree(model[1], work)
    shutil.rmtree(turnout / "raw" / "t1" / "hammer" / DAYS[1])
    withdrawn = calibrated.calibrate_turnout("t1")
    assert withdrawn.computed == ()
    for path in (work / "calibrated-model" / "t1").glob(f"{DAYS[1]}*"):
        path.unlink()
    never = calibrated.calibrate_turnout("t1")
    assert withdrawn.history.belief.covariance.tobytes() == never.history.belief.covariance.tobytes()
    assert withdrawn.history.belief.mean.tobytes() == never.history.belief.mean.tobytes()
    assert len(never.history.steps) == 3


def test_the_information_of_a_visit_equals_that_of_its_joint_fit(year):
    """With independent errors, mean and covariance are those of one more Gauss-Newton step of the joint fit."""
    turnout = with_raw(load_configuration(year / "config").turnout("t1"), year / "raw")
    units = visits(scan(turnout, year / "raw").units, [])[DAYS[0]]
    track, _ = track_of(turnout)
    (group,) = groups(turnout, track, gather_inputs(units, turnout, year / "raw", track, {}))
    search, fit = fit_base(
        Search.of(TrackCase(group.campaign, turnout.settings["mismatch"]), turnout.settings["mismatch"])
    )
    case, names = search.case, [n.name for n in search.case.nuisances]
    precision = np.diag([n.sd**-2 for n in case.nuisances])
    slope = precision @ [n.mean - fit.values[n.name] for n in case.nuisances]
    for o, j, r in zip(case.observations, fit.jacobian, fit.white):
        foreign = [k for k, n in enumerate(case.nuisances) if n.owner not in (None, o.name)]
        rows = np.array(j, dtype=float) * np.sqrt(o.effective / fit.scale[o.data_type])
        rows[:, foreign] = 0.0  # updates by Broyden's formula make these columns nonzero
        precision = precision + rows.T @ rows
        slope = slope + np.sqrt(o.effective / fit.scale[o.data_type]) * rows.T @ r
    covariance = np.linalg.inv(precision)
    mean = np.array([fit.values[n] for n in names]) + covariance @ slope
    parameters = {n: replace(p, visit_sd=0.0) for n, p in calibrated_parameters(case).items()}
    visit = VisitInformation("v", 0.0, visit_groups(case, fit, "A, B"))
    belief = estimate_history(list(parameters.values()), [visit], repeated_share=0.0, accepted=None).belief
    shared = [names.index(n) for n in parameters]
    np.testing.assert_allclose(belief.covariance, covariance[np.ix_(shared, shared)], rtol=1e-6, atol=1e-16)
    assert np.max(np.abs(belief.mean - mean[shared]) / belief.sd) < 1e-6
    labels = [g.group for g in visit.groups]
    assert labels[:2] == ["A, B: impacts at 18.00 m", "A, B: impacts at 18.60 m"]
    assert sorted(labels[2:]) == ["A, B: locomotive, 110 km/h", "A, B: locomotive, 90 km/h"]
    with pytest.raises(ValueError, match="with its Jacobian"):
        visit_groups(case, fit.without_jacobian(), "A, B")


def test_linearized_passages_give_the_same_information_as_fitted_passages(year):
    """One fitted and one linearized passage against two fitted ones: means within half a standard deviation."""
    turnout = with_raw(load_configuration(year / "config").turnout("t1"), year / "raw")
    units = visits(scan(turnout, year / "raw").units, [])[DAYS[0]]
    track, _ = track_of(turnout)
    (group,) = groups(turnout, track, gather_inputs(units, turnout, year / "raw", track, {}))
    n_axles = len(group.campaign.passages[0].vehicle.wheels)
    beyond = names_beyond(group.campaign, n_axles)
    assert len(beyond) == 1 and names_beyond(group.campaign, 2 * n_axles) == ()
    beliefs, settings = [], turnout.settings["mismatch"]
    for reserved in ((), beyond):
        case = TrackCase(replace(group.campaign, reserved=reserved), settings)
        search, fit = fit_base(Search.of(case, settings))
        information = visit_groups(*with_reserved_passages(search.case, fit), "A, B")
        assert sorted(g.n_recordings for g in information) == [1, 1, 1, 1]
        parameters = list(calibrated_parameters(search.case).values())
        visit = VisitInformation("v", 0.0, information)
        beliefs.append(estimate_history(parameters, [visit], repeated_share=0.0, accepted=None).belief)
    assert np.max(np.abs(beliefs[1].mean - beliefs[0].mean) / beliefs[0].sd) < 0.5
    np.testing.assert_allclose(beliefs[1].sd, beliefs[0].sd, rtol=0.15)


def test_the_stage_writes_the_state_after_a_visit_and_leaves_out_a_visit_with_a_finding(turnout, capsys):
    tables = diagnose_turnout("t1", visit=DAYS[0])
    rows = {r["parameter"]: r for r in tables["twin_states"]}
    assert tables["mismatch_findings"][0]["verdict"] == "none"
    pad = rows["pad@18.00"]
    assert pad["position_m"] == 18.0 and pad["n_visits"] == 1 and pad["n_recordings"] == 4
    assert pad["sd"] < pad["prior_sd"] == pytest.approx(0.1) and abs(pad["value"]) < 3.0 * pad["sd"]
    assert pad["finding_id"] == tables["mismatch_findings"][0]["finding_id"] and pad["code_version"]
    later = diagnose_turnout("t1", visit=DAYS[3])
    assert later["mismatch_findings"][0]["verdict"] == "named"
    after = {r["parameter"]: r for r in later["twin_states"]}["pad@18.00"]
    assert (after["n_visits"], after["value"], after["sd"]) == (1, pad["value"], pad["sd"])
    assert main(["twin", "--turnout", "t1"]) == 0
    printed = capsys.readouterr().out
    assert f"visit {DAYS[3]} A, B is not used: its diagnosis is named, and not accepted" in printed
    assert (
        "6 hammer tests and 2 passages of 3 visits used; 3 visits fitted now" in printed
        and "differences from the track file: none" in printed
    )
    size, sd = map(float, re.search(r"local pad, pad@18.00 (-[\d.]+) ± ([\d.]+) ln", printed).groups())
    assert printed.count("\n± is one standard deviation\n") == 1
    assert size == pytest.approx(np.log(small.SOFT), abs=3.0 * sd)
    factor = float(re.search(r"local pad, pad@18.00 .* ln \(([\d.]+) times\)", printed)[1])
    assert factor == pytest.approx(small.SOFT, rel=3.0 * sd)
    assert printed.count("ln: logarithm of the value divided by that of the track file") == 1
    assert f"appeared after {DAYS[2]}, at the latest at {DAYS[3]}" in printed


def test_a_visit_with_a_finding_is_fitted_later_with_the_same_result_as_at_once(turnout, monkeypatch):
    """The search for changes needs its fit. Its answer is unchanged, and the estimate does not use it."""

    def stored():
        (visit,) = read_visits(Path("work/calibrated-model"), "t1", {DAYS[3]: {}})
        return visit

    with monkeypatch.context() as at_once:
        at_once.setattr(mismatch.stored_visits, "USED_ANSWERS", ("none", "", "named"))
        diagnose_turnout("t1", visit=DAYS[3], work="at-once")
    (expected,) = read_visits(Path("at-once/calibrated-model"), "t1", {DAYS[3]: {}})
    diagnose_turnout("t1", visit=DAYS[3])
    assert not stored().fitted and not stored().groups and stored().parameters == expected.parameters
    model = calibrated.calibrate_turnout("t1")
    assert DAYS[3] in model.computed and model.held == {f"{DAYS[3]} A, B": "named"}
    assert stored().fitted and stored().answer == expected.answer == "named"
    for group, of_expected in zip(stored().groups, expected.groups, strict=True):
        assert (group.group, group.names) == (of_expected.group, of_expected.names)
        np.testing.assert_allclose(group.matrix, of_expected.matrix, rtol=1e-9)
        np.testing.assert_allclose(group.vector, of_expected.vector, rtol=1e-9)
    assert calibrated.calibrate_turnout("t1").computed == ()


def states_of(tables):
    return {r["parameter"]: (r["value"], r["sd"], r["n_visits"], r["n_recordings"]) for r in tables["twin_states"]}


def test_a_diagnosis_of_chosen_sections_or_of_all_visits_is_no_visit_of_the_model(turnout, model):
    """Formerly, the recordings of one section counted twice, or those of the other not at all."""
    shutil.copytree(model[1], "work")
    for visit, sections in ((DAYS[1], ("A",)), ("all", ())):
        assert diagnose_turnout("t1", visit=visit, sections=sections)["twin_states"] == []
        again = calibrated.calibrate_turnout("t1")
        assert again.computed == () and again.history.belief.mean.tobytes() == model[0].history.belief.mean.tobytes()
    shutil.rmtree("work")
    diagnose_turnout("t1", visit=DAYS[1], sections=("A",))
    fresh = calibrated.calibrate_turnout("t1")
    assert fresh.history.belief.mean.tobytes() == model[0].history.belief.mean.tobytes()
    assert [s.n_recordings for s in fresh.history.steps] == [4, 2, 2, 2]


def test_the_state_after_a_visit_is_that_of_the_recordings_and_the_recorded_work_of_now(turnout):
    """Bit by bit: a withdrawn visit or section, and work that is entered later, are as if it had always been so."""

    def after(visit, work):
        return states_of(diagnose_turnout("t1", visit=visit, work=work))

    shutil.rmtree("raw/t1/passages")
    for day in DAYS[:3]:
        states = after(day, "work")
    assert states["pad@18.00"][2:] == (3, 6) and after(DAYS[2], "work") == states  # from the stored rows
    shutil.rmtree(Path("raw/t1/hammer") / DAYS[1])
    after(DAYS[0], "never")
    never = after(DAYS[2], "never")
    assert never["pad@18.00"][2:] == (2, 4) and after(DAYS[2], "work") == never
    write_events(f"t1,A,{DAYS[1]},tamping,,\n")
    shutil.copytree("never/mismatch-fits", "fresh/mismatch-fits")
    shutil.copytree("never/calibrated-model", "fresh/calibrated-model")
    tamped = after(DAYS[2], "work")
    assert tamped == after(DAYS[2], "fresh") and tamped["ballast@18.00"][1] > never["ballast@18.00"][1]
    write_events("")
    for path in Path("raw/t1/hammer").rglob("*.h5"):
        path.touch()  # a copied folder
    assert after(DAYS[2], "work") == never
    (Path("raw/t1/hammer") / DAYS[0] / "B_1.h5").unlink()
    one_less = after(DAYS[2], "work")  # the first visit is fitted again, as it is now
    assert one_less["pad@18.00"][2:] == (2, 3)
    after(DAYS[0], "never-either")
    assert after(DAYS[2], "never-either") == one_less


def test_the_state_has_each_visit_that_it_had_after_another_track_or_code_or_a_damaged_file(turnout, monkeypatch):
    """Formerly, an edited track file, another version of the program or a damaged file left the newest visit alone."""
    shutil.rmtree("raw/t1/passages")
    for day in DAYS[1:3]:
        shutil.rmtree(Path("raw/t1/hammer") / day)
    diagnose_turnout("t1", visit=DAYS[0])
    before = states_of(diagnose_turnout("t1", visit=DAYS[3]))
    (path,) = Path("work/calibrated-model/t1").glob(f"{DAYS[0]}-*.npz")
    path.write_bytes(path.read_bytes()[:999])
    assert states_of(diagnose_turnout("t1", visit=DAYS[3])) == before
    path.rename(path.with_name(f"{DAYS[0]}-0123456789ab.npz"))  # of sections that are no group any more
    path.with_name(f"{DAYS[0]}-0123456789ab.npz").write_bytes(b"")
    assert states_of(diagnose_turnout("t1", visit=DAYS[3])) == before
    assert [p.name for p in path.parent.glob(f"{DAYS[0]}-*.npz")] == [path.name]
    with monkeypatch.context() as other_code:
        other_code.setattr(mismatch_results, "fingerprint", lambda _: "of another version")
        tables = diagnose_turnout("t1", visit=DAYS[3])
        assert states_of(tables) == before
        assert {r["code_version"] for r in tables["twin_states"]} == {"of another version"}
        (stored,) = read_visits(Path("work/calibrated-model"), "t1", {DAYS[0]: {"code": "of another version"}})
        assert stored.fitted and stored.groups
    track = Path("config/tracks/small.yaml")
    track.write_text(track.read_text().replace("mass: {value: 60.2,", "mass: {value: 60.3,"))
    other_rail = states_of(diagnose_turnout("t1", visit=DAYS[3]))
    assert other_rail["pad@18.00"][2:] == before["pad@18.00"][2:] == (1, 2) and other_rail != before


def test_the_state_after_a_visit_rests_on_all_of_its_groups_of_sections(turnout, monkeypatch):
    """Formerly, the state of the first group did not have the recordings of the second until the next diagnosis."""
    monkeypatch.setattr(mismatch_groups, "MAX_SECTION_GAP", 0.5)
    shutil.rmtree("raw/t1/passages")
    first, again = (diagnose_turnout("t1", visit=DAYS[0]) for _ in range(2))
    assert {r["sections"] for r in first["mismatch_findings"]} == {"A", "B"}
    assert {(r["n_visits"], r["n_recordings"]) for r in first["twin_states"]} == {(1, 2)}
    assert again["twin_states"] == first["twin_states"]


def test_recorded_work_and_files_of_earlier_visits_start_the_diagnosis_of_the_newest_visit_again(turnout):
    """Its states rest on them. Work on other turnouts does not matter."""
    files = [[f"hammer/{day}/A_1.h5", 100, 1] for day in DAYS[:2]]
    units = [["hammer", f"A/{day}", "A", day, "", [file]] for day, file in zip(DAYS, files)]
    entry = {"turnout": "t1", "raw": "t1", "units": units, "hashes": {"hammer": "h", "mismatch": "m"}}

    def planned():
        Path("plan.json").write_text(json.dumps({"turnouts": [entry]}))
        (unit,) = every_visit(Path("plan.json"), load_configuration("config"))
        return unit

    first = planned()
    assert first.unit.label == DAYS[1] and planned() == first
    write_events("t2,,2025-09-01,tamping,,\n")
    assert planned() == first
    write_events("t1,,2025-09-01,tamping,,\n")
    worked = planned()
    assert worked.unit == first.unit and worked.note != first.note
    files[0][2] = 2  # corrected
    assert planned().unit == first.unit and planned().note not in (first.note, worked.note)


def test_the_reason_why_a_visit_cannot_be_fitted_is_stated_by_every_call(turnout, model, monkeypatch):
    shutil.copytree(model[1], "work")
    for path in Path("work/calibrated-model/t1").glob(f"{DAYS[1]}*"):
        path.unlink()
    with monkeypatch.context() as broken:
        broken.setattr(visit_fits, "TrackCase", MagicMock(side_effect=SimulationError("the wheel leaves the track")))
        first = calibrated.calibrate_turnout("t1")
    again = calibrated.calibrate_turnout("t1")
    assert (first.computed, again.computed) == ((DAYS[1],), ())
    for of_call in (first, again):
        assert [s.visit for s in of_call.history.steps] == [DAYS[0], *DAYS[2:]]
        assert of_call.notes == (f"visit {DAYS[1]}: sections A, B: the wheel leaves the track",)


def test_maintenance_makes_the_affected_parameters_uncertain(turnout):
    (turnout / "config" / "events.csv").write_text(
        "turnout,section,date,kind,resets,note\nt1,A,2026-01-10,tamping,,\nt1,,2026-01-11,sensor_change,,\n"
        "t2,,2026-01-12,tamping,,\nt1,,2026-01-13,other,,\nt1,A99,2026-01-14,tamping,,\n"  # there is no such section
    )
    parameters = [
        StateParameter("ballast@18.00", 0.0, 0.1, 0.0, "ballast", 30, 18.0),
        StateParameter("ballast@30.00", 0.0, 0.1, 0.0, "ballast", 50, 30.0),
        StateParameter("gain_A", 0.0, 0.02, 0.0, "gain", None, 18.0),
        StateParameter("pad@18.00", 0.0, 0.1, 0.0, "pad", 30, 18.0),
        StateParameter("ln depth of the kink at 18.20 m", 0.0, 0.4, 0.0, "depth"),  # tamping does not repair a nose
    ]
    tamping, sensors = events_of(load_configuration("config").turnout("t1"), parameters)
    assert tamping.opened == {"ballast@18.00": 0.1} and sensors.opened == {"gain_A": 0.02}
    assert years_of("2026-01-09") < tamping.time < years_of("2026-01-11")


def write_events(text):
    Path("config/events.csv").write_text(f"turnout,section,date,kind,resets,note\n{text}")


def opened_by(rows):
    """Work in the rows of events.csv: time in days from 2026-01-10 -> parameters that it makes uncertain, their sd."""
    parameters = [
        StateParameter("ballast@18.00", 0.0, 0.1, 0.0, "ballast", 30, 18.0),
        StateParameter("pad@18.00", 0.0, 0.2, 0.0, "pad", 30, 18.0),
        StateParameter("pad_stiffness", 0.0, 0.3),
    ]
    write_events(rows)
    events = events_of(load_configuration("config").turnout("t1"), parameters)
    return {round((e.time - years_of("2026-01-10")) * DAYS_PER_YEAR): dict(e.opened) for e in events}


def test_work_of_one_day_counts_once_whether_entered_once_or_section_by_section(turnout):
    whole = opened_by("t1,,2026-01-10,tamping,,\n")
    assert opened_by("t1,A,2026-01-10,tamping,,\nt1,B,2026-01-10,tamping,,\n") == whole == {0: {"ballast@18.00": 0.1}}
    assert opened_by("t1,,2026-01-10,tamping,,\nt1,,2026-01-10,ballast_cleaning,,\n") == whole
    both = opened_by("t1,,2026-01-10,tamping,,\nt1,A,2026-01-10,pad_exchange,,\n")
    assert both == {0: {"ballast@18.00": 0.1, "pad@18.00": 0.2}}
    assert list(opened_by("t1,A,2026-01-10,tamping,,\nt1,B,2026-01-12,tamping,,\n")) == [0, 2]


def test_work_in_the_evening_of_a_day_of_measurement_lies_after_it(turnout):
    """One measures by day and works at night. Work of the whole turnout that renews it is no exception."""
    assert list(opened_by("t1,A,2026-01-10T02:30,tamping,,\nt1,A,2026-01-10T22:00,pad_exchange,,\n")) == [0, 1]
    t1 = load_configuration("config").turnout("t1")
    write_events(f"t1,,{DAYS[1]}T23:00,renewal,,\n")
    assert list(since_renewal(t1, dict.fromkeys(DAYS))) == list(DAYS[2:])
    write_events(f"t1,,{DAYS[1]}T01:00,renewal,,\n")
    assert list(since_renewal(t1, dict.fromkeys(DAYS))) == list(DAYS[1:])


def test_rows_of_events_that_do_not_count_are_stated_with_the_model(turnout):
    """A misspelt section or turnout, and a date far ahead: formerly the work was left out without a word."""
    write_events(
        "t1,A9,2026-01-10,tamping,,\nT1,,2026-01-11,tamping,,\nt1,,2099-01-11,tamping,,\nt9,,2026-01-11,tamping,,\n"
        "t1,A,2026-01-12,tamping,,\nt1,A,2026-01-12,tamping,,\n"
    )
    doubts = events_in_doubt(load_configuration("config"), "t1")
    assert [re.search(r"line (\d)", d)[1] for d in doubts] == ["2", "3", "4"]  # the last row repeats one that counts


def test_resonances_that_a_row_resets_beside_those_of_its_kind_are_uncertain_too(turnout):
    """Tightened clips are entered as "other" with "railpad"."""
    assert opened_by("t1,A,2026-01-10,other,railpad,clips\n") == {0: {"pad@18.00": 0.2}}
    assert opened_by("t1,,2026-01-10,other,railpad,clips\n") == {0: {"pad@18.00": 0.2, "pad_stiffness": 0.3}}
    assert set(opened_by("t1,A,2026-01-10,tamping,ballast railpad,\n")[0]) == {"ballast@18.00", "pad@18.00"}
    assert opened_by("t1,A,2026-01-10,sensor_change,,\n") == {0: {}}  # its resonances are those of the measurement
    assert opened_by("t1,A,2026-01-10,other,,\nt1,A,2026-01-10,method_change,,\n") == {}


def test_the_model_of_a_renewed_turnout_uses_no_recording_from_before_the_renewal(turnout, model):
    """Equal, bit by bit, to the model of later recordings; renewal of a section makes all its parts uncertain."""
    shutil.copytree(model[1], "work")
    rest = [years_of(day) for day in DAYS[2:]]
    write_events(f"t1,,{DAYS[1]},tamping,,\nt1,,2025-12-01,renewal,,\nt2,,2026-04-01,renewal,,\n")
    renewed = calibrated.calibrate_turnout("t1")
    assert [s.time for s in renewed.history.steps] == rest and renewed.computed == ()
    for day in DAYS[:2]:
        shutil.rmtree(Path("raw/t1/hammer") / day)
    shutil.rmtree("raw/t1/passages")
    write_events("")
    never = calibrated.calibrate_turnout("t1")
    assert renewed.history.belief.covariance.tobytes() == never.history.belief.covariance.tobytes()
    assert renewed.history.belief.mean.tobytes() == never.history.belief.mean.tobytes()
    write_events("t1,A,2025-12-01,renewal,,\n")
    of_section = calibrated.calibrate_turnout("t1")
    (event,) = events_of(load_configuration("config").turnout("t1"), of_section.history.parameters)
    assert {"ballast@18.00", "pad@18.00"} <= set(event.opened)
    write_events("t1,,2026-06-01,renewal,,\n")
    with pytest.raises(SimulationError, match="no passage below raw since its renewal on 2026-06-01"):
        calibrated.calibrate_turnout("t1")


def test_the_diagnosis_of_all_visits_leaves_out_those_before_a_renewal(turnout, monkeypatch):
    used = []
    monkeypatch.setattr(mismatch_results, "diagnose_visit", lambda unit, *_: used.extend(unit.files) or {})
    write_events("t1,,2026-03-01,renewal,,\n")
    diagnose_turnout("t1", visit="all")
    assert {path.split("/")[2] for path, *_ in used} == {DAYS[3]}
    used.clear()
    write_events(f"t1,,{datetime.now() + timedelta(days=30):%Y-%m-%d},renewal,,\n")
    diagnose_turnout("t1", visit="all")  # a planned renewal has not happened
    assert {path.split("/")[2] for path, *_ in used if "hammer" in path} == set(DAYS)
    used.clear()
    diagnose_turnout("t1", visit=DAYS[0])  # a visit that is given by its day is diagnosed
    assert len(used) == 4


def test_a_train_of_unknown_type_is_left_out_and_reported_by_every_call(turnout):
    """The estimate equals, bit by bit, that without trains."""
    for day in DAYS[1:]:
        shutil.rmtree(Path("raw/t1/hammer") / day)
    Path("config/vehicles/locomotive.yaml").unlink()
    (first, again) = (calibrated.calibrate_turnout("t1") for _ in range(2))
    assert first.computed == (DAYS[0],) and again.computed == ()
    shutil.rmtree("raw/t1/passages")
    without = calibrated.calibrate_turnout("t1")
    assert without.computed == (DAYS[0],) and not without.notes
    assert first.history.belief.mean.tobytes() == without.history.belief.mean.tobytes()
    for found in (first, again):
        assert any(n.startswith(f"2 passages of visit {DAYS[0]}: ") and "type" in n for n in found.notes)
        assert any(line.startswith("note: 2 passages") for line in model_text("t1", found))


def test_a_turnout_without_recordings_is_an_error(turnout, capsys):
    shutil.rmtree(turnout / "raw")
    with pytest.raises(SimulationError, match="no hammer test and no passage"):
        calibrated.calibrate_turnout("t1")
    assert main(["twin", "--turnout", "t1"]) == 2 and "nothing can be calibrated" in capsys.readouterr().err


@pytest.mark.parametrize("changes", [(), (SimpleNamespace(effect=SimpleNamespace(name="gain_A"), gain=0.0),)])
def test_no_answer_about_changes_is_printed_for_a_single_visit(changes):
    """Other visits may have been examined for changes and set aside."""
    history = SimpleNamespace(
        used_steps=[SimpleNamespace(n_recordings=2)], steps=[], parameters=[],
        belief=SimpleNamespace(mean=np.zeros(0), sd=np.zeros(0)),
    )  # fmt: skip
    answers = [SimpleNamespace(question="change", verdict="none", visit=DAYS[0])]
    model = SimpleNamespace(
        history=history,
        computed=[1],
        held={},
        notes=[],
        answers=answers,
        deviations=[],
        changes=changes,
        reservation="",
        n_hammer_tests=0,
        n_passages=2,
    )
    text = "\n".join(model_text("t1", model))
    assert text.startswith("t1: 0 hammer tests and 2 passages of 1 visit used; 1 visit fitted now\n")
    assert "changes: cannot tell from fewer than two visits that are used" in text
    assert "changes up to" not in text and "most likely change" not in text
