"""Damping ratios have charts, detectable changes and alarms like their resonances, and a recursive estimate."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pytest
from benchmarks.trend_fleet import Fleet, histories, modes, step
from benchmarks.trend_registry import small_registry
from scipy import stats
from tests.oracles.trend_views import connect_views

from turnout.registry.database import open_registry
from turnout.report.panels.history import DAMPING, history_panel
from turnout.trend import alarm_rows, chart_status, evaluate
from turnout.trend.threshold import run_lengths
from turnout.trend.update import update


def damped(seed=4, percent=-45.0):
    """Modes of two turnouts; the damping ratio of one section changes in week 80, its resonance does not."""
    fleet = Fleet(turnouts=2, weeks=130, phi=0.1)
    which = np.zeros((2, 8), bool)
    which[1, 4] = True
    damping = Fleet(turnouts=2, weeks=130, phi=0.1, sigma=5.0, campaign=3.0, frequency=0.07, coefficient=0.3)
    ratio, *_ = histories(damping, [seed, 1], step(damping, which, percent, 80))
    return modes(fleet, seed).assign(damping_ratio=ratio.ravel(), damping_se=0.002)


def test_the_nightly_update_charts_the_damping_and_lists_its_alarm(tmp_path, settings):
    rows = damped()
    small_registry(tmp_path, rows)
    update(tmp_path, settings)
    with open_registry(tmp_path) as con:
        listed = con.execute("select section_id, band, state, sentence, look_at from worklist").fetchall()
        charts = con.execute(
            "select * from damping_charts where section_id = 'T00001/S4' order by measured_at_utc"
        ).df()
        spread = con.execute(
            "select guard * sd_pct, damping_ratio from baselines "
            "where section_id = 'T00001/S4' and band = 'railpad_damping'"
        ).fetchone()
    assert [(s, b, state) for s, b, state, *_ in listed] == [("T00001/S4", "railpad_damping", "inspect this week")]
    assert listed[0][3].startswith("damping of the railpad resonance of S4 fell by 4") and "pads" in listed[0][4]
    assert "stiffness" not in listed[0][3]
    truth = rows[rows["section_id"] == "T00001/S4"]
    assert charts["damping_ratio"].to_numpy() == pytest.approx(truth["damping_ratio"].to_numpy(), rel=1e-9)
    settled = charts[charts["z"].notna() & (charts["z"].abs() > 0.2)]
    width = settled["expected_high_damping"] - settled["expected_low_damping"]
    assert width.median() == pytest.approx(2 * 1.96 * spread[0] * spread[1] / 100.0, rel=0.05)
    before = settled[settled["measured_at_utc"] < truth["measured_at_utc"].iloc[80]]
    inside = before["damping_ratio"].between(before["expected_low_damping"], before["expected_high_damping"])
    assert inside.mean() > 0.9
    assert (settled["state"] == "alarm_down").any()


@pytest.mark.parametrize(
    ("damping", "step_down", "first"), [(-45.0, -6.0, "railpad"), (-70.0, -3.0, "railpad_damping")]
)
def test_alarms_of_all_quantities_are_sorted_by_change_over_target(tmp_path, settings, damping, step_down, first):
    rows = damped(percent=damping)
    is_late = rows["measured_at_utc"] > rows["measured_at_utc"].min() + timedelta(weeks=80)
    fallen = (rows["section_id"] == "T00000/S2") & is_late
    rows.loc[fallen, "frequency_hz"] *= 1.0 + step_down / 100.0
    small_registry(tmp_path, rows)
    update(tmp_path, settings)
    with open_registry(tmp_path) as con:
        listed = con.execute(
            "select band, least(abs(w.change_low_pct), abs(w.change_high_pct)) as certain, target_pct from worklist w "
            "join chart_status using (section_id, band, source) where w.state = 'inspect this week' order by rank"
        ).df()
    assert set(listed["band"]) == {"railpad", "railpad_damping"} and listed["band"][0] == first
    assert (listed["certain"] / listed["target_pct"]).is_monotonic_decreasing


def frames_of(rows, settings):
    """Charts of the damping ratios alone, as the nightly update makes them."""
    damping = rows.assign(
        band=rows["band"].astype(object) + "_damping",
        frequency_hz=100.0 * rows["damping_ratio"],
        frequency_se_hz=100.0 * rows["damping_se"],
    )
    return evaluate(damping, None, settings)


def test_a_change_of_damping_raises_an_alarm_and_has_a_detectable_change(settings):
    charts = frames_of(damped(), settings)
    alarms = alarm_rows(charts, settings)
    assert {(r.section_id, r.band, r.direction) for r in alarms.itertuples()} == {
        ("T00001/S4", "railpad_damping", "down")
    }
    status = chart_status(charts, settings)
    sections = status[status["section_id"] != "*"]
    assert sections["detectable_pct"].between(3.0, 20.0).all() and (sections["target_pct"] == 20.0).all()


def test_one_bad_damping_is_neither_an_alarm_nor_to_be_confirmed(settings):
    rows = damped(percent=0.0)
    last = rows["measured_at_utc"] == rows["measured_at_utc"].max()
    rows.loc[last & (rows["section_id"] == "T00000/S1"), "damping_ratio"] *= 0.1
    charts = frames_of(rows, settings)
    assert alarm_rows(charts, settings).empty and not np.isfinite(charts.deviation).any()


def test_damping_adds_a_tenth_to_the_promised_false_alarms(settings):
    def rate(bands):
        return sum(np.sum(1.0 / run_lengths(bands, direction, settings)) for direction in ("down", "up"))

    resonance, damping = np.array(["ballast", "railpad"]), np.array(["ballast_damping", "railpad_damping"])
    assert rate(damping) == pytest.approx(2.0 / 56_000.0)
    assert rate(damping) <= 0.1 * rate(resonance)


def test_charts_of_damping_keep_their_rate_of_false_alarms(settings):
    fleet = Fleet(turnouts=120, weeks=156, phi=0.2, sigma=5.0, campaign=3.0, frequency=7.0, band="railpad_damping")
    charts = evaluate(modes(fleet, 12), None, replace(settings, run_length_damping=2000.0))
    alarms = alarm_rows(charts, settings)
    judged = np.isfinite(charts.z) & ~charts.learning
    expected = 2.0 * judged.sum() / 2000.0
    assert 0.1 * expected < len(alarms) < 1.2 * expected


def test_the_recursive_estimate_is_the_recursion(settings):
    rows = damped().assign(method="joint")
    rows = rows[rows["section_id"].isin(["T00001/S4"])].reset_index(drop=True)
    rows.loc[30, ["frequency_hz", "frequency_se_hz"]] = 3.0 * rows["frequency_hz"][30], 50.0
    rows.loc[::7, "damping_se"] = 0.02
    events = pd.DataFrame(
        {
            "event_id": ["e"], "turnout_id": ["T00001"], "section_id": [None], "kind": ["pad_exchange"],
            "event_at_utc": [rows["measured_at_utc"].iloc[60]], "resets_ballast": [False], "resets_railpad": [True],
        }
    )  # fmt: skip
    sections = pd.DataFrame({"section_id": ["T00001/S4"], "turnout_id": ["T00001"], "label": ["S4"]})
    rows = rows.astype({k: object for k in ("turnout_id", "section_id", "band", "source")})
    with connect_views({"modes": rows, "events": events, "sections": sections}, rows["measured_at_utc"].max()) as con:
        view = con.execute("select * from recursive_modes order by measured_at_utc").df()
    days = (rows["measured_at_utc"] - rows["measured_at_utc"].iloc[0]).dt.total_seconds().to_numpy() / 86400.0
    for column, error, name in (
        ("frequency_hz", "frequency_se_hz", "frequency_recursive_hz"),
        ("damping_ratio", "damping_se", "damping_recursive"),
    ):
        values, errors, mean, weight, expected = view[column].to_numpy(), rows[error].to_numpy(), 0.0, 0.0, []
        for k, value in enumerate(values):
            start = 60 if k >= 60 else 0
            own = 2.0 / (1.0 + (errors[k] / np.median(errors[start : k + 1])) ** 2)
            weight = own + (0.0 if k == start else weight * np.exp(-(days[k] - days[k - 1]) / 180.0))
            mean = value if k == start else mean + own * (value - mean) / weight
            expected.append(mean)
        assert view[name].to_numpy() == pytest.approx(np.array(expected), rel=1e-9)
    assert abs(view["frequency_recursive_hz"][30] / view["frequency_recursive_hz"][29] - 1.0) < 1e-3
    weights = np.exp(-7.0 * np.arange(60) / 180.0)
    weights[29] *= 2.0 / (1.0 + (50.0 / 0.1) ** 2)
    assert view["n_effective"].iloc[59] == pytest.approx(weights.sum() ** 2 / np.sum(weights**2), rel=1e-9)
    assert view["frequency_recursive_se_hz"].isna().to_numpy().nonzero()[0].tolist() == [0, 60]


def test_the_page_draws_the_damping_with_its_expected_band_and_recursive_estimate():
    when = datetime(2025, 9, 8)
    mode = {
        "frequency_hz": 611.0, "frequency_se_hz": 1.0, "damping_ratio": 0.067, "damping_se": 0.002, "n_impacts": 30,
        "rail_temperature_c": 12.0,
    }  # fmt: skip
    times = [when + timedelta(days=46 * k) for k in range(3)]
    modes_ = [mode | {"measured_at_utc": t} for t in times]
    charts = [
        {"measured_at_utc": t, "expected_low_damping": 0.06, "expected_high_damping": 0.07, "state": state}
        for t, state in zip(times, ("ok", "ok", "alarm_up"))
    ]
    recursive = [{"measured_at_utc": t, "damping_recursive": 0.067, "frequency_recursive_hz": 611.0} for t in times]
    svg = history_panel("railpad", modes_, charts, [], quantity=DAMPING, recursive=recursive)
    half = stats.t.isf(0.025, 29) * 0.002
    assert f"railpad damping: 0.0670 ± {half:.2g} (95 %), n = 30; 3 campaigns" in svg
    assert svg.count('<circle class="alarm"') == 1 and 'class="expected"' in svg
    assert "weighted mean, 180 days, not corrected for temperature" in svg
    assert "611.0 Hz, damping 0.0670 ±" in svg
