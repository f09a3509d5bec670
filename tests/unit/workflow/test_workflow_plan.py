"""Scan and plan: every file is in a unit, reported, or known as unfinished; a plan changes only with its content."""

import os

import pytest

from turnout.config import load_configuration
from turnout.errors import ConfigError
from turnout.workflow.configuration_rows import configuration_rows, fleet_hash
from turnout.workflow.launch import launch
from turnout.workflow.plan import read_plan, read_problems, shard_names, shard_of, write_plans
from turnout.workflow.scan import scan, unit_id

LAYOUT = """\
sections:
  A: {panel: CP, track: main, position: 1}
  AS: {panel: AS, track: main, position: 2}
hammer:
  files: "hammer/{campaign}/{section}_{test}.{ext}"
  force: force
  response: rail
  channels:
    force: {source: 0, quantity: force}
    rail: {source: 1, quantity: acceleration}
passages:
  files: "passages/{time}.{ext}"
  channels:
    web: {source: 0, quantity: acceleration, section: A}
"""


@pytest.fixture
def fleet(tmp_path):
    (tmp_path / "config/layouts").mkdir(parents=True)
    (tmp_path / "config/layouts/main.yaml").write_text(LAYOUT)
    (tmp_path / "config/turnouts.tsv").write_text("turnout\tlayout\nt1\tmain\nt2\tmain\n")
    for name in (
        "t1/hammer/2024-05-13/A_1.uff", "t1/hammer/2024-05-13/A_2.uff", "t1/hammer/2024-05-13/AS_1.mat",
        "t1/hammer/2024-06-13/A_1.uff", "t1/passages/20240513T101500Z.tdms", "t1/campaigns.csv", "t1/README.md",
        "t2/hammer/2024-05-13/A_1.uff",
    ):  # fmt: skip
        add(tmp_path, name, b"campaign,started_at_utc\n" if name.endswith(".csv") else b"x")
    return tmp_path


def add(folder, name, content=b"x"):
    path = folder / "raw" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def turnout(fleet, name="t1"):
    return load_configuration(fleet / "config").turnout(name)


def plans(fleet, shards=1, **more):
    return write_plans(load_configuration(fleet / "config"), fleet / "raw", fleet / "work/plan", shards, **more)


def test_files_become_units(fleet):
    found = scan(turnout(fleet), fleet / "raw")
    assert {unit_id(u): [os.path.basename(f[0]) for f in u.files] for u in found.units} == {
        "t1/hammer/A/2024-05-13": ["A_1.uff", "A_2.uff"],
        "t1/hammer/A/2024-06-13": ["A_1.uff"],
        "t1/hammer/AS/2024-05-13": ["AS_1.mat"],
        "t1/passage/20240513T101500Z.tdms": ["20240513T101500Z.tdms"],
    }
    assert found.problems == []
    assert found.units[0].files[0][0] == "t1/hammer/2024-05-13/A_1.uff"


@pytest.mark.parametrize(
    "name, reported",
    [
        ("t1/hammer/2024-05-13/B_1.uff", True),
        ("t1/hammer/13-05-2024/A_1.uff", True),
        ("t1/hammer/2024-05-13/notes/A_1.uff", True),
        ("t1/passages/yesterday.tdms", True),
        ("t1/hammer/2024-05-13/.A_3.uff", False),
        ("t1/hammer/2024-05-13/A_3.uff.part", False),
        ("t1/.git/config", False),
        ("t1/hammer/2024-05-13/Thumbs.db", False),
        ("t1/hammer/2024-05-13/~$force.xlsx", False),
        ("t1/hammer/2024-05-13/A_1.uff~", True),
        ("t1/hammer/campaigns.csv", True),
    ],
)
def test_an_unknown_file_is_reported_unless_it_is_unfinished_or_hidden(fleet, name, reported):
    add(fleet, name)
    found = scan(turnout(fleet), fleet / "raw")
    assert [(e.path, e.reason) for e in found.problems] == ([(name, "name_unknown")] if reported else [])
    assert len(found.units) == 4


def remedies(fleet, name):
    return [e.remedy for e in scan(turnout(fleet, name), fleet / "raw").problems]


