"""Every bad input of a chart has one defined result. docs/trends.md explains each to the user."""

import numpy as np
import pandas as pd
import pytest
from benchmarks.trend_fleet import Fleet, drift, modes, step

from turnout.trend import baseline_rows, candidates, chart_rows, chart_status, describe_flagged, evaluate
from turnout.trend.tables import alarm_rows

FLEET = Fleet(turnouts=1, weeks=130, phi=0.0, campaign=0.3)


def events(*rows):
    table = pd.DataFrame(rows, columns=["section_id", "event_at_utc", "kind"])
    return table.assign(
        turnout_id="T00000",
        event_at_utc=pd.to_datetime(table["event_at_utc"]),
        resets_ballast=True,
        resets_railpad=True,
    )


def status_of(rows, settings, work=None, as_of=None):
    charts = evaluate(rows, work, settings, as_of)
    status = chart_status(charts, settings)
    return describe_flagged(status, candidates(charts, status, settings), settings), charts


def section(status, name="T00000/S2"):
    return status[status["section_id"] == name].iloc[0]


def plain(rows):
    return rows.astype({"turnout_id": object, "section_id": object, "band": object, "source": object})


def test_an_event_before_the_first_campaign_does_not_change_the_chart(settings):
    rows = modes(FLEET, 1)
    without, a = status_of(rows, settings)
    early, b = status_of(rows, settings, events([None, "2015-06-01", "tamping"]))
    pd.testing.assert_frame_equal(without, early)
    assert np.array_equal(a.z, b.z, equal_nan=True)


def test_two_events_on_one_day_make_one_epoch(settings):
    rows = modes(FLEET, 1)
    one, a = status_of(rows, settings, events([None, "2017-06-07", "tamping"]))
    two, b = status_of(rows, settings, events([None, "2017-06-07", "tamping"], ["T00000/S2", "2017-06-07", "grinding"]))
    pd.testing.assert_frame_equal(one, two)
    assert b.prepared.epoch.max() == 1 and np.array_equal(a.z, b.z, equal_nan=True)


def test_a_chart_with_three_points_learns_and_raises_no_alarm(settings):
    rows = modes(Fleet(turnouts=1, weeks=3), 1)
    status, charts = status_of(rows, settings)
    sections = status[status["section_id"] != "*"]
    assert set(sections["state"]) == {"learning"} and set(sections["reason"]) == {"baseline"}
    assert alarm_rows(charts, settings).empty
    assert sections["n_campaigns"].eq(3).all()


def test_a_constant_chart_cannot_tell(settings):
    rows = modes(FLEET, 1)
    rows.loc[rows["section_id"] == "T00000/S2", "frequency_hz"] = 450.0
    status, _ = status_of(rows, settings)
    assert tuple(section(status)[["state", "reason"]]) == ("cannot_tell", "constant")


def test_a_gap_of_two_years_holds_the_chart_and_a_change_across_it_is_found(settings):
    fleet = Fleet(turnouts=1, weeks=260, phi=0.0, campaign=0.3)
    which = np.zeros((1, 8), bool)
    which[0, 2] = True
    rows = modes(fleet, 1, step(fleet, which, -3.0, 150))  # within the gap
    week = (rows["measured_at_utc"] - rows["measured_at_utc"].min()).dt.days // 7
    rows = rows[(week < 70) | (week >= 174)]
    status, _ = status_of(rows, settings)
    changed = section(status)
    assert changed["state"] == "alarm" and changed["direction"] == "down"
    assert (
        changed["since_earliest_utc"] < pd.Timestamp("2018-11-19") < changed["since_latest_utc"] + pd.Timedelta("120D")
    )
    assert set(status.loc[status["section_id"] != "T00000/S2", "state"]) == {"ok"}
    in_gap, _ = status_of(rows, settings, as_of="2018-06-01")
    assert set(in_gap["state"]) == {"not_measured"}


