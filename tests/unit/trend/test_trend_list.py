"""The worklist keeps all open alarms, and plans and suppressions end on their day."""

import shutil
from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pytest
from benchmarks.trend_fleet import Fleet, drift, modes, step
from benchmarks.trend_registry import small_registry
from tests.unit.trend.evaluated_views import evaluated_views

from turnout.cli.worklist import as_text
from turnout.registry.database import open_registry
from turnout.registry.derived_tables import publish
from turnout.report.panels.history import history_panel
from turnout.trend import panel_of
from turnout.trend.forecast import forecast
from turnout.trend.tables import arrow_rows
from turnout.trend.update import update
from turnout.workflow.alerts import worklist_entries

ONE = (1, 4)


def work(turnout, at, section=None):
    return pd.DataFrame(
        {
            "event_id": ["e"], "turnout_id": [turnout], "section_id": [section], "event_at_utc": [pd.Timestamp(at)],
            "kind": ["tamping"], "resets_ballast": [True], "resets_railpad": [True],
        }
    )  # fmt: skip


def fallen(weeks=120):
    """Three turnouts of eight sections; one section falls by 4 % a year from week 60 on."""
    fleet, which = Fleet(turnouts=3, weeks=weeks, phi=0.1), np.zeros((3, 8), bool)
    which[ONE] = True
    return modes(fleet, 3, drift(fleet, which, -4.0, 60))


def test_a_recent_large_loss_precedes_old_drifts_and_no_open_alarm_is_cut_off(settings):
    fleet, which = Fleet(turnouts=30, weeks=156, phi=0.1), np.zeros((30, 8), bool)
    which[:25, 4] = True
    change = np.array(np.broadcast_to(drift(fleet, which, -1.5, 60), (30, 8, 156)))
    change[27, 2, -2:] -= 30.0
    with evaluated_views(modes(fleet, 3, change), settings) as con:
        rows = con.execute("select sections, turnout_id, state, n_in_all from worklist order by rank").fetchall()
        short, long = (
            con.execute(f"select count(*) from worklist(newest_measurement(), most := {most})").fetchall()[0][0]
            for most in (3, 100_000)
        )
    inspect = [r for r in rows if r[2] == "inspect this week"]
    assert rows[0][:2] == ("S2", "T00027")
    assert len(inspect) > 20 and {r[1] for r in inspect} >= {f"T{n:05d}" for n in range(25)}
    assert short == len(inspect) and rows[0][3] == long >= len(rows)


def test_an_open_alarm_stays_open_without_new_measurements(settings):
    rows = fallen()
    then = rows["measured_at_utc"].max() - pd.Timedelta(weeks=20)
    silent = rows[(rows["turnout_id"] != "T00001") | (rows["measured_at_utc"] <= then)]
    question = "select state, sentence from worklist({}) where section_id = 'T00001/S4'"
    with evaluated_views(silent, settings) as con:
        for asof in ("newest_measurement()", "newest_measurement() - interval 1 day"):
            ((state, sentence),) = con.execute(question.format(asof)).fetchall()
            assert state == "inspect this week" and f"not measured since {then:%Y-%m-%d}" in sentence
    with evaluated_views(rows, settings) as con:
        assert "not measured since" not in con.execute(question.format("newest_measurement()")).fetchall()[0][1]
        # the whole fleet is silent: its alarms are as old on the list of a later day as its other charts
        later = "newest_measurement() + interval 100 day"
        assert con.execute(f"select count(*) from chart_states_on({later}) where state = 'not measured'").fetchone()[0]
        then = rows["measured_at_utc"].max()
        assert f"not measured since {then:%Y-%m-%d}" in con.execute(question.format(later)).fetchall()[0][1]


@pytest.fixture(scope="module")
def registry_of_fallen(tmp_path_factory):
    root = tmp_path_factory.mktemp("fallen") / "registry"
    small_registry(root, fallen())
    return root