def test_the_remedy_for_an_unknown_file_fits_what_it_may_be(fleet):
    add(fleet, "t1/campaigns.csv.bak")  # the table is beside it: renaming the backup would replace the table
    add(fleet, "t2/Campaigns.csv")
    add(fleet, "t2/hammer/2024-05-13/A_1.uff~")
    pattern_words = "Rename it after 'hammer/{campaign}/{section}_{test}.{ext}' or 'passages/{time}.{ext}'"
    assert remedies(fleet, "t1") == ["Remove it, or copy what it adds into campaigns.csv, which is read"]
    assert remedies(fleet, "t2") == [
        "If it is the table campaigns.csv, rename it to that", f"{pattern_words}. Remove it if it is no recording",
    ]  # fmt: skip


@pytest.mark.parametrize(("kind", "other"), [("passages", "hammer"), ("hammer", "passages")])
def test_a_file_of_a_kind_that_the_layout_lacks_is_told_from_a_misspelt_name(fleet, kind, other):
    layout = fleet / "config/layouts/main.yaml"
    sections, rest = LAYOUT.split("hammer:\n", 1)
    hammer, passages = rest.split("passages:\n", 1)
    layout.write_text(sections + {"passages": f"hammer:\n{hammer}", "hammer": f"passages:\n{passages}"}[kind])
    texts = remedies(fleet, "t1")
    assert texts and all(f", or add the part '{kind}' to the layout 'main'. Remove it if" in text for text in texts)
    assert not any(f"add the part '{other}'" in text for text in texts)


def test_a_link_out_of_the_raw_root_is_not_followed(fleet, tmp_path):
    (tmp_path / "secret").mkdir()
    (tmp_path / "secret/A_9.uff").write_bytes(b"x")
    (fleet / "raw/t1/hammer/2024-05-13/A_9.uff").symlink_to(tmp_path / "secret/A_9.uff")
    (fleet / "raw/t1/hammer/2024-07-01").symlink_to(tmp_path / "secret")
    found = scan(turnout(fleet), fleet / "raw")
    assert [e.reason for e in found.problems] == ["outside_root"] * 2
    assert len(found.units) == 4


def test_an_empty_folder_is_reported(fleet):
    (fleet / "raw/t2/hammer/2024-05-13/A_1.uff").unlink()
    plans(fleet)
    problems = list(read_problems(fleet / "work/plan/00of01.json"))
    assert [(t, p["reason"]) for t, p in problems] == [("t2", "nothing_found")]


@pytest.mark.parametrize(
    ("name", "detail"),
    [
        ("t1/hammer/2024-05-13/B_1.uff", ": 'B' is no section of the layout."),
        ("t1/hammer/2024-05-13/B_1.uff", ", or add its section to the layout 'main'."),
        ("t1/hammer/2024-05-13/a_1.uff", ": 'a' is no section of the layout, but 'A' is."),
        ("t1/hammer/13-05-2024/A_1.uff", ": '13-05-2024' is no day as YYYY-MM-DD."),
        ("t1/hammer/2024-05-13/A_1-2.uff", ": '1-2' is not of letters and digits alone."),
        ("t1/passages/yesterday.tdms", ": 'yesterday' is no start as YYYYMMDDTHHMMSSZ."),
        ("t1/hammer/13-05-2024/B_1.uff", "its name follows no pattern of the layout."),
        ("t1/hammer/2024-05-13/notes/A_1.uff", "its name follows no pattern of the layout."),
    ],
)
def test_the_only_part_of_a_name_that_does_not_match_the_pattern_is_reported(fleet, name, detail):
    add(fleet, name)
    (problem,) = scan(turnout(fleet), fleet / "raw").problems
    assert detail in str(problem)


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("t2/hammer/2024-13-45/A_1.uff", "'2024-13-45' is no day of the calendar"),
        ("t2/hammer/2023-02-29/A_1.uff", "'2023-02-29' is no day of the calendar"),
        ("t2/passages/20241345T101500Z.tdms", "'20241345T101500Z' is no time of the calendar"),
        ("t2/hammer/2262-05-13/A_1.uff", "'2262-05-13' is more than a year ahead"),
        ("t2/passages/19040101T000000Z.tdms", "'19040101T000000Z' is before 1990"),
    ],
)
def test_an_impossible_date_is_a_reported_problem(fleet, name, found):
    before = scan(turnout(fleet, "t2"), fleet / "raw")
    add(fleet, name)
    after = scan(turnout(fleet, "t2"), fleet / "raw")
    assert after.units == before.units
    (problem,) = after.problems
    assert (problem.path, problem.reason) == (name, "name_unknown") and found in str(problem)


