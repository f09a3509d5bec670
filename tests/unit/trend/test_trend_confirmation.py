"""A campaign far outside its expected range is listed on the same day, and raises no alarm alone."""

import re

import numpy as np
import pandas as pd
import pytest
from benchmarks.trend_fleet import Fleet, modes
from benchmarks.trend_oracle import cusum_by_loop
from tests.unit.trend.evaluated_views import KEYS, evaluated_views

from turnout.report.formatting import badge
from turnout.report.panels.diagram import diagram
from turnout.report.panels.history import history_panel
from turnout.trend import evaluate
from turnout.trend.cusum import cusum


def with_loss(fleet, seed, percent, campaigns, sections=(0,)):
    """The sections lose ``percent`` in the campaigns of the given numbers, at every turnout."""
    week = np.arange(0, fleet.weeks, fleet.every)
    change = np.zeros((fleet.turnouts, fleet.sections, week.size))
    change[:, list(sections), :] = np.isin(np.arange(week.size), np.arange(week.size)[list(campaigns)]) * -percent
    return modes(fleet, seed, change)


def listed(con, state="confirm now"):
    query = "select turnout_id, sections from worklist(newest_measurement(), most := 1) where state = ?"
    return con.execute(query, [state]).fetchall()


@pytest.mark.parametrize(
    ("weeks", "every", "sigma", "temperature"),
    [(60, 1, 0.6, True), (80, 4, 1.5, True), (60, 1, 0.6, False), (6, 1, 1.0, True)],
    ids=["weekly", "28 d, noisy", "without a rail temperature", "the sixth campaign"],
)
def test_a_loss_of_twenty_percent_is_on_the_list_the_same_day(settings, weeks, every, sigma, temperature):
    fleet = Fleet(turnouts=20, weeks=weeks, every=every, sigma=sigma, phi=0.4)
    rows = with_loss(fleet, 5, 20.0, [-1])
    rows.loc[(rows["measured_at_utc"] == rows["measured_at_utc"].max()) & (not temperature), "rail_temperature_c"] = (
        np.nan
    )
    with evaluated_views(rows, settings) as con:
        found = listed(con)
    assert {r[0] for r in found if "S0" in r[1].split(", ")} == {f"T{i:05d}" for i in range(20)}
    assert len(found) <= 21  # nothing else of 160 charts; the sections of one turnout share a row


def test_the_row_states_the_deviation_and_the_campaign_to_repeat(settings):
    fleet = Fleet(turnouts=2, weeks=60, band="ballast", frequency=150.0)
    with evaluated_views(with_loss(fleet, 5, 33.0, [-1]), settings) as con:
        row = con.execute("select * from worklist order by rank limit 1").df().iloc[0]
        states = con.execute("select state, count(*) from chart_states group by all").fetchall()
    assert row["state"] == "confirm now" and row["sections"] == "S0" and row["direction"] == "down"
    assert row["change_pct"] == pytest.approx(-33.0, abs=3.0)
    assert row["change_low_pct"] < row["change_pct"] < row["change_high_pct"] < -25
    assert "2017-02-20" in row["sentence"] and " below its expected value; not yet confirmed" in row["sentence"]
    assert "repeat the hammer test" in row["look_at"] and "ballast" in row["look_at"]
    assert "one campaign alone is no alarm" in row["false_alarm_words"]
    assert ("confirm now", 2) in states


def test_the_row_names_the_campaign_as_its_folder_does(settings):
    """A test after midnight local time: in UTC it began on the day before."""
    rows = with_loss(Fleet(turnouts=2, weeks=60), 5, 33.0, [-1])
    newest = rows["measured_at_utc"].max()
    night = newest.floor("D") - pd.Timedelta(hours=1.5)
    rows.loc[rows["measured_at_utc"] == newest, "measured_at_utc"] = night
    folder = f"{newest:%Y-%m-%d}"
    models = pd.DataFrame(
        {
            "model_id": ["m"], "turnout_id": ["T00000"], "section_id": ["T00000/S0"],
            "campaign_id": [f"T00000/{folder}"], "measured_at_utc": [night],
        }
    )  # fmt: skip
    later = night + pd.Timedelta(days=200)
    why = f"select why from cannot_see(timestamp '{later}') where turnout_id = ? and state = 'not measured'"
    with evaluated_views(rows, settings, models=models) as con:
        sentences = dict(
            con.execute("select turnout_id, sentence from worklist where state = 'confirm now'").fetchall()
        )
        unmeasured = [con.execute(why, [turnout]).fetchall()[0] for turnout in ("T00000", "T00001")]
    assert sentences["T00000"].startswith(f"the campaign of {folder} lies ")
    assert sentences["T00001"].startswith(f"the campaign of {night:%Y-%m-%d} lies ")  # no model: the day in UTC
    assert unmeasured == [(f"last measured {folder}",), (f"last measured {night:%Y-%m-%d}",)]