@pytest.mark.parametrize(
    ("days", "state"),
    [(400, "inspect this week"), (1, "inspect this week"), (-40000, "inspect this week"), (0, "learning")],
)
def test_planned_maintenance_does_not_reset_a_chart_before_its_day(registry_of_fallen, tmp_path, settings, days, state):
    """An event of next year, tomorrow, before the first campaign, and today after the last campaign."""
    shutil.copytree(registry_of_fallen, tmp_path, dirs_exist_ok=True)
    at = pd.Timestamp.now("UTC").tz_localize(None).floor("D") + pd.Timedelta(days=days)
    publish(tmp_path, {"events": arrow_rows("events", work("T00001", at))})
    update(tmp_path, settings)
    with open_registry(tmp_path) as con:
        assert con.execute("select state from chart_states where section_id = 'T00001/S4'").fetchall() == [(state,)]
        words = con.execute(
            "select state, false_alarm_words from worklist(newest_measurement(), most := 1000)"
        ).fetchall()
    assert all(text.startswith("not an alarm: the chart raises alarms once") for s, text in words if s == "learning")
    assert ("learning" in dict(words)) == (state == "learning")


def before_and_after_a_night(hours):
    """Two turnouts every four weeks; the first gains 5 % in a night, measured the day before and ``hours`` later."""
    fleet = Fleet(turnouts=2, weeks=200, phi=0.1, every=4, band="ballast", frequency=150.0)
    rows = modes(fleet, 3, None)
    day = sorted(rows["measured_at_utc"].unique())[40]
    after = rows[rows["measured_at_utc"] == day].assign(measured_at_utc=day + pd.Timedelta(hours=hours))
    rows, at = pd.concat([rows, after], ignore_index=True), day + pd.Timedelta(hours=14)
    rows.loc[(rows["measured_at_utc"] > at) & (rows["section_id"] == "T00000/S0"), "frequency_hz"] *= 1.05
    return rows, work("T00000", at, "T00000/S0")


@pytest.mark.parametrize("hours", [24, 40])
def test_a_test_before_and_one_after_work_are_two_campaigns(settings, hours):
    rows, events = before_and_after_a_night(hours)
    with evaluated_views(rows, settings, events) as con:
        found = con.execute("select section_id, change_pct, change_se_pct from change_since_event('tamping', 28)").df()
    one = found.set_index("section_id").loc["T00000/S0"]
    assert one["change_pct"] == pytest.approx(5.0, abs=3.0 * one["change_se_pct"]) and one["change_se_pct"] < 1.5


def test_maintenance_without_a_date_does_not_split_a_campaign(settings):
    rows, events = before_and_after_a_night(24)
    undated = events.assign(event_at_utc=pd.NaT)
    assert panel_of(rows, settings, events=undated).time.shape == panel_of(rows, settings).time.shape


def test_daily_measurements_form_campaigns_of_two_days(settings):
    """A campaign lasts 36 hours from its first value."""
    rows = modes(Fleet(turnouts=1, weeks=60, phi=0.1), 3, None)
    weeks = rows["measured_at_utc"].rank(method="dense").astype(int) - 1
    daily = rows.assign(measured_at_utc=pd.Timestamp("2020-01-01") + pd.to_timedelta(weeks, unit="D"))
    assert panel_of(daily, settings).time.shape == (1, 30)


def test_a_drift_is_listed_as_plan_although_its_chart_is_too_noisy(settings):
    """With 1.2 % of scatter every six weeks a year does not show the target, but six years show 0.5 % a year."""
    fleet = Fleet(turnouts=12, weeks=312, phi=0.0, every=6, sigma=1.2, campaign=0.3, band="ballast", frequency=150.0)
    weeks, change = np.arange(0, 312, 6), np.zeros((12, 8, 52))
    change[:8, 2, :] = -0.7 / 52.0 * np.clip(weeks - 52, 0, None)
    with evaluated_views(modes(fleet, 5, change), settings) as con:
        noisy = con.execute(
            "select section_id from chart_status where reason = 'too_noisy' and drift_q <= 0.1"
        ).fetchall()
        most = "worklist(newest_measurement(), most := 1000)"
        listed = con.execute(f"select section_id, state from {most}").fetchall()
        blind = con.execute(f"select turnout_id, sections from {most} where state = 'cannot tell'").fetchall()
        words = con.execute(
            f"select distinct state, false_alarm_words from {most} where raised_at_utc is null"
        ).fetchall()
        (why,) = con.execute(
            f"select max(sentence) from {most} where sections = 'S0, S1, S3, S4, S5, S6, S7'"
        ).fetchone()
        assert "S0: " in why and "; likewise S1, S3, S4, S5, S6, S7" in why
    assert noisy and {(section, "plan") for (section,) in noisy} <= set(listed)
    assert {text for state, text in words if state == "cannot tell"} == {
        "not an alarm: the data do not show whether the track has changed"
    }
    assert not [s for (s,) in noisy if any(t == s[:6] and s[7:] in labels.split(", ") for t, labels in blind)]