def test_the_command_plan_reports_new_and_changed_units(fleet, capsys, monkeypatch):
    from turnout.cli.main import main
    from turnout.fingerprint import fingerprint
    from turnout.workflow.state import State, UnitState
    from turnout.workflow.tasks import stamp_of

    plans(fleet, shards=3)
    folders = ["--configuration", "config", "--raw", "raw", "--work", "elsewhere", "--shards", "3"]
    monkeypatch.chdir(fleet)
    algo = fingerprint("turnout.stages.hammer")
    for plan in (fleet / "work/plan").glob("*.json"):
        units = {unit_id(p.unit): UnitState(stamp_of(p), "", algo, "ok", "b") for p in read_plan(plan)}
        (fleet / "elsewhere/hammer").mkdir(parents=True, exist_ok=True)
        State({u: k for u, k in units.items() if "/hammer/" in u}).save(fleet / "elsewhere/hammer" / plan.name)

    def plan_output():
        assert main(["plan", *folders]) == 0
        return capsys.readouterr().out

    assert "5 units, 1 never computed, 0 changed" in plan_output()  # the passage
    add(fleet, "t1/hammer/2024-05-13/A_2.uff", b"another content")
    assert "changed  t1/hammer/A/2024-05-13" in plan_output()
    layout = fleet / "config/layouts/main.yaml"
    layout.write_text(layout.read_text().replace("force: {source: 0", "force: {source: 2"))
    assert "4 changed since" in plan_output()
    assert main(["plan", *folders[:2], "--raw", "nothere"]) == 2
    assert "nothere, --raw: no such folder" in capsys.readouterr().err


def test_a_plan_contains_the_units_of_the_scan(fleet):
    plans(fleet)
    planned = [p.unit for p in read_plan(fleet / "work/plan/00of01.json")]
    assert planned == [u for t in ("t1", "t2") for u in scan(turnout(fleet, t), fleet / "raw").units]


def test_a_plan_is_written_only_when_its_content_changes(fleet):
    path = fleet / "work/plan/00of01.json"
    plans(fleet)
    os.utime(path, (1, 1))
    plans(fleet)
    assert path.stat().st_mtime == 1
    add(fleet, "t2/hammer/2024-05-13/A_2.uff")
    plans(fleet)
    assert path.stat().st_mtime > 1
    assert str(fleet) not in path.read_text()


def test_only_the_shards_of_the_requested_turnouts_are_scanned(fleet):
    names = plans(fleet, shards=64, turnouts=["t2"])
    assert names == [shard_of("t2", 64)]
    assert sorted(p.name for p in (fleet / "work/plan").iterdir()) == [f"{names[0]}.json"]


def test_every_turnout_is_in_one_shard():
    names = shard_names(7)
    shares = [sum(shard_of(f"T{i:05d}", 7) == name for i in range(3500)) for name in names]
    assert sum(shares) == 3500
    # crc32 spreads ids evenly: 500 +- 5 standard deviations of a binomial with p = 1/7
    assert max(abs(s - 500) for s in shares) < 5 * (3500 / 7 * 6 / 7) ** 0.5


def test_a_corrected_campaign_changes_only_its_units(fleet):
    header = "campaign,started_at_utc,rail_temperature_c\n"
    notes = fleet / "raw/t1/campaigns.csv"
    notes.write_text(header + "2024-05-13,2024-05-13T09:00,\n2024-06-13,2024-06-13T09:00,15\n")
    plans(fleet)
    before = {unit_id(p.unit): p.note for p in read_plan(fleet / "work/plan/00of01.json")}
    notes.write_text(header + "2024-05-13,2024-05-13T09:00,12\n2024-06-13,2024-06-13T09:00,15\n")
    plans(fleet)
    after = {unit_id(p.unit): p.note for p in read_plan(fleet / "work/plan/00of01.json")}
    assert {u for u in before if before[u] != after[u]} == {"t1/hammer/A/2024-05-13", "t1/hammer/AS/2024-05-13"}


def test_a_corrected_train_changes_only_the_passages_of_its_hour(fleet):
    add(fleet, "t1/passages/20240513T201500Z.tdms")
    trains = fleet / "raw/t1/trains.csv"
    trains.write_text("passed_at_utc,type\n2024-05-13T10:16:00,IC3\n2024-05-13T20:16:00,IC3\n")
    plans(fleet)
    before = {unit_id(p.unit): p.note for p in read_plan(fleet / "work/plan/00of01.json")}
    trains.write_text("passed_at_utc,type\n2024-05-13T10:16:00,freight\n2024-05-13T20:16:00,IC3\n")
    plans(fleet)
    after = {unit_id(p.unit): p.note for p in read_plan(fleet / "work/plan/00of01.json")}
    assert {u for u in before if before[u] != after[u]} == {"t1/passage/20240513T101500Z.tdms"}


