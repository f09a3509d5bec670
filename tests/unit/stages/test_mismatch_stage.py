"""From the files of a turnout to findings: names, accepted effects, and what is reported for incomplete input."""

import json
import re
import shutil
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
import small_turnout as small

from turnout import physics
from turnout.cli.main import main
from turnout.config import load_configuration, with_raw
from turnout.errors import SimulationError
from turnout.mismatch.turnout import TrackCase
from turnout.stages import mismatch, mismatch_groups, mismatch_inputs
from turnout.stages.accept_finding import accept
from turnout.stages.budget import BudgetSpentError
from turnout.stages.mismatch_inputs import Note
from turnout.stages.mismatch_results import Results, diagnose_turnout
from turnout.stages.track_files import track_of
from turnout.workflow.scan import scan


@pytest.fixture
def folder(tmp_path, repository, monkeypatch):
    """A turnout without recordings; with only three families of effects a diagnosis takes about a second."""
    small.write_configuration(tmp_path, repository)
    monkeypatch.chdir(tmp_path)
    families = ("local_ballast", "local_pad", "sensor_gain")
    monkeypatch.setattr(mismatch, "TrackCase", partial(TrackCase, families=families))
    return tmp_path


@pytest.fixture(scope="module")
def impacts(tmp_path_factory, repository):
    """Hammer tests on a turnout with one soft pad; tests copy them."""
    made = tmp_path_factory.mktemp("impacts")
    small.write_configuration(made, repository)
    small.write_hammer_tests(made, small.soft_pad)
    return made / "raw"


@pytest.fixture
def soft(folder, impacts):
    shutil.copytree(impacts, folder / "raw")
    return folder


def reported(tables):
    """All notes and messages about what was not used."""
    notes = [n for f in tables["mismatch_findings"] for n in (f["notes"] or "").splitlines()]
    return "\n".join([*notes, *(q["found"] for q in tables["quarantine"])])


def test_a_rail_much_softer_than_the_file_is_reported_without_a_name(folder):
    """Half the shear stiffness: a nuisance parameter absorbs it, and no effect of these families explains it."""

    def soft_in_shear(track):
        return (physics.RailShear(1e9 / track.rail.shear_stiffness),)

    small.write_hammer_tests(folder, soft_in_shear)
    (row,) = diagnose_turnout("t1")["mismatch_findings"]
    stated = re.search(r"The shear stiffness of the rail is ([\d.]+) times that of the file", row["sentence"])
    assert row["term"] is None and float(stated[1]) == pytest.approx(0.5, abs=0.05)


def test_hammer_tests_alone_name_the_soft_pad_and_its_sleeper(soft):
    tables = diagnose_turnout("t1")
    (row,) = tables["mismatch_findings"]
    assert (row["verdict"], row["term"], row["position_m"]) == ("named", "local_pad", 18.0)
    assert row["sections"] == "A, B" and row["visit"] == "2026-07-25"
    assert "18.0 m" in row["sentence"] and row["next_measurement"]
    assert row["n_passages"] == 0 and row["n_hammer_tests"] == 2
    (parameter,) = tables["mismatch_parameters"]
    # the true value is 0.3; impacts on two sleepers determine the factor to a fifth
    assert (
        parameter["value_low"] < small.SOFT + 0.1
        and parameter["value_low"] < parameter["value"] < parameter["value_high"]
    )
    curve = next(c for c in tables["mismatch_curves"] if c["curve"] == "receptance")
    better = np.abs(np.log(curve["after"] / curve["measured"])) < np.abs(np.log(curve["before"] / curve["measured"]))
    assert better.mean() > 0.5


