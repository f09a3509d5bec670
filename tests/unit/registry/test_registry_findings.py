"""Views of findings: growth, wrong gains, mismatches without a name. The expected values are computed with numpy."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from registry_rows import Bench

from turnout.registry.database import open_registry
from turnout.workflow.batches import UnitResult

START = datetime(2025, 1, 10, 9, 0)
YEAR = 365.25 * 86400.0


def visit(turnout, day, verdict="named", term=None, values=(), sections="A7, A8", rival=None, accepted=False):
    """Result of one visit; ``values`` are (parameter, value, se, unit, position, channel)."""
    found = START + timedelta(days=day)
    identity = f"{turnout}-{sections}-{day}"
    finding = {
        "finding_id": identity, "turnout_id": turnout, "found_at_utc": found.isoformat(), "verdict": verdict,
        "grade": "A" if verdict == "named" else None, "term": term, "rival_term": rival, "probability": 0.9,
        "sections": sections, "visit": f"{found:%Y-%m-%d}", "route": "main", "place_low_m": 24.6, "place_high_m": 26.4,
        "level_before": 3.0 + day / 100, "next_measurement": "Measure again",
    }  # fmt: skip
    parameters = [
        {
            "finding_id": identity, "parameter_no": k, "turnout_id": turnout, "found_at_utc": found.isoformat(),
            "term": term, "position_m": place, "channel": channel, "parameter": name, "value": value, "value_se": se,
            "value_low": value - 2 * se, "value_high": value + 2 * se, "unit": unit, "accepted": accepted,
        }
        for k, (name, value, se, unit, place, channel) in enumerate(values)
    ]  # fmt: skip
    curve = {
        "finding_id": identity, "curve_no": 0, "turnout_id": turnout, "curve": "waveform", "x_label": "time",
        "x_unit": "s", "y_unit": "m/s²", "x": [0.0, 1.0], "measured": [1.0, 2.0], "before": [0.0, 1.0],
    }  # fmt: skip
    tables = {"mismatch_findings": [finding], "mismatch_parameters": parameters, "mismatch_curves": [curve]}
    return UnitResult(f"{turnout}/mismatch/{found:%Y-%m-%d}{sections[:1]}", turnout, "mismatch", "k", "1", "ok", tables)


def gap(turnout, day, value, se, **more):
    more.setdefault("accepted", day > 0)
    return visit(turnout, day, term="hanging_sleeper", values=[("gap", value, se, "m", 24.6, None)], **more)


DAYS = (0, 45, 95, 140, 190)
GROWING = [(0.40e-3, 0.03e-3), (0.47e-3, 0.02e-3), (0.66e-3, 0.05e-3), (0.71e-3, 0.03e-3), (0.93e-3, 0.04e-3)]
EVENT = {
    "event_id": "e1", "turnout_id": "t4", "section_id": "t4/A7", "kind": "tamping", "resets_ballast": True,
    "resets_railpad": False, "event_at_utc": (START + timedelta(days=60)).isoformat(),
}  # fmt: skip


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    results = [gap("t1", d, v, s) for d, (v, s) in zip(DAYS, GROWING)]
    results += [gap("t2", d, 0.5e-3 + 1e-6 * (d % 7), 0.05e-3) for d in DAYS]  # constant
    results += [gap("t3", d, 0.5 * v, s) for d, (v, s) in zip(DAYS[:3], GROWING)]  # grows, is small, then repaired
    results.append(visit("t3", 300, verdict="none"))
    results += [gap("t4", d, v, s) for d, (v, s) in zip(DAYS[:2], GROWING)]  # tamped since
    results.append(gap("t5", 0, 0.8e-3, 0.05e-3))  # measured once
    gain = [("gain", 1.31, 0.02, "-", None, "A8")]
    results.append(visit("t6", 0, term="sensor_gain", values=gain))
    results.append(visit("t7", 0, term="sensor_gain", values=[("gain", 1.03, 0.04, "-", None, "A7")]))
    results.append(visit("t8", 0, term="sensor_gain", values=gain))
    results.append(visit("t8", 30, verdict="none"))  # repaired
    results.append(visit("t9", 0, verdict="unknown"))
    results.append(visit("t9", 0, verdict="none", sections="OT"))
    doubtful = [("factor", 0.4, 0.1, "-", 24.6, None)]
    results.append(visit("t10", 0, verdict="a_or_b", term="local_ballast", rival="hanging_sleeper", values=doubtful))
    results.append(visit("t11", 0, term="sensor_gain", values=[("gain", 0.5, 0.03, "-", None, "A7")]))  # tamped since
    for turnout in ("t12", "t13"):
        results.append(visit(turnout, 0, verdict="unknown", sections="A7, A8, A9"))
        results.append(gap(turnout, 10, 0.8e-3, 0.05e-3, sections="OT, SP"))
        results.append(visit(turnout, 40, verdict="none", sections="A8"))
        results.append(visit(turnout, 60, verdict="none", sections="SP"))
    results.append(visit("t13", 90, verdict="none", sections="A7, A9, AS"))
    results.append(visit("t13", 90, verdict="none", sections="OT"))
    bench = Bench(tmp_path_factory.mktemp("findings"))
    assert (
        bench.register(
            *results, tables={"events": [EVENT, EVENT | {"event_id": "e2", "turnout_id": "t11", "section_id": None}]}
        ).n_rejected
        == 0
    )
    with open_registry(bench.registry) as connection:
        yield connection


def straight_line(days, values, errors):
    """Slope per year and its standard error by the weighted polynomial fit of numpy.

    numpy gives the error that follows from those of the values, and that from the scatter about the line.
    """
    year = np.array(days) * 86400.0 / YEAR
    fits = [np.polyfit(year, values, 1, w=1.0 / np.array(errors), cov=cov) for cov in ("unscaled", True)]
    return fits[0][0][0], *(float(np.sqrt(covariance[0, 0])) for _, covariance in fits)


def test_growth_is_the_weighted_straight_line(fleet):
    frame = fleet.execute("from parameter_growth where term = 'hanging_sleeper'").df().set_index("turnout_id")
    values, errors = zip(*GROWING)
    for turnout, days, factor in (("t1", DAYS, 1.0), ("t3", DAYS[:3], 0.5)):
        n = len(days)
        slope, from_errors, from_scatter = straight_line(days, factor * np.array(values[:n]), errors[:n])
        assert frame.per_year[turnout] == pytest.approx(slope, rel=1e-8)
        assert frame.per_year_se[turnout] == pytest.approx(max(from_errors, from_scatter), rel=1e-8)
        assert (from_scatter > from_errors) == (turnout == "t1")
        assert frame.n_visits[turnout] == n
    assert frame.value["t1"] == 0.93e-3 and np.isnan(frame.per_year["t5"])
    alone = fleet.execute("select per_year, per_year_se from parameter_growth where n_visits = 1").fetchall()
    assert set(alone) == {(None, None)}
    assert not frame.is_open["t3"] and frame.is_open["t1"]
    assert "t4" not in frame.index  # all its visits are before the tamping


def test_visits_that_scatter_by_more_than_their_errors_widen_the_interval_of_the_growth(tmp_path):
    """Three visits half a year apart at 0.4, 0.7 and 0.4 mm, each +- 0.05: chi squared is (1 + 4 + 1) * 4.

    It has one degree of freedom. The slope is 0, its error sqrt(24) times 0.05 mm sqrt(2) a year.
    """
    bench = Bench(tmp_path)
    bench.register(*(gap("t1", d * 365.25, v, 0.05e-3) for d, v in ((0, 0.4e-3), (0.5, 0.7e-3), (1.0, 0.4e-3))))
    with open_registry(bench.registry) as connection:
        columns = "per_year, per_year_se, mean_value, mean_value_se"
        (row,) = connection.execute(f"select {columns} from parameter_growth").fetchall()
    factor = np.sqrt(24.0)
    assert row[0] == pytest.approx(0.0, abs=1e-12)
    of_slope, of_mean = factor * 0.05e-3 * np.sqrt(2.0), factor * 0.05e-3 / np.sqrt(3.0)
    assert row[1:] == pytest.approx((of_slope, 0.5e-3, of_mean), rel=1e-6)


def test_hanging_sleepers_that_grow_are_large_open_and_growing(fleet):
    rows = fleet.execute("select turnout_id, gap_m from hanging_sleepers_that_grow()").fetchall()
    assert rows == [("t1", 0.93e-3)]
    assert fleet.execute("from hanging_sleepers_that_grow(above := 0.001)").fetchall() == []


def test_a_wrong_gain_is_listed_if_its_interval_excludes_1_and_the_finding_is_current(fleet):
    rows = fleet.execute(
        "select turnout_id, channel, gain, gain_low, gain_high from sensors_with_wrong_gain where turnout_id <> 't11'"
    ).fetchall()
    ((turnout, channel, gain, low, high),) = rows
    assert (turnout, channel, gain) == ("t6", "A8", 1.31)
    assert (low, high) == pytest.approx((1.31 - 1.959964 * 0.02, 1.31 + 1.959964 * 0.02))


def test_tamping_does_not_end_a_finding_of_a_sensor(fleet):
    """Tamping ends findings of the ballast; a gain of 0.5 stays a gain of 0.5."""
    query = "select channel, gain from sensors_with_wrong_gain where turnout_id = 't11'"
    assert fleet.execute(query).fetchall() == [("A7", 0.5)]


def test_a_finding_ends_when_each_of_its_sections_has_a_later_finding(fleet):
    """The sections of visits differ: A9 of t12 has no later finding, all sections of t13 have one."""
    query = "select sections, verdict from findings_newest where turnout_id = ? order by all"
    assert fleet.execute(query, ["t12"]).fetchall() == [
        ("A7, A8, A9", "unknown"), ("A8", "none"), ("OT, SP", "named"), ("SP", "none"),
    ]  # fmt: skip
    assert fleet.execute(query, ["t13"]).fetchall() == [
        ("A7, A9, AS", "none"), ("A8", "none"), ("OT", "none"), ("SP", "none"),
    ]  # fmt: skip
    grown = fleet.execute(
        "select turnout_id, is_open from parameter_growth where turnout_id in ('t12', 't13') order by 1"
    )
    assert grown.fetchall() == [("t12", True), ("t13", False)]


def test_mismatches_without_a_name_are_those_with_the_answer_unknown_or_a_or_b(fleet):
    rows = fleet.execute("select turnout_id, verdict, term, rival_term from mismatches_without_name order by all")
    assert rows.fetchall() == [
        ("t10", "a_or_b", "local_ballast", "hanging_sleeper"), ("t12", "unknown", None, None),
        ("t9", "unknown", None, None),
    ]  # fmt: skip


def test_the_newest_finding_of_each_group_of_sections_is_current(fleet):
    rows = fleet.execute(
        "select sections, verdict from findings_newest where turnout_id = 't9' order by all"
    ).fetchall()
    assert rows == [("A7, A8", "unknown"), ("OT", "none")]
    assert fleet.execute("select verdict from findings_newest where turnout_id = 't8'").fetchall() == [("none",)]


def test_parameters_and_curves_of_a_rejected_finding_are_rejected_too(tmp_path):
    bad = gap("t1", 0, 0.4e-3, 0.1e-3)
    bad.tables["mismatch_findings"][0]["verdict"] = "perhaps"
    bench = Bench(tmp_path)
    assert bench.register(bad).n_rejected == 1
    for table in ("mismatch_findings", "mismatch_parameters", "mismatch_curves"):
        assert bench.ask(f"select count(*) from {table}") == [(0,)]


def test_a_removed_turnout_is_in_no_list_of_findings(tmp_path):
    bench = Bench(tmp_path)
    results = []
    for t in ("t1", "t2"):
        results += [gap(t, d, v, s) for d, (v, s) in zip(DAYS, GROWING)]
        results.append(visit(t, 0, term="sensor_gain", values=[("gain", 1.3, 0.02, "-", None, "SP")], sections="SP"))
        results.append(visit(t, 0, verdict="unknown", sections="OT"))
    both = [{"turnout_id": t, "layout": "l", "config_hash": "h"} for t in ("t1", "t2")]
    lists = ("hanging_sleepers_that_grow()", "sensors_with_wrong_gain", "mismatches_without_name")
    for there in (both, both[1:]):
        bench.register(*results, tables={"turnouts": there})
        for name in lists:
            found = bench.ask(f"select turnout_id from {name} order by all")
            assert found == [(row["turnout_id"],) for row in there], name


def test_planned_maintenance_has_no_effect_before_its_day(tmp_path):
    """Tamping is planned for next month: the finding stays open until then, and the last event is the earlier one."""
    then = (datetime.now(UTC) + timedelta(days=30)).replace(tzinfo=None).isoformat()
    planned = EVENT | {"event_id": "e9", "turnout_id": "t1", "section_id": None, "event_at_utc": then}
    done = planned | {"event_id": "e8", "kind": "grinding", "event_at_utc": START.isoformat(), "resets_ballast": False}
    turnouts = [{"turnout_id": "t1", "layout": "l", "config_hash": "h"}]
    bench = Bench(tmp_path)
    bench.register(
        *[gap("t1", d, v, s) for d, (v, s) in zip(DAYS, GROWING)],
        tables={"events": [done, planned], "turnouts": turnouts},
    )
    assert bench.ask("select turnout_id, gap_m from hanging_sleepers_that_grow()") == [("t1", 0.93e-3)]
    assert bench.ask("select last_event, last_event_utc from fleet_state") == [("grinding", START)]


def line_limits(days, values, errors, size):
    """Days at which the 95 % limits of the weighted line reach a size, by root finding."""
    from scipy.optimize import brentq

    t, weights = np.array(days) / 365.25, np.array(errors) ** -2.0
    mean = weights @ t / weights.sum()
    slope, *errors_of_slope = straight_line(days, values, errors)
    slope_se, excess = max(errors_of_slope), max(1.0, errors_of_slope[1] / errors_of_slope[0])
    level = weights @ np.array(values) / weights.sum()

    def limit(year, sign):
        half = 1.959964 * np.sqrt(excess**2 / weights.sum() + (slope_se * (year - mean)) ** 2)
        return level + slope * (year - mean) + sign * half - size

    return [365.25 * brentq(limit, mean, 50.0, args=(sign,)) for sign in (1.0, -1.0)]


def test_a_growing_gap_has_dates_at_which_it_reaches_its_limit(fleet):
    rows = fleet.execute("from growth_to_limit()").df().set_index("turnout_id")
    earliest, latest = line_limits(DAYS, *zip(*GROWING), 2e-3)
    for column, days in (("not_before_utc", earliest), ("not_after_utc", latest)):
        assert abs((rows[column]["t1"] - (START + timedelta(days=days))).total_seconds()) < 60.0
    assert rows.forecast["t1"] == "date" and (rows.size_limit == 0.002).all()
    begin = START + timedelta(days=earliest)
    assert rows.words["t1"].startswith(f"gap reaches 2 mm not before {begin:%Y-%m-%d}, by ")
    assert rows.words["t1"].endswith("if it goes on like this (95 %, n = 5 visits)")
    assert rows.words["t2"].endswith("no latest date (95 %, n = 5 visits)") or rows.forecast["t2"] == "never"
    assert "t5" not in rows.index and "t3" not in rows.index  # one visit; repaired
    near = fleet.execute("select turnout_id, forecast from growth_to_limit(size_limit := 0.0008)").fetchall()
    assert ("t1", "reached") in near
    query = "select forecast, not_before_utc from growth_to_limit(size_limit := 0.0009) where turnout_id = 't1'"
    assert fleet.execute(query).fetchall() == [("open", None)]


def test_the_page_has_dates_only_for_significant_growth(fleet):
    """Only the gap of t1 grows by more than 1.96 standard errors; that of t2 is constant, t5 has one visit."""
    from turnout.report.pages.turnout import mismatches_with_limits
    from turnout.report.source import FleetSource

    rows = FleetSource(fleet).rows_of([f"t{k}" for k in range(1, 14)])
    assert list(rows["limits"]) == ["t1"]
    (limit,) = rows["limits"]["t1"]
    (words,) = fleet.execute("select words from growth_to_limit() where turnout_id = 't1'").fetchone()
    (finding,) = rows["mismatches"]["t1"]
    expected = f"hanging sleeper at 24.6 m: {words}"
    assert mismatches_with_limits([finding], [limit]) == [(finding["sentence"], [expected])]
    assert mismatches_with_limits([], [limit]) == [("", [expected])]  # accepted, and no further mismatch
    assert mismatches_with_limits([finding], []) == [(finding["sentence"], [])]


def test_a_falling_stiffness_has_the_same_dates_as_the_growing_gap_from_which_it_is_computed(tmp_path):
    """A factor of 1 - 250 g falls to 0.5 when a gap g reaches 2 mm; a rising factor has no date."""
    from turnout.report.source import FleetSource

    def stiffness(turnout, day, value, error):
        return visit(turnout, day, term="local_ballast", values=[("factor", value, error, "-", 24.6, None)])

    bench = Bench(tmp_path)
    turnouts = [{"turnout_id": t, "layout": "l", "config_hash": "h"} for t in ("t1", "t2", "t3")]
    results = [gap("t1", d, v, s) for d, (v, s) in zip(DAYS, GROWING)]
    results += [stiffness("t2", d, 1.0 - 250.0 * v, 250.0 * s) for d, (v, s) in zip(DAYS, GROWING)]
    results += [stiffness("t3", d, 0.6 + 250.0 * v, 250.0 * s) for d, (v, s) in zip(DAYS, GROWING)]
    bench.register(*results, tables={"turnouts": turnouts})
    falling = "growth_to_limit(effect := 'local_ballast', quantity := 'factor', size_limit := 0.5, falls := true)"
    dates = "select forecast, not_before_utc, not_after_utc"
    with open_registry(bench.registry) as connection:
        (of_gap,) = connection.execute(f"{dates} from growth_to_limit()").fetchall()
        of_factor = connection.execute(f"{dates}, words from {falling} where turnout_id = 't2'").fetchone()
        (rising,) = connection.execute(f"select forecast from {falling} where turnout_id = 't3'").fetchone()
        assert list(FleetSource(connection).rows_of(["t1", "t2", "t3"])["limits"]) == ["t1", "t2"]
    assert of_factor[0] == of_gap[0] == "date" and rising == "never"
    assert all(abs(a - b) < timedelta(minutes=1) for a, b in zip(of_gap[1:], of_factor[1:3]))
    assert of_factor[3].startswith(f"factor reaches 0.5 not before {of_gap[1]:%Y-%m-%d}, by ")


def test_a_shrinking_gap_has_no_date_on_the_page(tmp_path):
    from turnout.report.source import FleetSource

    bench = Bench(tmp_path)
    turnouts = [{"turnout_id": t, "layout": "l", "config_hash": "h"} for t in ("t1", "t2")]
    grows = [gap("t1", d, v, s) for d, (v, s) in zip(DAYS, GROWING)]
    shrinks = [gap("t2", d, v, s) for d, (v, s) in zip(DAYS, reversed(GROWING))]
    bench.register(*grows, *shrinks, tables={"turnouts": turnouts})
    with open_registry(bench.registry) as connection:
        assert list(FleetSource(connection).rows_of(["t1", "t2"])["limits"]) == ["t1"]


def test_the_interval_of_dates_covers_the_true_date_in_95_percent_of_cases():
    """2000 lines of linear growth with known noise: the date at which the true line reaches the limit is inside."""
    import duckdb

    from turnout.registry.view_texts import view_files

    rng, n = np.random.default_rng(5), 2000
    year, error, true_slope = np.arange(9) / 4.0, 0.05e-3, 0.4e-3
    values = 0.3e-3 + true_slope * year + rng.normal(0.0, error, (n, year.size))
    centred = year - year.mean()
    slope, level = values @ centred / (centred @ centred), values.mean(axis=1)
    con = duckdb.connect()
    frame = {
        "turnout_id": [f"t{k}" for k in range(n)], "value": values[:, -1], "per_year": slope, "mean_value": level,
    }  # fmt: skip
    import pandas as pd

    con.register("lines", pd.DataFrame(frame))
    con.execute(f"""create view parameter_growth as select *, 1.0 as position_m, null::varchar as channel, 'm' as unit,
        {error} as value_se, {error / np.sqrt(centred @ centred)} as per_year_se, 9 as n_visits, 'f' as finding_id,
        {error / 3.0} as mean_value_se, timestamp '2020-01-01' as first_at_utc, timestamp '2022-01-01' as found_at_utc,
        timestamp '2021-01-01' as mean_at_utc, true as is_open,
        'hanging_sleeper' as term, 'gap' as parameter from lines""")
    con.execute("create macro in_service(turnout) as true")
    con.execute(view_files()["growth_to_limit"])
    true_date = datetime(2020, 1, 1) + timedelta(seconds=(2.0e-3 - 0.3e-3) / true_slope * YEAR)
    query = "select avg((? between not_before_utc and not_after_utc)::integer), count(not_after_utc) from "
    query += "growth_to_limit()"
    ((share, counted),) = con.execute(query, [true_date + timedelta(days=0.25)]).fetchall()
    assert counted == n and abs(share - 0.95) < 3.0 * np.sqrt(0.05 * 0.95 / n)