def test_a_loss_of_the_whole_turnout_is_listed_as_well(settings):
    fleet = Fleet(turnouts=2, weeks=60)
    with evaluated_views(with_loss(fleet, 5, 20.0, [-1], range(8)), settings) as con:
        rows = listed(con)
        sentences = con.execute("select sentence from worklist where state = 'confirm now'").fetchall()
    assert sorted(rows) == [("T00000", "whole turnout"), ("T00001", "whole turnout")]
    assert all(s.startswith("whole turnout: the campaign of") and "; likewise S0, S1, S2" in s for (s,) in sentences)


def test_sections_that_lie_on_opposite_sides_have_rows_of_their_own(settings):
    """As after files of two sections were exchanged: what holds for one holds for the other with the other sign."""
    fleet = Fleet(turnouts=2, weeks=60, band="ballast", frequency=150.0)
    change = np.zeros((2, 8, 60))
    change[0, 1, -1], change[0, [2, 5], -1] = -22.0, [28.0, 35.0]
    query = "select sections, direction, sentence, look_at, change_pct from worklist where state = 'confirm now'"
    with evaluated_views(modes(fleet, 5, change), settings) as con:
        above, below = con.execute(f"{query} order by direction desc").fetchall()
    assert below[:2] == ("S1", "down") and above[:2] == ("S2, S5", "up")
    assert f"lies {-below[4]:.1f} %" in below[2] and "below" in below[2] and "likewise" not in below[2]
    assert above[2].startswith("S5: the campaign of") and f"lies {above[4]:.1f} %" in above[2] and "above" in above[2]
    assert above[4] == pytest.approx(35.0, abs=3.0) and re.search(r"; likewise S2 \(2\d\.\d %\)$", above[2])
    assert "voids" in below[3] and "frost" in above[3] and "voids" not in above[3]


@pytest.mark.parametrize(
    ("table", "weeks_ago", "expected"),
    [
        ("change_findings", 0, "result of S5"),
        ("mismatch_findings", 0, "result of S5"),
        ("mismatch_findings", 2, "no decision: the diagnosis of 2017-02-20 is older than the change"),
    ],
)
def test_the_diagnosis_is_that_of_the_section_that_the_sentence_names(settings, table, weeks_ago, expected):
    """S5 lies farthest off, and S2 comes first by name. Formerly the row of S5 had the diagnosis of S2, or none.

    Formerly an effect that was named against the track file was "need no effect" for a campaign to confirm.
    """
    fleet = Fleet(turnouts=1, weeks=60, band="ballast", frequency=150.0)
    change = np.zeros((1, 8, 60))
    change[0, [2, 5], -1] = 28.0, 35.0
    rows = modes(fleet, 5, change)
    findings = pd.DataFrame(
        {
            "finding_id": ["f2", "f5"], "turnout_id": "T00000", "sections": ["S2", "S5"], "visit": "2017-02-20",
            "found_at_utc": rows["measured_at_utc"].max() - pd.Timedelta(weeks=weeks_ago), "verdict": "named",
            "term": "local_ballast", "sentence": ["result of S2", "result of S5"],
        }
    )  # fmt: skip
    if table == "change_findings":
        findings = findings.drop(columns="finding_id")
    with evaluated_views(rows, settings, **{table: findings}) as con:
        query = "select sections, sentence, diagnosis from worklist where state = 'confirm now'"
        ((sections, sentence, diagnosis),) = con.execute(query).fetchall()
    assert sections == "S2, S5" and sentence.startswith("S5: ") and diagnosis.startswith(expected)