def test_an_accepted_effect_is_simulated_and_not_reported_again(soft, capsys):
    assert main(["diagnose", "--turnout", "t1"]) == 0
    assert (soft / "results/pages/findings/t1.html").is_file()
    assert main(["diagnose", "--turnout", "t1", "--accept"]) == 0
    assert "local_pad" in capsys.readouterr().out
    turnout = load_configuration("config").turnout("t1")
    _, (accepted,) = track_of(turnout)
    assert (accepted.family, accepted.place) == ("local_pad", 18.0)
    text = (soft / "config/tracks/t1.yaml").read_text()
    assert "extends: small" in text and "2026-07-25" in text and "95 %:" in text and "grade A" in text
    tables = diagnose_turnout("t1")
    (row,) = tables["mismatch_findings"]
    assert row["verdict"] == "none" and row["term"] is None
    (parameter,) = tables["mismatch_parameters"]
    assert parameter["accepted"] and parameter["term"] == "local_pad"
    assert parameter["value_low"] < small.SOFT < parameter["value_high"] < 0.7


PAD_CHANGED = """extends: small
terms:
  - term: local_pad
    first: {{value: 18.0, unit: m, source: found}}
    last: {{value: 18.0, unit: m, source: found}}
    since: {since}
    until: {until}
    accepted: 2026-07-26
"""


@pytest.mark.parametrize(
    ("since", "until", "verdict"), [("2026-05", "2026-06", "none"), ("2026-08", "2026-09", "named")]
)
def test_an_accepted_change_is_not_reported_again_at_a_later_visit(soft, since, until, verdict):
    """The visit of 2026-07-25 estimates its size, 0.3 of the stiffness, unless the change began later."""
    (soft / "config/tracks/t1.yaml").write_text(PAD_CHANGED.format(since=f"{since}-01", until=f"{until}-01"))
    tables = diagnose_turnout("t1")
    (row,) = tables["mismatch_findings"]
    assert row["verdict"] == verdict
    sizes = [p for p in tables["mismatch_parameters"] if p["term"] == "local_pad" and p["accepted"]]
    assert len(sizes) == (verdict == "none")
    for size in sizes:
        assert size["position_m"] == 18.0 and size["value"] == pytest.approx(small.SOFT, abs=0.1)
    names = {p["parameter"] for p in tables["twin_states"]}
    assert names and not any("local_pad" in name for name in names)  # it is no parameter of the calibrated model


def test_an_accepted_effect_is_not_reported_again_from_passages(soft):
    """The search for dips and wheels uses the residual that remains with the accepted effect."""
    assert main(["diagnose", "--turnout", "t1"]) == 0 == main(["diagnose", "--turnout", "t1", "--accept"])
    small.write_passages(soft, small.soft_pad)
    tables = diagnose_turnout("t1")
    (row,) = tables["mismatch_findings"]
    assert (row["verdict"], row["n_passages"]) == ("none", 2)
    (parameter,) = tables["mismatch_parameters"]
    assert parameter["accepted"] and parameter["value_low"] < small.SOFT < parameter["value_high"]


def test_the_simulated_file_contains_the_accepted_effect(soft):
    """`turnout simulate` writes the recording of the track with the effect."""
    from turnout.readers import read
    from turnout.stages.simulate import write_hammer
    from turnout.stages.simulate_request import REQUEST_DEFAULTS

    turnout = load_configuration("config").turnout("t1")
    Results("work", "t1").save(diagnose_turnout("t1"))
    request = REQUEST_DEFAULTS | {"track": None, "turnout": "t1", "section": "A", "seed": 1, "tests": 1, "impacts": 1}
    request |= {"at": "2026-07-26T09:00:00", "config": "config"}
    recorded = []
    for name in ("before.h5", "after.h5"):
        list(write_hammer(request | {"out": name}))
        recorded.append(read(name, ".", turnout.hammer.descriptions["A"]).recordings[0].signal("rail"))
        if name == "before.h5":
            accept(Results("work", "t1").finding(), "config", "t1")
    change = np.abs(recorded[1] - recorded[0]).max() / np.abs(recorded[0]).max()
    assert change > 0.02


def test_results_are_kept_when_the_budget_is_used_up(soft):
    class Bar:
        def __init__(self):
            self.fits, self.groups = [], []

        def group(self, group, number, count):
            self.groups.append((group.labels, number, count))
            return lambda done, total, what: self.fits.append((done, total))

        def simulations(self, count):
            self.count = count

    with pytest.raises(BudgetSpentError, match="the same command continues"):
        diagnose_turnout("t1", budget=0.0)
    whole, again = Bar(), Bar()
    first = diagnose_turnout("t1", bar=whole)
    assert whole.groups == [(("A", "B"), 0, 1)] and whole.fits[-1][0] == whole.fits[-1][1] and whole.count > 3
    second = diagnose_turnout("t1", bar=again)
    assert second["mismatch_findings"] == first["mismatch_findings"] and not again.fits


