"""config/acknowledgements.csv: lines entered by command or by hand; errors state the line and the remedy."""

import codecs
import shutil
from datetime import UTC, datetime, time
from types import SimpleNamespace

import pandas as pd
import pytest
from tests.oracles.trend_views import connect_views

from turnout.cli.main import main
from turnout.config import load_configuration
from turnout.config.acknowledgements import acknowledgement_row, read_acknowledgements
from turnout.registry.database import open_registry
from turnout.registry.derived_tables import publish
from turnout.registry.job import register
from turnout.trend.tables import arrow_rows

SECTIONS = {"T1": SimpleNamespace(tree={"sections": {"A": None}})}
HEADER = "turnout,section,band,action,by,at,until,reason\n"


@pytest.fixture
def configuration(tmp_path, repository):
    shutil.copytree(repository / "config", tmp_path / "config")
    return tmp_path / "config"


def place_of(configuration):
    config = load_configuration(configuration)
    turnout = config.turnout(config.ids[0])
    return turnout.id, turnout.sections[0].label


def test_an_alarm_is_acknowledged_and_silenced_by_command(configuration):
    turnout, label = place_of(configuration)
    options = ["--by", "M. Jensen", "--reason", "tamping, week 14", "--configuration", str(configuration)]
    assert main(["acknowledge", f"{turnout}/{label}", "--band", "ballast", "--at", "2026-03-01", *options]) == 0
    assert main(["acknowledge", turnout, "--suppress-until", "2026-05-01", "--at", "2026-03-02T08:30", *options]) == 0
    first, second = load_configuration(configuration).acknowledgements
    assert first["section_id"] == f"{turnout}/{label}" and first["reason"] == "tamping, week 14"
    assert (first["action"], second["action"]) == ("acknowledge", "suppress")
    assert second["until_utc"] == datetime(2026, 5, 1) and second["section_id"] is None and second["band"] is None
    assert first["acknowledgement_id"] != second["acknowledgement_id"]


def test_the_command_succeeds_after_writing_a_line_although_the_registry_is_unreadable(configuration, tmp_path, capsys):
    """The comparison with the open alarms is a remark: exit code 2 would state that nothing was written."""
    turnout, _ = place_of(configuration)
    register([], tmp_path / "registry", read=iter)
    shutil.copytree(tmp_path / "registry", tmp_path / "copy")
    options = ["--by", "me", "--reason", "seen", "--configuration", str(configuration)]
    assert main(["acknowledge", turnout, *options, "--registry", str(tmp_path / "copy")]) == 0
    printed = capsys.readouterr()
    assert "not compared with the open alarms" in printed.out and "is a copy" in printed.out and not printed.err
    assert len(load_configuration(configuration).acknowledgements) == 1


def test_an_acknowledgement_without_a_matching_alarm_is_reported(configuration, tmp_path, capsys):
    """An alarm of the ballast is open since February. Only a later acknowledgement of its band changes the list."""
    turnout, label = place_of(configuration)
    alarm = {
        "alarm_id": "a", "turnout_id": turnout, "section_id": f"{turnout}/{label}", "band": "ballast",
        "source": "hammer", "direction": "down", "raised_at_utc": pd.Timestamp("2026-02-01"),
    }  # fmt: skip
    register([], tmp_path / "registry", read=iter)
    publish(tmp_path / "registry", {"alarms": arrow_rows("alarms", pd.DataFrame([alarm]))})
    options = ["--by", "me", "--reason", "seen", "--configuration", str(configuration)]
    options += ["--registry", str(tmp_path / "registry")]
    for place, at, band, changes in (
        (f"{turnout}/{label}", "2026-03-01", [], True),
        (turnout, "2026-03-02", ["--band", "ballast"], True),
        (turnout, "2026-03-03", ["--band", "railpad"], False),
        (turnout, "2026-01-03", [], False),
    ):
        before = len(load_configuration(configuration).acknowledgements)
        assert main(["acknowledge", place, "--at", at, *band, *options]) == (0 if changes else 2)
        assert ("is open that was raised by" in capsys.readouterr().err) is not changes
        assert len(load_configuration(configuration).acknowledgements) == before + changes