def test_campaigns_without_a_temperature_are_not_judged(settings):
    rows = modes(FLEET, 1)
    week = ((rows["measured_at_utc"] - rows["measured_at_utc"].min()).dt.days // 7).to_numpy()
    rows.loc[week % 2 == 0, "rail_temperature_c"] = np.nan
    status, charts = status_of(rows, settings)
    cells = chart_rows(charts)
    silent = cells[cells["state"] == "no_temperature"]
    assert len(silent) == 8 * 65 and silent["z"].isna().all()
    assert section(status)["n_baseline"] == 27  # every second week from 1 to 53: a whole year
    assert set(status["state"]) <= {"ok", "cannot_tell"} and section(status)["detectable_pct"] > 0
    assert alarm_rows(charts, settings).empty


def test_without_any_temperature_the_chart_cannot_tell(settings):
    rows = modes(FLEET, 1).assign(rail_temperature_c=np.nan)
    status, charts = status_of(rows, settings)
    assert set(status["state"]) == {"cannot_tell"}
    assert section(status)["reason"] == "no_temperature" and section(status)["without_temperature"] == 130
    assert alarm_rows(charts, settings).empty


def test_a_thermometer_that_stops_after_the_baseline_leaves_charts_that_cannot_tell(settings):
    """Fourteen months have temperatures; the other sixteen are not judged. A fall by a fifth has another cause."""
    rows = plain(modes(FLEET, 1))
    cold = rows["measured_at_utc"] >= rows["measured_at_utc"].min() + pd.Timedelta(weeks=60)
    rows.loc[cold, "rail_temperature_c"] = np.nan
    rows.loc[cold & (rows["section_id"] == "T00000/S5"), "frequency_hz"] *= 0.8
    status, _ = status_of(rows, settings)
    fallen = status["section_id"] == "T00000/S5"
    assert set(status.loc[fallen, "state"]) == {"confirm_now"}
    assert set(status.loc[~fallen, "state"]) == {"cannot_tell"}
    assert set(status.loc[~fallen & (status["section_id"] != "*"), "reason"]) == {"no_temperature"}
    # 70 days after the last temperature the gap is like any other: a chart is stale after 90 days
    soon, _ = status_of(rows, settings, as_of=rows.loc[~cold, "measured_at_utc"].max() + pd.Timedelta(days=70))
    assert set(soon.loc[~soon["section_id"].isin(["*", "T00000/S5"]), "state"]) == {"ok"}


def test_a_thermometer_that_stood_still_during_the_baseline_raises_no_alarms(settings):
    """20 turnouts whose thermometer showed 20 °C for a year and works since: their slopes are unknown."""
    fleet = Fleet(turnouts=20, weeks=156, phi=0.0)
    rows = modes(fleet, 3)
    stuck = (rows["measured_at_utc"] < pd.Timestamp("2017-01-16")).to_numpy()
    noise = 0.1 * np.random.default_rng(4).standard_normal(len(rows))
    rows.loc[stuck, "rail_temperature_c"] = 20.0 + noise[stuck]
    status, charts = status_of(rows, settings)
    # of 180 charts over two years; one false alarm is promised for such a fleet
    assert len(alarm_rows(charts, settings)) <= 2
    # a slope of 0 ± 0.5 %/°C in seasons of ±15 °C: no change of 1.5 % can be distinguished from the season
    assert set(status["state"]) == {"cannot_tell"} and set(status["reason"]) == {"too_noisy"}
    assert status["detectable_pct"].min() > 4.0
    assert not (status["drift_q"] <= settings.false_discovery).any()


@pytest.mark.parametrize("stamp", ["1970-01-01 00:00:10", "2031-05-05"], ids=["never set", "ahead"])
def test_a_campaign_with_a_wrong_clock_is_shown_and_left_out(settings, stamp):
    rows = plain(modes(FLEET, 1))
    last = rows["measured_at_utc"] == rows["measured_at_utc"].max()
    good, _ = status_of(rows[~last], settings)
    rows.loc[last, "measured_at_utc"] = pd.Timestamp(stamp)
    status, charts = status_of(rows, settings)
    pd.testing.assert_frame_equal(status, good)
    cells = chart_rows(charts)
    wrong = cells[cells["state"] == "wrong_time"]
    assert len(wrong) == 8 and (wrong["measured_at_utc"] == pd.Timestamp(stamp)).all() and wrong["z"].isna().all()


def test_a_turnout_whose_sections_are_in_alarm_is_not_called_unmeasured(settings):
    """Every week is measured; only three of the eight sections are left for the median of those without an alarm."""
    fleet = Fleet(turnouts=1, weeks=130, phi=0.0, campaign=0.3)
    three, two = (np.arange(8) < 3)[None, :], np.isin(np.arange(8), (3, 4))[None, :]
    rows = modes(fleet, 1, step(fleet, three, -12.0, 70) + step(fleet, two, -12.0, 95))
    status, _ = status_of(rows, settings)
    (whole,) = status[status["section_id"] == "*"].to_dict("records")
    assert (status[status["section_id"] != "*"]["state"] == "alarm").sum() == 5
    assert (whole["state"], whole["reason"]) == ("cannot_tell", "too_few_sections")
    late, _ = status_of(rows, settings, as_of=rows["measured_at_utc"].max() + pd.Timedelta(days=200))
    assert set(late[late["section_id"] == "*"]["reason"]) == {"too_long_ago"}


def test_missing_campaigns_raise_no_alarm(settings):
    # Taking a third of the campaigns of every section away must not raise alarms in an intact turnout.
    rows = modes(Fleet(turnouts=40, weeks=156, phi=0.2, missing=0.33), 3)
    _, charts = status_of(rows, settings)
    # 320 charts x 70 campaigns / 5600 is 4 expected; Poisson: 14 or more once in 20,000 times.
    assert len(alarm_rows(charts, settings).query("direction == 'down' and section_id != '*'")) < 14


def test_of_two_values_in_one_campaign_the_later_counts(settings):
    rows = plain(modes(FLEET, 1))
    again = rows[rows["measured_at_utc"] == rows["measured_at_utc"].max()]
    again = again.assign(measured_at_utc=again["measured_at_utc"] + pd.Timedelta("3h"), frequency_hz=444.0)
    a, _ = status_of(rows, settings)
    both, charts = status_of(pd.concat([again, rows]), settings)
    assert section(both)["n_campaigns"] == section(a)["n_campaigns"]
    assert charts.prepared.panel.frequency[0, -1] == 444.0


def test_maintenance_closes_an_open_alarm_and_the_chart_learns_again(settings):
    which = np.zeros((1, 8), bool)
    which[0, 2] = True
    rows = modes(FLEET, 4, step(FLEET, which, -3.0, 80))
    _, charts = status_of(rows, settings, events(["T00000/S2", "2017-09-06", "pad_exchange"]))
    alarms = alarm_rows(charts, settings).query("section_id == 'T00000/S2' and direction == 'down'")
    assert alarms["closed_by"].tolist() == ["event"]
    pending, _ = status_of(rows, settings, events(["T00000/S2", "2030-01-01", "pad_exchange"]))
    assert tuple(section(pending)[["state", "reason"]]) == ("learning", "after_event")


def test_two_sources_are_two_charts(settings):
    hammer, passage = plain(modes(FLEET, 1)), plain(modes(FLEET, 2)).assign(source="passage")
    both, charts = status_of(pd.concat([hammer, passage]), settings)
    alone, only = status_of(hammer, settings)
    of_hammer = (charts.prepared.charts["source"] == "hammer").to_numpy()
    assert len(both) == 2 * len(alone)
    assert np.allclose(charts.residual[of_hammer], only.residual, equal_nan=True, atol=1e-12)


def test_a_noisier_campaign_weighs_less(settings):
    which = np.zeros((1, 8), bool)
    which[0, 2] = True
    rows = modes(FLEET, 4, drift(FLEET, which, -3.0, 80))
    noisy = rows.copy()
    late = (noisy["measured_at_utc"] > "2017-10-01") & (noisy["section_id"] == "T00000/S2")
    noisy.loc[late, "frequency_se_hz"] = 25.0  # 5.5 %, ten times the chart's spread
    a, b = status_of(rows, settings)[1], status_of(noisy, settings)[1]
    assert a.down_open[2].any() and not b.down_open[2].any()


def test_large_falls_of_some_sections_raise_no_alarm_in_an_intact_section(settings):
    # Three of eight fall by 10 %: the median of the others moves by .9 sd (order statistics of four of seven).
    which = np.zeros((1, 8), bool)
    which[0, [1, 4, 6]] = True
    for seed in range(6):
        charts = evaluate(modes(FLEET, seed, step(FLEET, which, -10.0, 80)), None, settings)
        opened = (charts.down_open | charts.up_open)[:8, 80:].any(axis=1)
        assert opened[which[0]].all() and not opened[~which[0]].any()
        assert not charts.is_sibling[which[0], 90:].any() and charts.is_sibling[~which[0], 90:].all()


def test_with_the_spread_of_the_paper_a_chart_of_the_ballast_is_too_noisy(settings):
    # Table 3 of the paper, ballast: frequency and printed spread, taken as one sigma of a campaign.
    printed = {"OT": (154.6, 11.7), "SP": (167.2, 7.0), "CLP": (105.9, 20.0), "CP A7": (99.6, 5.2),
               "CP A8": (174.0, 2.7), "CP A9": (115.8, 17.6), "AS main": (155.6, 24.4),
               "AS div": (131.3, 25.3)}  # fmt: skip
    parts = []
    for i, (name, (frequency, spread)) in enumerate(printed.items()):
        fleet = Fleet(turnouts=1, sections=1, weeks=104, phi=0.0, campaign=0.0, sigma=100 * spread / frequency,
                      frequency=frequency, band="ballast", coefficient_spread=0.0)  # fmt: skip
        parts.append(plain(modes(fleet, 20 + i)).assign(section_id=f"T00000/{name}"))
    status, _ = status_of(pd.concat(parts), settings)
    blind = status[status["section_id"] != "*"].set_index("section_id")
    assert (blind.drop("T00000/CP A8")["state"] == "cannot_tell").all()
    assert (blind.drop("T00000/CP A8")["detectable_pct"] > 1.5).all()


def with_dates(rows, days):
    """The campaigns of some weeks with other dates, {week: day}, like typing errors."""
    week = ((rows["measured_at_utc"] - rows["measured_at_utc"].min()).dt.days + 1) // 7
    return rows.assign(measured_at_utc=week.map(pd.to_datetime(pd.Series(days))).fillna(rows["measured_at_utc"]))


def test_one_campaign_dated_many_years_before_all_others_begins_no_baseline(settings):
    """2000 for 2016: formerly a baseline was then complete after twelve weeks, without a summer."""
    rows = modes(FLEET, 1)
    far = with_dates(rows, {5: "2000-02-08 10:00"})
    status, charts = status_of(far, settings)
    without, other = status_of(far[far["measured_at_utc"] > pd.Timestamp("2001-01-01")], settings)
    pd.testing.assert_frame_equal(status, without)
    assert charts.prepared.baseline.count.tolist() == other.prepared.baseline.count.tolist()
    charted = chart_rows(charts)
    assert charted.loc[charted["measured_at_utc"] < pd.Timestamp("2001-01-01"), "state"].tolist() == ["wrong_time"] * 8


@pytest.mark.parametrize(
    "days", [{5: "2013-02-08"}, {5: "2000-02-08", 6: "2000-03-08"}], ids=["3 years before", "two of 2000"]
)
def test_an_acceptance_test_some_years_before_counts_and_so_do_two_old_campaigns(settings, days):
    rows = with_dates(modes(FLEET, 1), days)
    assert (rows["measured_at_utc"] < "2014-01-01").sum() == 8 * len(days)
    charted = chart_rows(status_of(rows, settings)[1])
    assert not (charted["state"] == "wrong_time").any()


def measured_alone(since, bad_first=1.0, fall=0.0):
    """S2 is tamped before week 60 and measured alone from week ``since`` to 73; from week 90 on it may fall."""
    fleet = Fleet(turnouts=1, weeks=130, phi=0.0, campaign=0.6)
    one = (np.arange(8) == 2)[None, :]
    rows = plain(modes(fleet, 1, step(fleet, one, fall, 90)))
    week = (rows["measured_at_utc"] - rows["measured_at_utc"].min()).dt.days // 7
    rows.loc[(week == 60) & (rows["section_id"] == "T00000/S2"), "frequency_hz"] *= bad_first
    alone = (week >= since) & (week < 74) & (rows["section_id"] != "T00000/S2")
    return rows[~alone], events(["T00000/S2", "2017-02-27", "tamping"])


def test_a_section_measured_alone_after_maintenance_is_later_compared_with_the_others_again(settings):
    rows, work = measured_alone(60, fall=-6.0)
    status, charts = status_of(rows, settings, work)
    changed = section(status)
    assert tuple(changed[["state", "direction"]]) == ("alarm", "down")
    assert changed["change_low_pct"] < -6.0 < changed["change_high_pct"]
    before, after = baseline_rows(charts, settings).query("section_id == 'T00000/S2'")["sd_pct"]
    # its error of 0.6 % and a median of seven, 0.6 sqrt(1 + 1.57 / 7) = 0.66; alone the campaigns' 0.6 % as well: 0.85
    assert before < 0.75 < after


def test_one_common_campaign_after_maintenance_does_not_fix_the_level_of_a_section(settings):
    """Only the first value after maintenance has siblings. It is 3 % too high: a twelfth of the level."""
    rows, work = measured_alone(61, bad_first=1.03)
    status, charts = status_of(rows, settings, work)
    raised = alarm_rows(charts, settings)
    assert raised[raised["section_id"] == "T00000/S2"].empty and section(status)["state"] in ("ok", "cannot_tell")