def test_finished_groups_are_shown_when_the_budget_is_used_up(soft, monkeypatch, capsys):
    """There are two groups; the first was finished before."""
    monkeypatch.setattr(mismatch_groups, "MAX_SECTION_GAP", 0.1)
    assert main(["diagnose", "--turnout", "t1", "--limit-minutes", "0"]) == 2
    assert "0 of 2 groups done" in capsys.readouterr().err and not (soft / "results").exists()
    (first,) = diagnose_turnout("t1", sections=("A",))["mismatch_findings"]
    assert main(["diagnose", "--turnout", "t1", "--limit-minutes", "0"]) == 2
    printed = capsys.readouterr()
    assert first["sentence"] in printed.out and "no answer for sections B: the budget was used up" in printed.out
    assert "1 of 2 groups done; the same command continues" in printed.err
    page = (soft / "results/pages/findings/t1.html").read_text()
    assert "Run the same command again" in page and "docs/" not in page
    assert "2 groups: neighbouring sections together; a group takes a minute to ten" in printed.err
    page = (soft / "results/pages/findings/t1.html").read_text()
    assert "with 1 of 2 groups done" in page


def test_successive_small_budgets_give_the_same_result(soft):
    first = diagnose_turnout("t1", work="other")
    for _ in range(600):  # every run makes progress; a busy machine needs many runs
        try:
            second = diagnose_turnout("t1", budget=2.0)
            break
        except BudgetSpentError:
            continue
    assert second["mismatch_findings"] == first["mismatch_findings"]
    assert not list((soft / "work/mismatch-fits").glob("*predictions*"))


def test_the_diagnosis_can_be_limited_to_some_sections(soft):
    (row,) = diagnose_turnout("t1", sections=("B",))["mismatch_findings"]
    assert row["sections"] == "B" and row["section_id"] == "t1/B"
    with pytest.raises(SimulationError, match="no section C"):
        diagnose_turnout("t1", sections=("C",))
    with pytest.raises(SimulationError, match="no visit '2026-01-01'"):
        diagnose_turnout("t1", visit="2026-01-01")


# Bad input: the diagnosis uses the rest, or states why it cannot give an answer.


def test_a_turnout_without_recordings_is_an_error(folder, capsys):
    assert main(["diagnose", "--turnout", "t1"]) == 2
    assert "no hammer test and no passage" in capsys.readouterr().err


def test_no_hammer_test_and_one_train_give_a_finding_without_held_out_recordings(folder):
    small.write_passages(folder, speeds=(100.0,))
    (row,) = diagnose_turnout("t1")["mismatch_findings"]
    assert row["verdict"] in ("none", "named", "a_or_b", "unknown", "numerics")
    assert (row["n_hammer_tests"], row["n_passages"], row["n_held_out"], row["fit_before_pct"]) == (0, 1, 0, None)


def test_a_single_sensor_gives_a_finding(folder):
    def one(recording):
        dead = recording.samples.copy()
        dead[1] = 0.0
        return replace(recording, samples=dead)

    small.write_passages(folder, speeds=(100.0,), change=one)
    tables = diagnose_turnout("t1")
    assert "channel 'B'" in reported(tables) and "dead" in reported(tables)
    assert [f["n_sensors"] for f in tables["mismatch_findings"]] == [1]