def test_charts_that_cannot_tell_are_together_only_for_the_same_reason(settings):
    """The number of the first section is stated in words, those of the others behind their names."""
    rows = modes(Fleet(turnouts=1, weeks=130, sigma=2.0, campaign=0.0), 3, None)
    rows.loc[rows["section_id"] == "T00000/S0", "frequency_hz"] = 450.0
    with evaluated_views(rows, settings) as con:
        rows = dict(con.execute("select sections, sentence from worklist where state = 'cannot tell'").fetchall())
        query = "select split_part(section_id, '/', 2), up_to_a_tenth(detectable_pct) from cannot_see()"
        detectable = dict(con.execute(query).fetchall())
    assert rows["S0"] == "the value never changes: stuck or copied"
    sentence = rows["S1, S2, S3, S4, S5, S6, S7"]
    others = [detectable[label] for label in ("S2", "S3", "S4", "S5", "S6", "S7")]
    assert sentence.startswith(f"S1: a change below {detectable['S1']:.1f} % of frequency")
    assert sentence.endswith(f"; likewise S2, S3, S4, S5, S6, S7 ({min(others):.1f} to {max(others):.1f} %)")


def test_two_low_campaigns_raise_an_alarm_and_a_normal_campaign_ends_the_confirmation(settings):
    fleet = Fleet(turnouts=5, weeks=60)
    with evaluated_views(with_loss(fleet, 5, 20.0, [-2, -1]), settings) as con:
        assert not listed(con) and len(listed(con, "inspect this week")) == 5
    with evaluated_views(with_loss(fleet, 5, 20.0, [-2]), settings) as con:
        assert not listed(con) and not listed(con, "inspect this week")


def test_the_list_of_an_earlier_day_names_the_campaign_of_that_day(settings):
    """The list of that day still asks for the confirmation, also after later campaigns."""
    rows = with_loss(Fleet(turnouts=3, weeks=60), 5, 20.0, [-3])
    day = sorted(rows["measured_at_utc"].unique())[-3]
    with evaluated_views(rows, settings) as con:
        then = con.execute("select turnout_id, sections from worklist(?::timestamp) where state = 'confirm now'", [day])
        assert sorted(then.fetchall()) == [(f"T{i:05d}", "S0") for i in range(3)]


def test_later_maintenance_or_a_suppression_removes_the_request_for_a_confirmation(settings):
    rows = with_loss(Fleet(turnouts=2, weeks=60), 5, 20.0, [-1])
    newest = rows["measured_at_utc"].max()
    work = {"event_id": ["e"], "turnout_id": ["T00000"], "section_id": [None], "kind": ["tamping"]}
    events = pd.DataFrame({**work, "event_at_utc": [newest], "resets_ballast": [True], "resets_railpad": [True]})
    events["event_at_utc"] += pd.Timedelta("1h")
    acknowledgement = {
        "acknowledgement_id": ["a"], "turnout_id": ["T00001"], "section_id": [None], "band": [None],
        "action": ["suppress"], "by_whom": ["M. Jensen"], "at_utc": [newest], "reason": ["repeated"],
        "until_utc": [newest + pd.Timedelta("30D")],
    }  # fmt: skip
    asof = newest + pd.Timedelta("1D")
    with evaluated_views(rows, settings, events, asof, acknowledgements=pd.DataFrame(acknowledgement)) as con:
        assert not listed(con)
        states = con.execute("select section_id, state from chart_states where section_id like '%S0'").fetchall()
    assert sorted(states) == [("T00000/S0", "learning"), ("T00001/S0", "suppressed")]


@pytest.mark.parametrize(("percent", "sections"), [(4.0, [0]), (20.0, [0]), (20.0, range(8)), (-20.0, [0])])
def test_one_bad_campaign_raises_no_alarm(settings, percent, sections):
    """A chart with a bad campaign has the alarms that it has without that campaign; so has the whole turnout."""
    fleet = Fleet(turnouts=40, weeks=80, phi=0.2)
    bad = with_loss(fleet, 9, percent, [70], sections)
    is_bad = bad["measured_at_utc"] == sorted(bad["measured_at_utc"].unique())[70]
    missing = is_bad & bad["section_id"].astype(str).str[-1].isin([str(i) for i in sections])
    before, after = evaluate(bad[~missing], None, settings), evaluate(bad, None, settings)
    charts = slice(0, fleet.charts, 8) if len(sections) == 1 else slice(fleet.charts, None)
    for name in ("down_open", "up_open"):
        new, old = getattr(after, name)[charts], getattr(before, name)[charts]
        assert np.array_equal(new[:, 71:], old[:, -9:]) and not new[:, 70].any()