def test_a_missing_disk_stops_the_run(fleet):
    for k in range(40):
        add(fleet, f"t2/passages/202405{1 + k % 28:02d}T{k // 28:02d}0000Z.wav")
    plans(fleet)
    text = (fleet / "work/plan/00of01.json").read_text()
    (fleet / "raw/t2").rename(fleet / "raw/away")
    with pytest.raises(ConfigError, match=r"41 known files are gone, first t2/hammer"):
        plans(fleet)
    assert (fleet / "work/plan/00of01.json").read_text() == text
    plans(fleet, accept_vanished=True)
    assert (fleet / "work/plan/00of01.json").read_text() != text


@pytest.mark.parametrize("mount", ["nothing", "an empty folder", "a link to nothing", "a link to itself"])
def test_a_disk_that_is_not_mounted_stops_the_run_of_a_small_fleet(fleet, mount):
    plans(fleet)
    text = (fleet / "work/plan/00of01.json").read_text()
    (fleet / "raw").rename(fleet / "away")
    if mount == "an empty folder":
        (fleet / "raw").mkdir()
    elif mount != "nothing":
        (fleet / "raw").symlink_to("nowhere" if mount == "a link to nothing" else "raw")
    with pytest.raises(ConfigError, match=r"6 known files are gone, first t1/hammer.* Mount the disk again"):
        plans(fleet)
    assert (fleet / "work/plan/00of01.json").read_text() == text


def test_files_of_a_removed_turnout_are_not_reported_as_missing(fleet):
    """Its row was removed on purpose; its raw folder may exist or not."""
    for k in range(20):
        add(fleet, f"t2/hammer/2024-05-13/AS_{k}.mat")
    plans(fleet)
    (fleet / "config/turnouts.tsv").write_text("turnout\tlayout\nt1\tmain\n")
    plans(fleet)
    assert {p.unit.turnout for p in read_plan(fleet / "work/plan/00of01.json")} == {"t1"}


def test_a_turnouts_table_that_has_lost_all_rows_stops_the_run(fleet):
    """The file was truncated after its header: an empty worklist would suggest that nothing needs attention."""
    plans(fleet, shards=2)
    texts = {path: path.read_text() for path in (fleet / "work/plan").iterdir()}
    (fleet / "config/turnouts.tsv").write_text("turnout\tlayout\n")
    with pytest.raises(ConfigError, match=r"no row is left of the 2 turnouts of the last run, first t1\. Nothing was"):
        plans(fleet, shards=2)
    assert texts == {path: path.read_text() for path in (fleet / "work/plan").iterdir()}
    plans(fleet, shards=2, accept_vanished=True)
    plans(fleet, shards=2)


def test_an_unused_row_of_the_configuration_is_in_quarantine(fleet):
    """Otherwise an alarm would be evaluated without the maintenance that explains it."""
    before = fleet_hash(load_configuration(fleet / "config"))
    (fleet / "config/events.csv").write_text(
        "turnout,section,date,kind\nt1,,2024-05-01,tamping\nt3,,2024-05-01,tamping\n"
    )
    configuration = load_configuration(fleet / "config")
    rows = configuration_rows(configuration, fleet / "raw", [])
    (row,) = rows["quarantine"]
    assert (row["kind"], row["reason_code"]) == ("configuration", "not_counted")
    assert row["path"].endswith("events.csv") and row["place"] == "line 3, column 1" and "'t3'" in row["found"]
    assert row["turnout_id"] == "t3"
    (fleet / "config/events.csv").write_text("turnout,section,date,kind\nt1,,2024-05-01,tamping\n")
    assert len({before, fleet_hash(configuration), fleet_hash(load_configuration(fleet / "config"))}) == 3