def test_a_wrong_vehicle_file_is_reported_because_of_its_axles(soft):
    small.write_passages(
        soft, speeds=(100.0,), change=lambda r: replace(r, conditions={**r.conditions, "train_type": "ic3"})
    )
    tables = diagnose_turnout("t1")
    assert "4 axles recorded, 8 in ic3.yaml: wrong vehicle file" in reported(tables)
    assert [f["n_passages"] for f in tables["mismatch_findings"]] == [0]
    turnout = with_raw(load_configuration(soft / "config").turnout("t1"), soft / "raw")
    track, _ = track_of(turnout)
    inputs = mismatch_inputs.gather_inputs(scan(turnout, soft / "raw").units, turnout, soft / "raw", track, {})
    (group,) = mismatch_groups.groups(turnout, track, inputs)
    assert group.campaign.contradicted_trains == ("ic3",)


def test_a_vehicle_without_a_file_is_reported(soft):
    small.write_passages(
        soft, speeds=(100.0,), change=lambda r: replace(r, conditions={**r.conditions, "train_type": "tgv"})
    )
    assert "type tgv: no file config/vehicles/tgv.yaml" in reported(diagnose_turnout("t1"))


def test_a_wrong_layout_is_reported_because_of_the_track_file(soft):
    layout = soft / "config/layouts/small.yaml"
    layout.write_text(layout.read_text().replace("position: 18.0", "position: 22.0"))
    tables = diagnose_turnout("t1")
    assert "section A: 22.0 m in the layout, 18.0 m in the track's file" in reported(tables)
    assert [f["sections"] for f in tables["mismatch_findings"]] == ["B"]


def test_a_stiffness_with_a_wrong_prefix_is_stated_with_the_finding(soft):
    file = soft / "config/tracks/small.yaml"
    file.write_text(
        file.read_text().replace("ballast_stiffness: {value: 100, unit: M", "ballast_stiffness: {value: 100, unit: ")
    )
    text = reported(diagnose_turnout("t1"))
    assert re.search(r"improbable: .*small\.yaml, line \d+, support\.ballast_stiffness: 100 N/m is outside", text)


def test_a_recording_from_another_turnout_is_not_used(soft):
    """Its sensors are three times as far apart: no known train has axles at these times."""
    near = dict(small.PLACES)
    small.PLACES["B"] = 19.8
    try:
        small.write_passages(soft, speeds=(60.0,), change=_called("locomotive"))
    finally:
        small.PLACES.update(near)
    tables = diagnose_turnout("t1")
    assert "wrong vehicle file" in reported(tables) and "other sensors" in reported(tables)
    (row,) = tables["mismatch_findings"]
    assert (row["n_hammer_tests"], row["n_passages"]) == (2, 0)


def _called(name):
    return lambda r: replace(r, conditions={"train_type": name})


def test_channels_that_are_clipped_throughout_are_left_out(soft):
    def clipped(recording):
        return replace(recording, samples=np.clip(recording.samples, -0.5, 0.5))

    layout = soft / "config/layouts/small.yaml"
    layout.write_text(layout.read_text().replace("limit: 500", "limit: 0.5"))
    small.write_passages(soft, speeds=(100.0,), change=clipped)
    tables = diagnose_turnout("t1")
    assert "clipped" in reported(tables)
    assert tables["mismatch_findings"][0]["n_passages"] == 0


def test_a_file_that_cannot_be_read_is_reported(soft):
    (soft / "raw/t1/hammer/2026-07-25/B_1.h5").write_bytes(b"nothing")
    tables = diagnose_turnout("t1")
    assert "B_1.h5" in reported(tables) and tables["mismatch_findings"][0]["n_hammer_tests"] == 1


def test_trains_that_differ_too_much_for_a_comparison_give_the_answer_unknown(soft, monkeypatch):
    """The dip is so large that no passage resembles its simulation; hammer tests do not show a dip."""
    shutil.rmtree(soft / "raw")
    small.write_hammer_tests(soft)
    small.write_passages(soft, lambda track: (physics.SurfaceDip(18.3, 6e-4),), speeds=(90.0, 110.0))
    (row,) = diagnose_turnout("t1")["mismatch_findings"]
    assert (row["verdict"], row["n_passages"], row["position_m"]) == ("unknown", 0, None)
    assert row["sentence"].startswith("No passage resembles the simulation of its train: a large fault of the track")


