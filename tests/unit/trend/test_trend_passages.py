"""Trends from ordinary trains: weekly values with their own errors, separate from those of hammer tests."""

import numpy as np
import pandas as pd
import pytest
from tests.oracles.trend_views import connect_views

from turnout.report.trains import ROWS as OF_TRAINS
from turnout.trend import baseline_rows, chart_rows, chart_status, evaluate

NEWEST = "2018-12-31"


@pytest.fixture(scope="module")
def trains():
    """Three passages a day for two years at four sections; one resonance falls, one amplitude grows."""
    rng = np.random.default_rng(1)
    when = pd.Timestamp("2017-01-02 05:00") + pd.to_timedelta(np.arange(3 * 728) * 8, unit="h")
    year = (when - when[0]).days.to_numpy() / 365.25
    rail = 11 + 12 * np.sin(2 * np.pi * (year - 0.3)) + rng.normal(0, 3, when.size)
    speed = rng.uniform(80, 160, when.size)
    ids = [f"p{i:05d}" for i in range(when.size)]
    passages = pd.DataFrame({"passage_id": ids, "turnout_id": "T1", "passed_at_utc": when, "speed_kmh": speed,
                             "status": "accepted", "rail_temperature_c": rail})  # fmt: skip
    modes, fits = [], []
    for s in range(4):
        falling = -3.0 * np.maximum(year - 1.2, 0) if s == 2 else 0.0
        error = rng.uniform(2.0, 8.0, when.size)
        frequency = 150 * (1 + (-0.1 * (rail - 11) + falling) / 100) + error * rng.standard_normal(when.size)
        modes.append(pd.DataFrame({"model_id": [f"m{s}{i}" for i in ids], "band": "ballast", "turnout_id": "T1",
                                   "section_id": f"T1/S{s}", "measured_at_utc": when, "frequency_hz": frequency,
                                   "frequency_se_hz": error, "rail_temperature_c": rail,
                                   "source": "passage"}))  # fmt: skip
        louder = 0.15 * (year > 1.5) if s == 1 else 0.0
        for channel in ("a", "b"):
            peak = (
                (50 if channel == "a" else 300)
                * (speed / 120) ** 1.6
                * np.exp(louder + 0.3 * rng.standard_normal(when.size))
            )
            fits.append(pd.DataFrame({"passage_id": ids, "section_id": f"T1/S{s}", "channel": f"{channel}{s}",
                                      "model_id": "m", "turnout_id": "T1", "passed_at_utc": when, "status": "accepted",
                                      "peak_ms2": peak}))  # fmt: skip
    fits = pd.concat(fits)
    # Channel b0 has six times the amplitude of its neighbour and fails after a year and a half.
    fits = fits[(fits["channel"] != "b0") | (fits["passed_at_utc"] < "2018-07-01")]
    return {"passages": passages, "modes": pd.concat(modes), "passage_fits": fits}


@pytest.fixture(scope="module")
def weekly(trains):
    with connect_views(trains, NEWEST, rounded=False) as con:
        return con.execute("select * from chart_values order by all").df()


def test_weekly_values_are_weighted_means_with_the_error_of_their_scatter(trains, weekly):
    found = weekly.query("section_id == 'T1/S0' and band == 'ballast'").set_index("measured_at_utc")
    rows = trains["modes"].query("section_id == 'T1/S0'")
    for week, part in rows.groupby(rows["measured_at_utc"].dt.to_period("W").dt.start_time):
        weight = part["frequency_se_hz"] ** -2.0
        assert found.loc[week, "frequency_hz"] == pytest.approx(np.average(part["frequency_hz"], weights=weight))
        assert found.loc[week, "frequency_se_hz"] == pytest.approx(part["frequency_hz"].sem())
    assert set(weekly["source"]) == {"passage"} and len(found) == 104


def test_amplitudes_are_taken_at_the_usual_speed(weekly):
    loud = weekly.query("band == 'amplitude' and section_id == 'T1/S3'")
    # 21 trains x 2 sensors with a scatter of 30 %: 0.3 / sqrt(42) = 4.6 % a week. The spread of speeds, uncorrected,
    # would add 1.6 x 20 % / sqrt(21) = 7 %.
    assert np.std(np.log(loud["frequency_hz"])) == pytest.approx(0.046, rel=0.25)
    assert (loud["frequency_se_hz"] / loud["frequency_hz"]).median() == pytest.approx(0.046, rel=0.15)


def test_a_failed_sensor_does_not_shift_the_level(weekly):
    value = weekly.query("band == 'amplitude' and section_id == 'T1/S0'").set_index("measured_at_utc")["frequency_hz"]
    before, after = np.log(value[:"2018-06-24"]), np.log(value["2018-07-02":])
    assert abs(before.mean() - after.mean()) < 4 * np.hypot(before.sem(), after.sem())