def test_an_acknowledgement_without_a_matching_alarm_names_those_that_are_open(configuration, tmp_path, capsys):
    """The heading of a row of the worklist may name the other resonance, and no row states when an alarm was raised."""
    turnout, label = place_of(configuration)
    place = f"{turnout}/{label}"
    alarms = [
        {
            "alarm_id": name, "turnout_id": turnout, "section_id": section, "band": band, "source": "hammer",
            "direction": "down", "raised_at_utc": pd.Timestamp("2026-02-01 09:30"), "closed_at_utc": closed,
        }
        for name, section, band, closed in (
            ("a", place, "railpad", None), ("b", "*", "ballast", None),
            ("c", place, "ballast", pd.Timestamp("2026-03-01")),
        )
    ]  # fmt: skip
    register([], tmp_path / "registry", read=iter)
    options = ["--by", "me", "--reason", "seen", "--configuration", str(configuration)]
    options += ["--registry", str(tmp_path / "registry")]
    publish(tmp_path / "registry", {"alarms": arrow_rows("alarms", pd.DataFrame(alarms[2:]))})
    assert main(["acknowledge", place, "--band", "ballast", *options]) == 2
    assert f"No alarm of {turnout} is open. Nothing was written." in capsys.readouterr().err
    publish(tmp_path / "registry", {"alarms": arrow_rows("alarms", pd.DataFrame(alarms))})
    assert main(["acknowledge", place, "--band", "ballast", *options]) == 2
    named = f"{turnout}/* --band ballast, raised 2026-02-01 09:30; {place} --band railpad, raised 2026-02-01 09:30."
    assert f"Open are, times in UTC: {named} Nothing" in capsys.readouterr().err
    assert main(["acknowledge", f"{turnout}/*", "--band", "ballast", *options]) == 0


def test_a_suppression_states_how_many_charts_it_hides_and_for_how_long(configuration, tmp_path, capsys):
    """Two charts, of which one has an open alarm, and one of another section."""
    turnout, label = place_of(configuration)
    place = {"turnout_id": turnout, "section_id": f"{turnout}/{label}"}
    charts = [CHART | place | {"band": "ballast"}, CHART | place | {"band": "railpad"}]
    charts.append(CHART | {"turnout_id": turnout, "section_id": f"{turnout}/other", "band": "ballast"})
    alarm = {"alarm_id": "a", "band": "ballast", "source": "passage", "direction": "down", **place}
    alarm["raised_at_utc"] = pd.Timestamp("2026-02-01")
    register([], tmp_path / "registry", read=iter)
    tables = {"alarms": [alarm], "chart_status": charts}
    publish(tmp_path / "registry", {name: arrow_rows(name, pd.DataFrame(rows)) for name, rows in tables.items()})
    options = ["--by", "me", "--reason", "works", "--configuration", str(configuration), "--at", "2026-05-30"]
    options += ["--registry", str(tmp_path / "registry")]
    assert main(["acknowledge", place["section_id"], "--suppress-until", "2099-01-01", *options]) == 0
    assert "It hides 2 charts for 72.6 years, 1 of them with an open alarm." in capsys.readouterr().out
    assert main(["acknowledge", turnout, "--suppress-until", "2026-06-09", *options]) == 0
    assert "It hides 3 charts for 10 days, 1 of them with an open alarm." in capsys.readouterr().out


def test_a_suppression_may_begin_later_and_an_acknowledgement_may_not(configuration, capsys):
    turnout, label = place_of(configuration)
    options = ["--by", "me", "--reason", "works", "--configuration", str(configuration), "--at", "2062-03-01"]
    assert main(["acknowledge", f"{turnout}/{label}", *options]) == 2
    assert "at 2062-03-01 has not come yet" in capsys.readouterr().err
    assert main(["acknowledge", f"{turnout}/{label}", "--suppress-until", "2062-03-10", *options]) == 0
    (row,) = load_configuration(configuration).acknowledgements
    assert row["at_utc"] == datetime(2062, 3, 1)