def test_a_turnout_without_a_track_file_is_an_error(soft, capsys):
    (soft / "config/tracks/small.yaml").unlink()
    assert main(["diagnose", "--turnout", "t1"]) == 2
    message = capsys.readouterr().err
    assert "without a track nothing can be simulated. Copy a file of config/tracks" in message


def test_the_registry_accepts_the_rows(soft, tmp_path):
    from turnout.registry.database import open_registry
    from turnout.registry.job import register
    from turnout.workflow.batches import UnitResult, read_results, write_batch

    tables = diagnose_turnout("t1")
    batch = write_batch(
        tmp_path / "b", [UnitResult("t1/mismatch/2026-07-25", "t1", "mismatch", "k", "1", "ok", tables)]
    )
    done = register([batch], tmp_path / "registry", read=read_results)
    assert done.n_rejected == 0
    with open_registry(tmp_path / "registry") as connection:
        (found,) = connection.execute("select verdict, term, term_json from findings_newest").fetchall()
        assert found[:2] == ("named", "local_pad") and json.loads(found[2])[0]["fixed"] == {"sleeper": 18.0}
        assert connection.execute("select count(*) from mismatch_curves").fetchall() == [
            (len(tables["mismatch_curves"]),)
        ]


def test_a_finding_of_the_fleet_is_accepted_from_the_registry(soft, tmp_path):
    from turnout.registry.job import register
    from turnout.workflow.batches import UnitResult, read_results, write_batch

    tables = diagnose_turnout("t1")
    result = UnitResult("t1/mismatch/2026-07-25", "t1", "mismatch", "k", "1", "ok", tables)
    register([write_batch(tmp_path / "b", [result])], tmp_path / "registry", read=read_results)
    path, words = accept(Results("work", "t1", tmp_path / "registry").finding(), "config", "t1")
    assert path.name == "t1.yaml" and "local_pad" in words
    with pytest.raises(SimulationError, match="run turnout diagnose"):
        Results("work", "t2", tmp_path / "registry").finding()


def test_notes_of_a_visit_are_stored_as_text_with_its_information(tmp_path, monkeypatch):
    """Formerly, the diagnosis of a visit with a note ended with a TypeError."""
    kept = {}
    monkeypatch.setattr(mismatch, "TrackCase", lambda *_, **__: None)
    monkeypatch.setattr(mismatch, "diagnose", lambda *_: SimpleNamespace(verdict=SimpleNamespace(answer="none")))
    monkeypatch.setattr(mismatch, "finding_tables", lambda *_: {"mismatch_findings": [{}]})
    monkeypatch.setattr(mismatch.stored_visits, "store_visit", lambda *given: kept.update(given[4]))
    description = {
        "visit": "2024-05-07",
        "identity": "a",
        "changes": (),
        "every_group": ["A1"],
        "notes": [Note("too short", "p1"), Note("no force")],
    }
    group = SimpleNamespace(labels=("A1",), route="main", campaign=None, neighbours=("A1",))
    turnout = SimpleNamespace(id="t1", settings={"mismatch": None})
    options = mismatch.Options(fits=str(tmp_path))
    mismatch._diagnose_group(group, turnout, (), description, options, (0, 1))
    assert [list(note) for note in kept["notes"]] == [
        ["2024-05-07", "too short", True],
        ["2024-05-07", "no force", False],
    ]


def test_a_case_that_contradicts_itself_is_reported_for_its_group_and_ends_no_diagnosis(tmp_path, monkeypatch):
    monkeypatch.setattr(mismatch, "TrackCase", lambda *_, **__: SimpleNamespace(observations=(), reserved=()))
    about = {"visit": "2024-05-07", "identity": "a", "changes": (), "every_group": ["A1"], "notes": []}
    group = SimpleNamespace(labels=("A1",), route="main", campaign=None, neighbours=("A1",))
    turnout = SimpleNamespace(id="t1", raw="t1", settings={"mismatch": None})
    rows = mismatch._diagnose_group(group, turnout, (), about, mismatch.Options(fits=str(tmp_path)), (0, 1))
    (row,) = rows.pop("quarantine")
    assert "sections A1: the case has no observations" in row["found"] and not rows