@pytest.mark.parametrize("named", [("T00000", "T00001"), ("T00000", "T00002"), ()])
def test_a_removed_turnout_is_not_listed_and_its_history_stays(settings, named):
    rows = fallen()
    turnouts = pd.DataFrame({"turnout_id": list(named), "name": "", "line": ""})
    kept = set(named or rows["turnout_id"])  # a registry without a configuration lists all turnouts
    with evaluated_views(rows, settings, turnouts=turnouts) as con:
        for asof in ("newest_measurement()", "newest_measurement() - interval 1 day"):
            listed = con.execute(
                f"select turnout_id, state, false_alarm_words from worklist({asof}, most := 1000)"
            ).fetchall()
            assert ("T00001", "inspect this week") in {row[:2] for row in listed} or "T00001" not in kept
            assert {row[0] for row in listed} <= kept
            n_charts = con.execute(
                f"select count(*) from chart_status_at({asof}) where complete and list_contains(?, turnout_id)",
                [[*kept]],
            ).fetchall()[0][0]
            words = [sentence for _, state, sentence in listed if state == "inspect this week"]
            assert all(f"of all {n_charts} charts " in sentence for sentence in words)
        assert {t for (t,) in con.execute("select distinct turnout_id from chart_states").fetchall()} == kept
        history = con.execute("select count(*) from charts where turnout_id = 'T00001'").fetchall()
        assert history[0][0] > 800
        assert con.execute("select count(*) from alarms where turnout_id = 'T00001'").fetchall()[0][0] >= 1


def test_a_section_without_a_layout_is_not_listed_and_its_history_stays(settings):
    """No user could remove it: acknowledgements and maintenance of a section without a layout are rejected."""
    rows = fallen()
    sections = pd.DataFrame({"section_id": [f"T00001/S{i}" for i in range(8)]})
    sections = sections.assign(turnout_id="T00001", label="S", left_layout=[None] * 4 + [True] + [False] * 3)
    with evaluated_views(rows, settings, sections=sections) as con:
        for asof in ("newest_measurement()", "newest_measurement() - interval 1 day"):
            listed = f"select count(*) from worklist({asof}, most := 1000) where sections like '%S4%'"
            assert con.execute(f"{listed} and turnout_id = 'T00001'").fetchall() == [(0,)]
            assert (
                con.execute(f"select count(*) from cannot_see({asof}) where section_id = 'T00001/S4'").fetchall()[0][0]
                == 0
            )
        states = con.execute("select count(*) from chart_states where turnout_id = 'T00001'").fetchall()
        assert states == [(8,)]  # seven sections and their median
        assert con.execute("select count(*) from charts where section_id = 'T00001/S4'").fetchall()[0][0] > 100
        assert con.execute("select count(*) from alarms where section_id = 'T00001/S4'").fetchall()[0][0] >= 1


def test_a_suppressed_alarm_returns_on_its_day(settings):
    rows = fallen()
    newest = rows["measured_at_utc"].max()
    acknowledgements = pd.DataFrame(
        {
            "acknowledgement_id": ["a"], "turnout_id": ["T00001"], "section_id": [None], "band": [None],
            "action": ["suppress"], "by_whom": ["M. Jensen"], "at_utc": [newest], "reason": ["renewal ordered"],
            "until_utc": [newest + pd.Timedelta("3D")],
        }
    )  # fmt: skip
    with evaluated_views(rows, settings, acknowledgements=acknowledgements) as con:
        seen = {d: con.execute(f"select count(*) from worklist(newest_measurement() + interval {d} day) "
                               "where section_id = 'T00001/S4'").fetchall()[0][0] for d in (0, 2, 3, 4000)}  # fmt: skip
        assert seen == {0: 0, 2: 0, 3: 1, 4000: 1}
        states = (
            "select state from chart_states_on(newest_measurement() + interval {} day) where section_id = 'T00001/S4'"
        )
        assert con.execute(states.format(2)).fetchall() == [("suppressed",)]
        assert con.execute(states.format(3)).fetchall() == [("inspect this week",)]