CHART = {
    "turnout_id": "T1", "section_id": "T1/A", "source": "passage", "state": "alarm", "reason": "threshold_crossed",
    "complete": True, "stale_after_days": 90.0, "target_pct": 1.5, "n_campaigns": 100, "run_length_down": 5600.0,
    "run_length_up": 56000.0, "campaigns_per_year": 52.0, "change_pct": -3.0, "change_low_pct": -4.0,
    "change_high_pct": -2.0, "worklist_rows": 20, "statistic_ratio": 2.0,
    "last_measured_at_utc": pd.Timestamp("2026-06-01"),
}  # fmt: skip


@pytest.mark.parametrize("band", ["amplitude", "ballast", "railpad"])
def test_a_suppression_of_one_band_leaves_the_other_bands(configuration, band):
    turnout, label = place_of(configuration)
    place = {"turnout_id": turnout, "section_id": f"{turnout}/{label}"}
    options = ["--by", "me", "--reason", "sensor loose", "--at", "2026-05-30", "--configuration", str(configuration)]
    command = ["acknowledge", place["section_id"], "--band", band, "--suppress-until", "2099-01-01", *options]
    assert main(command) == 0
    bands = ("amplitude", "ballast", "railpad")
    of_band = [CHART | place | {"band": b} for b in bands]
    rows = [dict(row) for row in load_configuration(configuration).acknowledgements]
    alarm = {"direction": "down", "raised_at_utc": pd.Timestamp("2026-05-20"), "threshold": 3.5, **place}
    point = {"epoch": 0, "residual_pct": -3.0, "cusum_down": 7.0, "state": "alarm_down", **place}
    frames = {
        "chart_status": of_band, "acknowledgements": rows,
        "alarms": [alarm | {"alarm_id": b, "band": b, "source": "passage"} for b in bands],
        "baselines": [{"epoch": 0, "sd_pct": 0.6, "phi": 0.1, "band": b, "source": "passage", **place} for b in bands],
        "charts": [
            point | {"band": b, "source": "passage", "measured_at_utc": CHART["last_measured_at_utc"]} for b in bands
        ],
    }  # fmt: skip
    with connect_views({name: pd.DataFrame(rows) for name, rows in frames.items()}, "2026-06-01") as con:
        listed = con.execute("select band, state from worklist order by band").fetchall()
        charted = dict(con.execute("select band, state from chart_states").fetchall())
    assert listed == [(b, "inspect this week") for b in bands if b != band]
    assert charted == dict.fromkeys(bands, "inspect this week") | {band: "suppressed"}


def test_the_registry_accepts_an_acknowledgement_of_amplitudes_of_trains(tmp_path):
    cells = dict(
        turnout="T1", section="A", band="amplitude", action="acknowledge", by="me", at="2026-06-02", reason="x"
    )
    register([], tmp_path / "registry", read=iter)
    acknowledgements = arrow_rows("acknowledgements", pd.DataFrame([acknowledgement_row(cells)]))
    publish(tmp_path / "registry", {"acknowledgements": acknowledgements})
    with open_registry(tmp_path / "registry") as con:
        assert con.execute("select section_id, band from acknowledgements").fetchall() == [("T1/A", "amplitude")]


def test_a_registry_states_the_day_on_which_it_was_computed(tmp_path):
    before = datetime.now(UTC).date()
    register([], tmp_path / "registry", read=iter)
    with open_registry(tmp_path / "registry") as con:
        ((at,),) = con.execute("select published_at()").fetchall()
    assert before <= at.date() <= datetime.now(UTC).date() and at.time() == time()


