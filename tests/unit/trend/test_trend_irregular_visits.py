"""The detectable change holds where campaigns come in bursts: three in a week of every quarter."""

import numpy as np
import pandas as pd
import pytest

from turnout.constants import DAYS_PER_YEAR
from turnout.trend import chart_status, evaluate
from turnout.trend.times import days

N_CHART = 250
START = pd.Timestamp("2016-01-04T09:00:00")
ONSET = 1000.0  # d after the start, when every chart changes by what it is said to detect


def bursts(change):
    """Five years of lone sections; each loses ``change`` (n_chart,) [%] on the day ``ONSET``."""
    rng, rows = np.random.default_rng(31), []
    for i in range(N_CHART):
        quarter = 91.3 * np.arange(20.0) + rng.uniform(5.0, 75.0, 20)
        time = (quarter[:, None] + np.array([0.0, 2.0, 5.0])).ravel()
        temperature = 9.0 + 14.0 * np.sin(2.0 * np.pi * (time - 119.0) / DAYS_PER_YEAR)
        temperature += 5.0 * rng.standard_normal(time.size)
        percent = 0.5 * rng.standard_normal(time.size) - 0.2 * (temperature - 9.0) - change[i] * (time >= ONSET)
        rows.append(pd.DataFrame({
            "turnout_id": f"T{i:03d}", "section_id": f"T{i:03d}/S0", "band": "railpad", "source": "hammer",
            "measured_at_utc": (START + pd.to_timedelta(time, unit="D")).astype("datetime64[us]"),
            "frequency_hz": 400.0 * (1.0 + percent / 100.0), "frequency_se_hz": 0.1, "rail_temperature_c": temperature,
        }))  # fmt: skip
    return pd.concat(rows, ignore_index=True)


def test_a_change_of_the_detectable_size_is_found_within_a_year_with_90_percent(settings):
    status = chart_status(evaluate(bursts(np.zeros(N_CHART)), None, settings), settings)[:N_CHART]
    assert set(status["campaigns_per_year"]) <= {10, 11, 12, 13, 14}  # twelve, and the ends of the baseline
    charts = evaluate(bursts(status["detectable_pct"].to_numpy()), None, settings)
    time = charts.prepared.time[:N_CHART] - days([START])[0] - ONSET
    within_a_year = (time >= 0.0) & (time <= DAYS_PER_YEAR)
    share = (charts.down_open[:N_CHART] & within_a_year).any(axis=1).mean()
    assert share == pytest.approx(0.9, abs=0.05 + 3.0 * np.sqrt(0.9 * 0.1 / N_CHART))