def test_a_fleet_without_new_campaigns_is_not_measured_and_its_alarm_stays(settings):
    """Weekly charts are stale after 90 days, also a chart that learns after maintenance."""
    rows = fallen()
    newest = rows["measured_at_utc"].max()
    with evaluated_views(rows, settings, work("T00002", newest - pd.Timedelta(weeks=5))) as con:
        query = "select state, count(*) from chart_states_on(newest_measurement() + interval {} day) group by all"
        states = {d: dict(con.execute(query.format(d)).fetchall()) for d in (0, 89, 91, 800)}
        assert states[0] == states[89] and states[0]["learning"] == 9
        assert states[91] == states[800] == {"inspect this week": 1, "not measured": 26}
        why = con.execute(
            "select distinct state, why from cannot_see(newest_measurement() + interval 91 day)"
        ).fetchall()
        assert why == [("not measured", f"last measured {newest:%Y-%m-%d}")]
        listed = con.execute("select section_id from worklist(newest_measurement() + interval 91 day)").fetchall()
        assert listed == [("T00001/S4",)]


def test_sections_measured_the_day_after_are_of_the_same_campaign(settings):
    """S4 to S7 a day after S0 to S3: the residuals in SQL have all eight, and the same as in one day."""
    rows = fallen()
    late = rows.assign(
        measured_at_utc=rows["measured_at_utc"]
        + pd.to_timedelta(np.where(rows["section_id"].str[-1].astype(int) >= 4, 24, 0), unit="h")
    )
    question = "select section_id, residual_pct from mode_residuals(timestamp '2016-01-01') order by all"
    found = [
        connection.execute(question).df()
        for connection in (evaluated_views(rows, settings), evaluated_views(late, settings))
    ]
    pd.testing.assert_frame_equal(*found)


def test_the_printed_list_states_its_newest_data_and_the_unmeasured_charts(tmp_path, settings, capsys, monkeypatch):
    from turnout.cli.main import main

    rows = fallen()
    newest = rows["measured_at_utc"].max()
    silent = (rows["turnout_id"] == "T00002") & (rows["measured_at_utc"] > newest - pd.Timedelta(weeks=20))
    small_registry(tmp_path, rows[~silent])
    update(tmp_path, replace(settings, worklist_rows=1))
    assert main(["worklist", "--registry", str(tmp_path)]) == 0
    output = capsys.readouterr().out
    assert "26 not measured for too long." in output  # of 2018: all but the alarm
    assert [(e["state"], bool(e["look_at"])) for e in worklist_entries(tmp_path)] == [("inspect this week", True)]
    then = f"{newest + pd.Timedelta(days=1):%Y-%m-%d}"
    assert f"The last data are of {newest:%Y-%m-%d}: " in output
    assert output.endswith(f"turnout worklist --as-of {then} shows the list of that day.\n")
    assert main(["worklist", "--registry", str(tmp_path), "--as-of", then]) == 0
    assert "26 not measured" not in capsys.readouterr().out
    pages = ["report", "--registry", str(tmp_path), "--pages", str(tmp_path / "pages")]
    assert main(pages) == 0
    assert f"turnout report --day {then} shows the pages of that day." in capsys.readouterr().out
    assert ", 26 not measured" in (tmp_path / "pages/index.html").read_text()
    assert main([*pages, "--day", then]) == 0
    assert f"As of {then}." in capsys.readouterr().out
    index = (tmp_path / "pages/index.html").read_text()
    assert ", 9 not measured" in index and f"as of {then}" in index
    assert main([*pages, "--day", "yesterday"]) == 2
    assert "--day, date: 'yesterday'. Write YYYY-MM-DD." in capsys.readouterr().err
    monkeypatch.setattr("turnout.registry.as_of.list_day", lambda connection: f"timestamp '{newest}'")
    assert main(["worklist", "--registry", str(tmp_path)]) == 0
    output = capsys.readouterr().out
    assert "INSPECT THIS WEEK: T00001" in output
    # eight sections and the turnout's median, three times; T00002 is silent
    assert f"Of 27 charts, newest campaign {newest:%Y-%m-%d}: 9 not measured for too long." in output
    assert main(["worklist", "--registry", str(tmp_path), "--as-of", f"{newest:%Y-%m-%d}"]) == 0
    assert "INSPECT THIS WEEK" in (then := capsys.readouterr().out) and "Of 27 charts" not in then


@pytest.mark.parametrize(
    ("n_unmeasured", "first_line"),
    [
        (0, "Nothing to do: of 12 charts none is in alarm or drifts."),
        (11, "Nothing to do: of 1 chart none is in alarm or drifts."),
        (12, "No answer: no chart has recent measurements by which it can be judged."),
    ],
)
def test_an_empty_list_states_that_charts_have_no_recent_measurements(n_unmeasured, first_line):
    assert as_text([], 12, 0, n_unmeasured, datetime(2026, 5, 13)).splitlines()[0] == first_line