def test_the_command_plan_states_that_the_next_run_will_stop_and_the_remedy(fleet, capsys, monkeypatch):
    from turnout.cli.main import main

    monkeypatch.chdir(fleet)
    for k in range(40):
        add(fleet, f"t2/hammer/2024-05-13/AS_{k}.mat")

    def plan_output():
        assert main(["plan", "--shards", "2"]) == 0
        return capsys.readouterr().out

    assert "gone" not in plan_output()  # no run has scanned them
    plans(fleet, shards=2)
    (fleet / "raw/t2/hammer/2024-05-13/AS_7.mat").unlink()
    text = plan_output()
    assert "1 known file is gone, t2/hammer/2024-05-13/AS_7.mat: what it gave stays" in text and "accept" not in text
    (fleet / "raw/t2").rename(fleet / "raw/away")
    text = plan_output()
    assert "the next run will stop: raw, raw root: 41 known files are gone, first t2/hammer/2024-05-13/AS_0" in text
    assert "turnout nightly -- --config accept_vanished=true" in text
    plans(fleet, shards=2, accept_vanished=True)
    assert "gone" not in plan_output()
    (fleet / "config/turnouts.tsv").write_text("turnout\tlayout\n")
    assert "the next run will stop: turnouts.tsv, the table: no row is left of the 2 turnouts" in plan_output()
    plans(fleet, shards=2, accept_vanished=True)
    assert "stop" not in plan_output()
    (fleet / "config/turnouts.tsv").write_text("turnout\tlayout\nt1\tmain\n")
    (fleet / "raw").rename(fleet / "away")
    assert main(["plan", "--shards", "2"]) == 1  # no input can be used
    assert "the next run will stop: raw, raw root: there is no such folder. Mount" in capsys.readouterr().out


def test_a_few_files_can_be_deleted(fleet):
    plans(fleet)
    (plan,) = (fleet / "work/plan").glob("*.json")
    n_before = plan.read_text().count("hammer/2024-05-13/A_1.uff")
    (fleet / "raw/t1/hammer/2024-05-13/A_1.uff").unlink()
    plans(fleet)
    assert plan.read_text().count("hammer/2024-05-13/A_1.uff") == n_before - 1


def test_a_continuous_recording_depends_on_the_trains_of_its_day(fleet):
    add(fleet, "t1/passages/20240514T000000Z.tdms")
    add(fleet, "t1/passages/20240515T000000Z.tdms")
    trains = fleet / "raw/t1/trains.csv"
    notes = []
    for kind in ("IC3", "freight"):
        trains.write_text(f"passed_at_utc,type\n20240514T1405,{kind}\n2024-05-15T14:05:00Z,IC3\n")
        plans(fleet)
        notes.append({unit_id(p.unit): p.note for p in read_plan(fleet / "work/plan/00of01.json")})
    changed = {u for u in notes[0] if notes[0][u] != notes[1][u]}
    assert changed == {"t1/passage/20240514T000000Z.tdms"}


def test_an_event_with_other_resets_has_another_id_and_a_repeated_row_is_one_event(fleet):
    header = "turnout,section,date,kind,resets,note\n"
    row = "t1,A,2024-05-20,tamping,{},first pass\n"
    ids = []
    for resets in ("ballast", "railpad"):
        (fleet / "config/events.csv").write_text(header + 2 * row.format(resets))
        configuration = load_configuration(fleet / "config")
        (event,) = configuration_rows(configuration, fleet / "raw", [])["events"]
        ids.append((event["event_id"], fleet_hash(configuration)))
    assert ids[0][0] != ids[1][0] and ids[0][1] != ids[1][1]


def test_files_of_clusters_and_loads_are_inputs_of_passage_jobs_when_they_exist(fleet, monkeypatch, repository):
    """The next run uses the clusters that `turnout trains` writes, as they are an input of the rule."""
    monkeypatch.chdir(fleet)
    assert launch({}, scan=False).learned == ()
    (fleet / "config/passages").mkdir()
    (fleet / "config/passages/clusters.json").write_text("{}")
    assert launch({}, scan=False).learned == ("config/passages/clusters.json",)
    (fleet / "config/overrides").mkdir()
    (fleet / "config/overrides/t2.yaml").write_text("settings: {passage: {assets: line7}}\n")
    (fleet / "line7").mkdir()
    (fleet / "line7/loads.json").write_text("{}")
    assert launch({}, scan=False).learned == ("config/passages/clusters.json", "line7/loads.json")
    assert "learned=RUN.learned" in (repository / "rules/passage.smk").read_text()


def test_a_first_run_needs_a_raw_root_which_may_be_empty(fleet):
    (fleet / "raw").rename(fleet / "away")
    with pytest.raises(ConfigError, match=r"raw, raw root: there is no such folder. Mount the disk"):
        plans(fleet)
    (fleet / "raw").mkdir()
    plans(fleet)