def test_a_missing_file_means_that_there_are_no_acknowledgements(tmp_path):
    assert read_acknowledgements(tmp_path / "acknowledgements.csv") == ([], [])


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("T1,,,acknowlege,me,2026-01-01,,seen", "column 6: action is 'acknowlege'. Did you mean"),
        ("T1,,ballst,acknowledge,me,2026-01-01,,seen", "column 5: band is 'ballst'"),
        ("T1,,,acknowledge,me,1.1.2026,,seen", "column 21: at is '1.1.2026'. Write YYYY-MM-DD"),
        ("T1,,,acknowledge,me,2026-01-01,,", "reason is empty"),
        ("T1,,,suppress,me,2026-01-01T10:00+02:00,2026-02-01,seen", "with a time zone"),
        ("T1,,,suppress,me,2026-01-01,2026-02-01,a,b", "double quotes"),
        (",,,suppress,me,2026-01-01,2026-02-01,a", "column 1: turnout is empty"),
        ("T1,,,acknowledge,me,2062-03-12,,a", "column 21: at 2062-03-12 has not come yet. Write the day on which"),
        ("T1,,,suppress,me,2026-03-01,2026-02-01,a", "until 2026-02-01 is not after at 2026-03-01"),
        ("T7,,,suppress,me,2026-03-01,2026-04-01,a", "turnout 'T7' has no row"),
        ("T1,Z,,suppress,me,2026-03-01,2026-04-01,a", "column 4: turnout 'T1' has no section 'Z'"),
        ('"T1",T1/Z,,suppress,me,2026-03-01,2026-04-01,a', "column 6: turnout 'T1' has no section 'Z'"),
    ],
)
def test_a_bad_line_is_rejected_with_its_place(tmp_path, line, complaint):
    path = tmp_path / "acknowledgements.csv"
    path.write_text(HEADER + "T1,A,ballast,acknowledge,me,2026-01-01,,seen\n" + line + "\n", encoding="utf-8")
    rows, errors = read_acknowledgements(path, turnout_ids=("T1",), variants=SECTIONS)
    assert len(rows) == 1 and len(errors) == 1
    assert "line 3" in str(errors[0]) and complaint.lower() in str(errors[0]).lower()


def test_every_error_of_a_line_is_reported(tmp_path):
    path = tmp_path / "acknowledgements.csv"
    path.write_text(HEADER + "T1,,ballst,suppres,me,1.1.2026,,x\n", encoding="utf-8")
    _, errors = read_acknowledgements(path, turnout_ids=("T1",), variants=SECTIONS)
    assert [str(e).split(": ")[0] for e in errors] == [f"acknowledgements.csv, line 2, column {n}" for n in (12, 5, 23)]


def test_a_bad_line_hides_no_alarm(configuration, tmp_path, capsys, caplog):
    from benchmarks.trend_fleet import Fleet, modes
    from benchmarks.trend_registry import small_registry

    from turnout.stages.trend import trend_job
    from turnout.stages.worklist import worklist_job

    turnout, _ = place_of(configuration)
    lines = "{0},,,silence,me,2026-01-01,,x\nnowhere,,,acknowledge,me,2026-01-01,,x\n"
    lines += "{0},,,acknowledge,me,2026-01-01,,x\n"
    (configuration / "acknowledgements.csv").write_text(HEADER + lines.format(turnout), encoding="utf-8")
    root = tmp_path / "registry"
    small_registry(root, modes(Fleet(turnouts=1, weeks=60), 3))
    done = trend_job(root / "_generation.json", tmp_path / "state", configuration)
    assert worklist_job(root / "_generation.json", tmp_path / "list.csv", tmp_path / "work") == 0
    assert (tmp_path / "list.csv").read_bytes().startswith(codecs.BOM_UTF8)  # for spreadsheets
    with open_registry(root) as con:
        assert con.execute("select turnout_id, action from acknowledgements").fetchall() == [(turnout, "acknowledge")]
    assert (tmp_path / "list.csv").exists()
    assert len(done["warnings"]) == 2 and "action is 'silence'" in caplog.text and "'nowhere' has no row" in caplog.text
    assert main(["check", "--configuration", str(configuration)]) == 1
    assert "acknowledgements.csv, line 3, column 1: turnout 'nowhere' has no row" in capsys.readouterr().out