def test_without_charts_the_list_does_not_state_that_there_is_nothing_to_do(tmp_path, capsys):
    from turnout.cli.main import main

    small_registry(tmp_path, fallen(weeks=3))
    assert main(["worklist", "--registry", str(tmp_path)]) == 0
    assert "Nothing to do" not in (output := capsys.readouterr().out) and "No chart has been computed yet" in output


@pytest.mark.parametrize(
    ("slope", "weeks", "verdict"), [(-12.0, 104, "reached"), (-40.0, 20, "reached"), (-1.0, 104, "line")]
)
def test_a_limit_that_has_been_passed_has_no_date(settings, slope, weeks, verdict):
    """A straight fall of 12 %/a over two years stands at -24 %, one of 40 %/a over 20 weeks at -15 %; limit -5 %."""
    time = 7.0 * np.arange(weeks)
    values = slope * time / 365.25 + np.random.default_rng(2).normal(0.0, 0.1, weeks)
    assert forecast(time, values, 0.0, settings).verdict == verdict


def test_all_points_of_a_two_day_campaign_in_alarm_are_red():
    day = datetime(2020, 3, 1)
    chart = {"expected_low_hz": None, "expected_high_hz": None}
    charts = [
        chart | {"measured_at_utc": day + timedelta(7 * n), "state": s} for n, s in enumerate(("ok", "alarm_down"))
    ]
    mode = {
        "frequency_se_hz": 1.0,
        "damping_ratio": 0.1,
        "damping_se": 0.01,
        "n_impacts": 5,
        "rail_temperature_c": 15.0,
    }
    modes_ = [
        mode | {"measured_at_utc": day + timedelta(7 * n, hours=h), "frequency_hz": 150.0 + n}
        for n, h in ((0, 24), (1, 0), (1, 24))
    ]
    svg = history_panel("ballast", modes_, charts, [])
    assert svg.count('class="alarm"') == 2 and svg.count('class="point"') == 1


def test_a_loss_after_a_gain_is_reported_as_a_loss(settings):
    """Frost stiffens a section for thirty weeks. Its end closes that alarm, and the loss counts from the baseline."""
    fleet = Fleet(turnouts=1, weeks=106, phi=0.0, campaign=0.3, band="ballast", frequency=150.0)
    which = (np.arange(8) == 4)[None, :]
    change = step(fleet, which, 4.0, 66) + step(fleet, which, -7.0, 96)
    rows = modes(fleet, 3, change)
    fell = rows["measured_at_utc"].min() + pd.Timedelta(weeks=96)
    for asof in ("newest_measurement()", "newest_measurement() - interval 1 day"):
        with evaluated_views(rows, settings) as con:
            opened = con.execute("select direction from alarms where closed_at_utc is null order by raised_at_utc")
            assert opened.fetchall() == [("down",)]
            names = "section_id, direction, change_low_pct, change_high_pct, since_at_utc, sentence, look_at"
            ((place, way, low, high, since, words, look),) = con.execute(
                f"select {names} from worklist({asof}) where state = 'inspect this week'"
            ).fetchall()
        assert (place, way) == ("T00000/S4", "down") and " fell by " in words and look.startswith("voids")
        assert low < -3.0 < high
        assert abs(since - fell) < pd.Timedelta(weeks=4)


def test_the_effect_of_work_on_a_whole_turnout_is_not_removed_with_the_siblings(settings):
    """New sensors of the same type, entered as such, read 2 % more in all sections."""
    fleet = Fleet(turnouts=1, weeks=120, phi=0.0, campaign=0.3)
    rows = modes(fleet, 7, step(fleet, np.ones((1, 8), bool), 2.0, 85))
    at = rows["measured_at_utc"].min() + pd.Timedelta(weeks=84, days=3)
    with evaluated_views(rows, settings, work("T00000", at).assign(resets_ballast=False, resets_railpad=False)) as con:
        found = con.execute("select change_pct, change_se_pct, changed from change_since_event('tamping', 200)").df()
    assert len(found) == 8 and found["changed"].all()
    assert ((found["change_pct"] - 2.0).abs() < 4 * found["change_se_pct"]).all()