def test_no_single_outlier_of_ten_thousand_raises_an_alarm():
    """Sums of standard normal values with one outlier, against the same sums without that campaign."""
    rng = np.random.default_rng(8)
    n, h, k = 10_000, 3.5, 1.0
    z = rng.standard_normal((n, 40)) / 1.12
    bad, gone = z.copy(), z.copy()
    bad[:, 30], gone[:, 30] = -rng.uniform(3.0, 60.0, n), np.nan
    on, off = np.ones(z.shape, bool), np.zeros(z.shape, bool)
    limits = (np.full(z.shape, k), np.full(n, h), np.full(z.shape, 3.0), np.full(n, 0.6 * h))
    alarms = [cusum(values, *limits, on, off)[1] for values in (bad, gone)]
    new = (alarms[0] & ~alarms[1]).any(axis=1)
    # It raises an alarm only if a second outlier is next to it by chance: 2 x P(z < -3.36 sd) = 8e-4.
    assert (np.minimum(z[new, 29], z[new, 31]) < -3.0).all() and new.sum() < 20


def test_outliers_in_sql_equal_the_chart_and_a_loop(settings):
    """One, two and three in a row, alternating ones, a gap between two, ups and downs."""
    fleet, change = Fleet(turnouts=2, weeks=90, phi=0.0), np.zeros((2, 8, 90))
    patterns = ([60], [60, 61], [60, 61, 62], [60, 62, 64], [60, 63], [70, 71], [75], [80, 81, 82])
    for i, where in enumerate(patterns):
        change[0, i, where] = -6.0
        change[1, i, where] = (-6.0) ** np.arange(1, 1 + len(where)) / 6.0 ** np.arange(len(where))
    rows = modes(fleet, 4, change)
    rows = rows[~((rows["section_id"] == "T00000/S4") & rows["measured_at_utc"].rank(method="dense").isin([62, 63]))]
    with evaluated_views(rows, settings) as con:
        found = con.execute("select * from cusum(timestamp '2016-01-01')").df()
        charts, baselines = con.execute("from charts").df(), con.execute("from baselines").df()
    joined = found.merge(charts, on=[*KEYS, "measured_at_utc"], suffixes=("", "_chart"))
    assert np.abs(joined["cusum_down"] - joined["cusum_down_chart"]).max() < 1e-8
    assert np.abs(joined["cusum_up"] - joined["cusum_up_chart"]).max() < 1e-8
    loop = cusum_by_loop(charts, baselines)
    chart = charts.set_index([*KEYS, "measured_at_utc"])["cusum_down"].reindex(loop.index)
    assert np.abs(loop - chart).max() < 1e-8 and (charts["z"].abs() > 3.0).sum() > 20


def test_confirm_now_has_its_own_colour_on_the_page():
    section = {"section_id": "t/S0", "label": "S0", "position_m": 1.0, "track": "main", "panel": "open_track"}
    svg = diagram([section], {"t/S0": "confirm now"})
    assert "state-confirm" in svg and badge("confirm now") == "confirm"
    mode = {"frequency_hz": 100.0, "frequency_se_hz": 1.0, "n_impacts": 9, "damping_ratio": 0.1, "damping_se": 0.01}
    when = pd.Timestamp("2025-09-08")
    modes_ = [mode | {"measured_at_utc": when, "rail_temperature_c": 20.0}]
    chart = {"measured_at_utc": when, "expected_low_hz": 150.0, "expected_high_hz": 156.0, "state": "ok"}
    assert '<circle class="confirm"' in history_panel("ballast", modes_, [chart | {"deviation_pct": -33.0}], [])
    assert '<circle class="point"' in history_panel("ballast", modes_, [chart | {"deviation_pct": None}], [])


@pytest.mark.parametrize(("percent", "state"), [(1.0, "plan"), (3.0, "inspect this week")])
def test_a_change_below_the_target_needs_no_inspection(settings, percent, state):
    """A precise chart raises an alarm for 1 %; the target is 1.5 %."""
    fleet = Fleet(turnouts=2, weeks=110, sigma=0.1, campaign=0.1, thermometer=0.1, phi=0.0)
    rows = with_loss(fleet, 5, percent, range(56, 110))
    with evaluated_views(rows, settings) as con:
        query = "select state, look_at, sentence from worklist({}) where section_id like '%/S0'"
        for asof in ("newest_measurement()", "newest_measurement() - interval 1 day"):
            found = con.execute(query.format(asof)).fetchall()
            assert [row[0] for row in found] == [state, state]
            assert all(("nobody needs to go there" in row[2]) == (state == "plan") for row in found)
            assert all(row[1].startswith("nothing on site") == (state == "plan") for row in found)
        states = con.execute("select state from chart_states where section_id like '%/S0'").fetchall()
        assert states == [(state,), (state,)]