def test_charts_of_trains_alarm_at_the_changed_sections_alone(weekly, settings):
    charts = evaluate(weekly, None, settings)
    status = chart_status(charts, settings).set_index(["section_id", "band"])
    assert status.loc[("T1/S2", "ballast"), "state"] == "alarm"
    assert status.loc[("T1/S1", "amplitude"), "state"] == "alarm"
    quiet = status.drop(index=[("T1/S2", "ballast"), ("T1/S1", "amplitude")])
    assert not (quiet["state"] == "alarm").any()
    rows = chart_rows(charts)
    assert rows.query("band == 'amplitude'")["expected_hz"].isna().all()
    assert rows.query("band == 'ballast' and section_id != '*'")["expected_hz"].notna().all()


def test_the_expected_band_of_a_page_holds_the_weeks_of_unchanged_sections(trains, weekly, settings):
    """S1 is 15 % louder after a year and a half, three standard deviations of a week."""
    charts = evaluate(weekly, None, settings)
    frames = trains | {"charts": chart_rows(charts), "baselines": baseline_rows(charts, settings)}
    sql = OF_TRAINS["weeks"].format(own="'T1'", charts="charts", baselines="baselines")
    with connect_views(frames, NEWEST, rounded=False) as con:
        weeks = con.execute(sql).df().set_index("section_id")
    is_inside = weeks["peak_ms2"].between(weeks["expected_low_ms2"], weeks["expected_high_ms2"])
    assert is_inside.loc[["T1/S0", "T1/S2", "T1/S3"]].mean() == pytest.approx(0.96, abs=0.03)
    is_late = (weeks["week_utc"] > "2018-07-09").to_numpy()
    assert (weeks["peak_ms2"] > weeks["expected_high_ms2"])[is_late].loc["T1/S1"].mean() > 0.6
    middle = 0.5 * (weeks["expected_low_ms2"] + weeks["expected_high_ms2"])
    mean = weeks["peak_ms2"][~is_late].groupby("section_id").mean()
    assert (middle[~is_late].groupby("section_id").mean() / mean).to_numpy() == pytest.approx(1.0, abs=0.02)


def passages(when, speed, peak):
    """Frames of one sensor of one section under single trains."""
    ids = [f"p{i:04d}" for i in range(len(when))]
    common = {"passage_id": ids, "turnout_id": "T1", "passed_at_utc": when, "status": "accepted"}
    return {
        "passages": pd.DataFrame(common | {"speed_kmh": speed, "rail_temperature_c": 15.0}),
        "passage_fits": pd.DataFrame(
            common | {"section_id": "T1/A7", "channel": "A7", "model_id": "m", "peak_ms2": peak}
        ),
    }


def amplitudes(*parts):
    frames = passages(*(np.concatenate(part) for part in zip(*parts)))
    with connect_views(frames, NEWEST, rounded=False) as con:
        return con.execute("select * from passage_values order by all").df()


@pytest.mark.parametrize("wrong", [["2000-01-01 00:05"], ["2000-01-01 00:05", "2000-01-01 00:15"]])
def test_passages_with_a_reset_clock_do_not_change_the_amplitudes(wrong):
    """Ten trains a week for 60 weeks, with peaks ~ speed to the power 1.2; one or two trains of the year 2000."""
    rng = np.random.default_rng(7)
    weeks, k = np.divmod(np.arange(600), 10)
    when = np.datetime64("2017-01-02T06:00", "us") + weeks * np.timedelta64(7, "D") + k * np.timedelta64(3, "h")
    speed = rng.uniform(60.0, 160.0, 600)
    sound = when, speed, 0.02 * speed**1.2 * np.exp(0.05 * rng.standard_normal(600))
    reset = np.array(wrong, "datetime64[us]"), np.array([70.0, 150.0])[: len(wrong)], np.full(len(wrong), 9.0)
    expected, found = amplitudes(sound), amplitudes(sound, reset)
    assert len(expected) == 60 and expected["frequency_hz"].between(5.0, 8.0).all()
    pd.testing.assert_frame_equal(found, expected)


@pytest.mark.parametrize("speed", [np.full(6, 100.0), np.linspace(99.9, 100.1, 6)], ids=["one speed", "like one"])
def test_equal_speeds_give_no_exponent_and_peaks_are_not_corrected(speed):
    """A week of one speed, and one at 60 km/h two years later: a line through points of one abscissa has no slope."""
    peak, hours = np.array([4.0, 5.0, 6.0, 7.0, 8.0, 9.0]), np.arange(6) * np.timedelta64(1, "h")
    first, later = np.datetime64("2016-01-05T06:00", "us") + hours, np.datetime64("2018-01-02T06:00", "us") + hours
    found = amplitudes((first, speed, peak), (later, np.full(6, 60.0), 1.1 * peak))
    usual = np.exp(np.log(peak).mean())
    assert found["frequency_hz"].to_list() == pytest.approx([usual, 1.1 * usual], rel=1e-12)