def test_a_suppression_ends_on_its_day_also_without_new_files(configuration, tmp_path):
    """The same registry on the days before and after the end of a suppression, and on a day of planned work."""
    import numpy as np
    from benchmarks.trend_fleet import Fleet, drift, modes
    from benchmarks.trend_registry import small_registry

    from turnout.registry.database import open_registry
    from turnout.stages.trend import trend_job
    from turnout.stages.worklist import worklist_job

    turnout, _ = place_of(configuration)
    fleet, which = Fleet(turnouts=1, weeks=120, phi=0.1), np.zeros((1, 8), bool)
    which[0, 4] = True
    rows = modes(fleet, 3, drift(fleet, which, -6.0, 60)).astype({"turnout_id": object, "section_id": object})
    rows = rows.assign(turnout_id=turnout, section_id=turnout + rows["section_id"].str[6:])
    line = f"{turnout},,,suppress,me,2018-04-01,2018-05-02,rails are changed\n"
    (configuration / "acknowledgements.csv").write_text(HEADER + line, encoding="utf-8")
    root = tmp_path / "registry"
    small_registry(root, rows)
    planned = {"event_id": "e", "turnout_id": turnout, "section_id": None, "kind": "tamping", "resets_ballast": True}
    planned |= {"resets_railpad": True, "event_at_utc": pd.Timestamp("2018-05-04T10:00")}
    publish(root, {"events": arrow_rows("events", pd.DataFrame([planned]))})
    listed = {}
    for day in ("2018-05-01", "2018-05-02", "2018-05-03", "2018-05-04"):
        trend_job(root / "_generation.json", tmp_path / "state", configuration, day)
        worklist_job(root / "_generation.json", tmp_path / "list.csv", tmp_path / "work", day)
        found = pd.read_csv(tmp_path / "list.csv", dtype=str).fillna("")
        assert found["asof_utc"].eq(day).all()
        listed[day] = found.loc[found["section_id"].str.endswith("S4"), "state"].tolist()
        with open_registry(root) as con:
            state = con.execute("select distinct state from chart_status where section_id like '%S4'").fetchall()
        assert state == [("learning" if day == "2018-05-04" else "alarm",)]
    assert listed["2018-05-01"] == [] and listed["2018-05-04"] == []
    assert listed["2018-05-02"] == listed["2018-05-03"] == ["inspect this week"]


def test_the_command_rejects_a_suppression_that_has_ended(configuration, capsys):
    turnout, _ = place_of(configuration)
    options = ["--by", "me", "--reason", "x", "--configuration", str(configuration)]
    assert main(["acknowledge", turnout, "--suppress-until", "2020-01-01", *options]) == 2
    assert "is not after at" in capsys.readouterr().err and not (configuration / "acknowledgements.csv").exists()


def test_the_command_rejects_an_unknown_section(configuration, capsys):
    turnout, _ = place_of(configuration)
    code = main(
        ["acknowledge", f"{turnout}/nowhere", "--by", "me", "--reason", "x", "--configuration", str(configuration)]
    )
    assert code == 2 and "no section 'nowhere'" in capsys.readouterr().err
    assert not (configuration / "acknowledgements.csv").exists()


def test_a_command_enters_maintenance_and_rejects_an_unknown_kind(configuration, capsys):
    turnout, label = place_of(configuration)
    before = (configuration / "events.csv").read_text()
    base = ["--configuration", str(configuration)]
    assert main(["events", f"{turnout}/{label}", "tamping", "2026-04-02", "--note", "machine 09-3X, night", *base]) == 0
    assert main(["events", *base]) == 0
    assert "machine 09-3X, night" in capsys.readouterr().out
    after = (configuration / "events.csv").read_text()
    assert after.startswith(before.rstrip("\n"))
    assert main(["events", turnout, "tampin", "2026-04-02", *base]) == 2
    assert main(["events", turnout, "tamping", "1926-05-20", *base]) == 2
    assert "date 1926-05-20 is before 1990 (trend.earliest_year)" in capsys.readouterr().err
    assert (configuration / "events.csv").read_text() == after


def test_work_that_resets_what_its_kind_does_not_change_has_a_remark(configuration, tmp_path, capsys):
    turnout, _ = place_of(configuration)
    base = ["--configuration", str(configuration)]
    assert main(["events", turnout, "tamping", "2026-04-02", "--resets", "railpad", *base]) == 0
    remark = "tamping changes the ballast resonance, and this row resets railpad alone"
    assert f"Note: {remark}" in capsys.readouterr().out
    (tmp_path / "raw").mkdir()
    main(["check", *base, "--raw", str(tmp_path / "raw")])
    assert f"tamping at {turnout}, 2026-04-02 (events.csv): {remark}" in capsys.readouterr().out
    assert main(["events", turnout, "tamping", "2026-05-02", "--resets", "ballast railpad", *base]) == 0
    assert "Note" not in capsys.readouterr().out
