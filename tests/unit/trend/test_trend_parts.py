"""Parts of the chart against direct computations or another library."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm
from scipy import stats
from tests.oracles.trend_views import connect_views

from turnout.trend.baseline import fit_baseline, pooled_autocorrelation, spread_and_autocorrelation
from turnout.trend.cusum import cusum
from turnout.trend.detectable_change import campaigns_a_year
from turnout.trend.drift import adjusted_p_values, slopes
from turnout.trend.epochs import epochs_of
from turnout.trend.forecast import crossing_interval, fit_line, forecast
from turnout.trend.siblings import median_of_group, median_of_siblings


def test_cusum_equals_a_plain_loop_with_resets_gaps_and_learning():
    rng = np.random.default_rng(1)
    z = rng.standard_normal((7, 60)) - 0.4
    z[rng.random(z.shape) < 0.2] = np.nan
    active = np.isfinite(z) & (rng.random(z.shape) < 0.9)
    fresh = rng.random(z.shape) < 0.04
    k, h = rng.uniform(0.3, 1.2, z.shape), rng.uniform(2.0, 4.0, 7)
    outlier, confirmed = rng.uniform(0.5, 1.5, z.shape), rng.uniform(1.0, 2.0, 7)
    statistic, opened, began = cusum(z, k, h, outlier, confirmed, active, fresh)
    n_confirmed = n_returned = 0
    for c in range(7):
        total, highest, alarm, since, waiting, side_before = 0.0, 0.0, False, -1, 0.0, 0
        for i in range(60):
            if fresh[c, i]:
                total, highest, alarm, waiting, side_before = 0.0, 0.0, False, 0.0, 0
            held_low = False
            if active[c, i]:
                side = int(np.sign(z[c, i])) if abs(z[c, i]) > outlier[c, i] else 0
                gain = confirmed[c] if side < 0 else -z[c, i] - k[c, i]
                if side == 0:
                    total, waiting = max(0.0, total + gain), 0.0
                elif side == side_before:
                    total, waiting, n_confirmed = max(0.0, total + gain + waiting), 0.0, n_confirmed + 1
                else:
                    waiting, held_low = gain, side < 0
                side_before = side
            if alarm and 0.0 < total <= highest - h[c]:
                total, n_returned = 0.0, n_returned + 1
            highest = max(highest, total)
            if total == 0.0:
                alarm, highest = False, 0.0
                if (np.isfinite(z[c, i]) and not held_low) or fresh[c, i]:
                    since = i
            alarm = alarm or total > h[c]
            assert statistic[c, i] == pytest.approx(total, abs=1e-12)
            assert opened[c, i] == alarm
            assert began[c, i] == since
    assert n_confirmed > 5 and n_returned > 0


def test_cusum_is_the_running_sum_above_its_lowest_point():
    # S_i = P_i - min(0, min P): Page's other form.
    z = np.random.default_rng(2).standard_normal((3, 200))
    on = np.ones(z.shape, bool)
    limits = np.full(z.shape, 0.5), np.full(3, 5.0), np.full(z.shape, np.inf), np.zeros(3)
    statistic, _, _ = cusum(z, *limits, on, ~on, closes_on_return=False)
    running = np.cumsum(-z - 0.5, axis=1)
    assert np.allclose(statistic, running - np.minimum(0, np.minimum.accumulate(running, axis=1)), atol=1e-9)


@pytest.mark.parametrize("n_changed", [5, 50, 500])
def test_a_return_closes_an_alarm_after_h_over_k_campaigns_however_long_the_change_lasted(n_changed):
    z = np.concatenate([np.zeros(20), np.full(n_changed, -3.0), np.zeros(20)])[None]
    on, k, h = np.ones(z.shape, bool), 0.5, 4.2
    _, is_open, _ = cusum(z, np.full(z.shape, k), np.array([h]), np.full(z.shape, np.inf), np.zeros(1), on, ~on)
    opening = 20 + int(np.ceil(h / (3.0 - k))) - 1
    closing = 20 + n_changed + int(np.ceil(h / k)) - 1
    assert np.flatnonzero(is_open[0]).tolist() == list(range(opening, closing))


@pytest.mark.parametrize("size", [1, 2, 3, 4, 7, 8])
def test_the_median_of_the_others_equals_a_direct_computation(size):
    rng = np.random.default_rng(size)
    values = np.round(rng.standard_normal((3 * size, 20)), 1)
    mask = rng.random(values.shape) < 0.7
    group = np.repeat(np.arange(3), size)
    median, others = median_of_siblings(values, mask, group)
    whole, count = median_of_group(values, mask, group)
    for c in range(3 * size):
        for i in range(20):
            rest = [values[j, i] for j in range(3 * size) if j != c and group[j] == group[c] and mask[j, i]]
            assert others[c, i] == len(rest)
            assert np.isnan(median[c, i]) if not rest else median[c, i] == pytest.approx(np.median(rest))
    for g in range(3):
        for i in range(20):
            inside = values[group == g, i][mask[group == g, i]]
            assert count[g, i] == inside.size
            assert np.isnan(whole[g, i]) if not inside.size else whole[g, i] == pytest.approx(np.median(inside))


def test_baseline_equals_regression_with_a_level_for_each_epoch(settings):
    rng = np.random.default_rng(3)
    n = 60
    time = np.arange(n)[None] * 7.0
    temperature = 12 + 15 * np.sin(time / 58) + rng.standard_normal((1, n))
    epoch = (time >= 140.0).astype(int)
    frequency = 150.0 - 0.2 * (temperature - 10) + 3.0 * epoch + 0.5 * rng.standard_normal((1, n))
    frequency[0, 7] = np.nan
    temperature[0, 11] = np.nan
    base, corrected = fit_baseline(frequency, temperature, time, epoch, settings)
    inside = base.inside[0]
    assert inside.sum() == base.count[0] == 50 and base.complete[0]  # 52 weekly campaigns less the two without a value
    design = np.column_stack([epoch[0] == 0, epoch[0] == 1, temperature[0] - base.reference[0]])[inside].astype(float)
    f0 = frequency[0, inside & (epoch[0] == 0)].mean()
    percent = 100 * (frequency[0, inside] / f0 - 1)
    scale = sm.OLS(percent, design).fit().scale
    # the prior of the slope, 0 ± 0.5 %/°C, is one more observation of it
    known = np.vstack([design, [0.0, 0.0, np.sqrt(scale) / 0.5]])
    fit = sm.OLS(np.append(percent, 0.0), known).fit()
    assert base.frequency[0] == pytest.approx(f0, rel=1e-12)
    assert base.slope[0] == pytest.approx(fit.params[2], rel=1e-9)
    assert base.slope_se[0] == pytest.approx(np.sqrt(scale * np.linalg.inv(known.T @ known)[2, 2]), rel=1e-9)
    spread, _ = spread_and_autocorrelation(corrected, base.inside, epoch, base.freedom, time)
    assert spread[0] == pytest.approx(np.sqrt(np.sum(fit.resid[:-1] ** 2) / (50 - 3)), rel=1e-9)


def test_the_slope_follows_from_the_data_of_a_year_and_without_temperatures_from_the_prior(settings):
    """100 charts of one slope, scatter s = 0.6 %: its error is s / sqrt(52 var(T) + (s / 0.5)²) by Gauss."""
    rng = np.random.default_rng(8)
    time = np.tile(np.arange(60) * 7.0, (100, 1))
    season = 12.0 + 15.0 * np.sin(time / 58.1)
    for reading in (season, 20.0 + 0.1 * rng.standard_normal(time.shape)):
        error = 0.6 / np.sqrt(52 * np.var(reading[:, :52], axis=1) + (0.6 / 0.5) ** 2)
        frequency = 450.0 * (1.0 + (-0.3 * (reading - reading.mean()) + 0.6 * rng.standard_normal(time.shape)) / 100.0)
        base, _ = fit_baseline(frequency, reading, time, np.zeros(time.shape, int), settings)
        assert base.slope_se == pytest.approx(error, rel=0.35)  # the scatter of 52 values is known to a tenth
        # within the stated error of the truth, which is drawn from the prior: a chi-squared with 100
        assert np.mean(((base.slope + 0.3) / base.slope_se) ** 2) < 1.6


def test_pooled_memory_is_unbiased_where_a_single_chart_is_not():
    rng = np.random.default_rng(4)
    n_chart, n, phi = 3000, 52, 0.4
    noise = rng.standard_normal((n_chart, n))
    for i in range(1, n):
        noise[:, i] = phi * noise[:, i - 1] + np.sqrt(1 - phi**2) * noise[:, i]
    on = np.ones(noise.shape, bool)
    zero = np.zeros(noise.shape, int)
    _, memory = spread_and_autocorrelation(
        noise, on, zero, np.full(n_chart, n - 1), np.arange(n)[None] * np.ones((n_chart, 1))
    )
    pooled = pooled_autocorrelation(memory, np.zeros(n_chart, int))[0]
    # One chart scatters by sqrt((1 - phi^2)/n) = 0.13, 3000 by 0.0023; Marriott and Pope leave terms of 1/n^2, and
    # the ends at 0 and 0.9 bite in 0.1 % of the charts: 0.015 holds all.
    assert pooled == pytest.approx(phi, abs=0.015)
    assert np.std(memory) == pytest.approx(np.sqrt((1 - phi**2) / n), rel=0.15)


@pytest.mark.parametrize(("n", "phi", "within"), [(52, 0.4, 0.02), (26, 0.4, 0.04), (13, 0.4, 0.06), (13, 0.2, 0.06)])
def test_pooled_memory_of_a_short_baseline_with_a_fitted_temperature_slope(n, phi, within):
    """A mean and a season are removed: the estimate is too small by (2 + 4 phi) / n, 0.28 at 13 campaigns.

    Terms of 1/n^2 are left, and the ends at 0 and 0.9, which raise what scatters by 0.25 about 0.2.
    """
    rng = np.random.default_rng(5)
    n_chart = 6000
    noise = rng.standard_normal((n_chart, n))
    for i in range(1, n):
        noise[:, i] = phi * noise[:, i - 1] + np.sqrt(1 - phi**2) * noise[:, i]
    design = np.column_stack([np.ones(n), np.sin(2 * np.pi * np.arange(n) / n + 0.7)])
    residual = noise - noise @ np.linalg.pinv(design).T @ design.T
    time = np.arange(n)[None] * np.ones((n_chart, 1))
    on, zero = np.ones(noise.shape, bool), np.zeros(noise.shape, int)
    _, memory = spread_and_autocorrelation(residual, on, zero, np.full(n_chart, n - 2), time)
    assert pooled_autocorrelation(memory, np.zeros(n_chart, int))[0] == pytest.approx(phi, abs=within)


def events(rows):
    table = pd.DataFrame(rows, columns=["turnout_id", "section_id", "event_at_utc", "resets_ballast", "resets_railpad"])
    return table.assign(event_at_utc=pd.to_datetime(table["event_at_utc"]), kind="tamping")


CHARTS = pd.DataFrame(
    {"turnout_id": ["A", "A", "A", "B"], "band": ["ballast", "railpad", "ballast", "ballast"],
     "section_id": ["A/1", "A/1", "A/2", "B/1"]}
)  # fmt: skip
WEEKS = np.tile(np.arange(10.0) * 7, (4, 1))


def test_epochs_follow_flag_section_and_turnout():
    day = "1970-01-20"
    epoch, pending, started = epochs_of(CHARTS, WEEKS, events([["A", "A/1", day, True, False]]))
    assert epoch[0].tolist() == [0, 0, 0] + [1] * 7
    assert not epoch[1:].any() and not pending.any()
    assert started[0, 1] == 19.0 and np.isnan(started[0, 0])
    epoch, _, _ = epochs_of(CHARTS, WEEKS, events([["A", None, day, True, True]]))
    assert epoch[:3, 3].tolist() == [1, 1, 1] and epoch[3].max() == 0


def test_an_event_on_the_day_of_a_campaign_counts_before_it():
    epoch, _, _ = epochs_of(CHARTS, WEEKS, events([["A", None, "1970-01-15", True, False]]))
    assert epoch[0].tolist() == [0, 0] + [1] * 8  # 1970-01-15 is day 14, the third campaign


def test_slope_and_p_value_without_memory_are_those_of_ordinary_regression():
    rng = np.random.default_rng(9)
    time = np.sort(rng.uniform(0, 1000, (5, 40)), axis=1)
    values = rng.standard_normal((5, 40)) - 0.001 * time
    mask = rng.random((5, 40)) < 0.8
    slope, error, p_value = slopes(values, time, mask, np.zeros(5))
    for c in range(5):
        fit = sm.OLS(values[c, mask[c]], sm.add_constant(time[c, mask[c]] / 365.25)).fit()
        assert slope[c] == pytest.approx(fit.params[1], rel=1e-9)
        assert error[c] == pytest.approx(fit.bse[1], rel=1e-9)
        assert p_value[c] == pytest.approx(fit.pvalues[1], rel=1e-8)


def test_discoveries_equal_statsmodels():
    p = np.random.default_rng(10).uniform(size=200) ** 3
    p[::7] = np.nan
    known = np.isfinite(p)
    expected = sm.stats.multipletests(p[known], method="fdr_bh")[1]
    assert np.allclose(adjusted_p_values(p)[known], expected, atol=0.0, rtol=1e-12)
    assert np.isnan(adjusted_p_values(p)[~known]).all()


def test_line_equals_generalised_least_squares():
    rng = np.random.default_rng(11)
    time, phi = np.sort(rng.choice(np.arange(400), 60, replace=False)) * 7.0, 0.5
    values = rng.standard_normal(60) - 0.01 * time
    coefficient, covariance, rss, freedom = fit_line(time, values, phi)
    lag = np.abs(time[:, None] - time[None]) / np.median(np.diff(time))
    years = (time - time[-1]) / 365.25
    fit = sm.GLS(values, sm.add_constant(years), sigma=phi**lag).fit()
    assert np.allclose(coefficient, fit.params, atol=0.0, rtol=1e-8)
    assert np.allclose(covariance, fit.cov_params(), atol=0.0, rtol=1e-7)
    assert freedom == fit.df_resid and rss / freedom == pytest.approx(fit.scale, rel=1e-8)


@pytest.mark.parametrize("level", [-1.0, -4.9, -5.0, -5.1])
def test_the_interval_of_a_crossing_is_that_of_fieller(level):
    """Also where the level is within its error, 0.19 %, of the limit: it may be reached already."""
    coefficient, covariance, freedom = np.array([level, -0.8]), np.array([[0.02, 0.01], [0.01, 0.03]]), 30
    low, high = crossing_interval(coefficient, covariance, freedom, -5.0, 0.8)
    q = stats.t.isf(0.1, freedom)
    for t in np.linspace(0, 40, 4001):
        error = np.sqrt(covariance[0, 0] + 2 * t * covariance[0, 1] + t * t * covariance[1, 1])
        admitted = abs(coefficient[0] + coefficient[1] * t + 5.0) <= q * error
        if abs(t - low) > 0.02 and abs(t - high) > 0.02:
            assert admitted == (low <= t <= high)
    assert (low == 0.0) == (level < -4.5) and high > 0.0


def test_a_crossing_may_have_no_latest_time_and_no_time_at_all():
    wide = crossing_interval(np.array([0.0, -0.1]), np.array([[0.02, 0.0], [0.0, 0.04]]), 30, -5.0, 0.8)
    assert wide[0] > 0.0 and np.isnan(wide[1])  # the slope may be 0: no latest time
    assert np.isnan(crossing_interval(np.array([0.0, 0.5]), np.eye(2) * 1e-4, 30, -5.0, 0.8)).all()
    assert crossing_interval(np.array([-6.0, -0.1]), np.eye(2) * 1e-4, 30, -5.0, 0.8) == (0.0, 0.0)
    rising = crossing_interval(np.array([-4.95, 0.5]), np.eye(2) * 1e-2, 30, -5.0, 0.8)
    assert rising[0] == 0.0 and np.isnan(rising[1])  # it may be reached now, and not later


def test_a_forecast_has_no_date_for_constant_and_settling_charts(settings):
    rng = np.random.default_rng(12)
    time = np.arange(0, 3 * 365.0, 7.0)
    noise = 0.3 * rng.standard_normal(time.size)
    years = time / 365.25
    assert forecast(time, noise, 0.0, settings).verdict in ("no_limit", "settling")
    settled = forecast(time, -3.0 * (1 - np.exp(-years / 0.5)) + noise, 0.0, settings)
    assert settled.verdict == "settling" and np.isnan(settled.not_before)
    going = forecast(time, -1.2 * years + noise, 0.0, settings)
    assert going.verdict in ("line", "line_or_settling")
    assert 0.3 < going.not_before < (5.0 - 3.6) / 1.2 + 0.3  # the limit lies 1.17 years ahead
    assert forecast(time[:8], noise[:8], 0.0, settings).verdict == "too_short"
    assert "too early" in forecast(time[:8], noise[:8], 0.0, settings).sentence


def test_the_number_of_campaigns_a_year_follows_from_the_mean_interval():
    spacings = (365.25, 46.0, 7.0, 1.0, 0.5, 800.0, np.nan)
    time = np.array([spacing * np.arange(40.0) for spacing in spacings])
    bursts = np.sort(np.concatenate([91.3125 * np.arange(10.0) + day for day in (0.0, 2.0, 5.0, 7.0)]))
    paused = np.concatenate([30.4375 * np.arange(20.0), 3.0 * 365.25 + 30.4375 * np.arange(20.0, 40.0)])
    time = np.vstack([time, bursts, paused])
    charts = SimpleNamespace(time=time, baseline=SimpleNamespace(inside=np.isfinite(time)))
    counts = campaigns_a_year(charts)
    assert counts.tolist() == [1, 8, 52, 365, 366, 0, 0, 17, 12]  # of 40 campaigns in 829 days: 39 intervals


def test_a_limit_that_the_line_may_have_passed_is_not_stated_as_a_later_date(settings):
    """A campaign every four months, -1.3 %/a over 4.3 years: at -5.6 % now, and the mean of eight at -4.1 %."""
    time = 120.0 * np.arange(14.0)
    noise = 0.05 * np.random.default_rng(3).standard_normal(time.size)
    passed = forecast(time, -1.3 * time / 365.25 + noise, 0.0, settings)
    assert (passed.verdict, passed.not_before, passed.not_after) == ("line", 0.0, 0.0)
    assert passed.sentence == "the limit may be reached already"
    doubtful = forecast(time, -1.15 * time / 365.25 + 4.0 * noise, 0.0, settings)
    assert doubtful.verdict == "line" and doubtful.not_before == 0.0 < doubtful.not_after < 1.0
    assert doubtful.sentence.startswith("the limit may be reached already, by 0.")


@pytest.mark.parametrize(
    ("not_before", "not_after", "words"),
    [
        ("2026-05-04", "2026-05-04", "the limit may be reached already"),
        ("2026-05-04", None, "the limit may be reached already"),
        ("2026-05-04", "2027-01-02", "the limit may be reached already, by 2027-01-02 if it goes on like this"),
        ("2026-09-01", "2027-01-02", "not before 2026-09-01, by 2027-01-02 if it goes on like this"),
        ("2026-09-01", None, "not before 2026-09-01, no latest date"),
    ],
)
def test_the_words_of_a_forecast_name_no_date_that_has_passed(not_before, not_after, words):
    row = {"turnout_id": "T", "section_id": "T/S0", "band": "railpad", "source": "hammer", "forecast": "line",
           "last_measured_at_utc": "2026-05-04", "not_before_utc": not_before, "not_after_utc": not_after}  # fmt: skip
    frame = pd.DataFrame([row])
    for name in ("last_measured_at_utc", "not_before_utc", "not_after_utc"):
        frame[name] = pd.to_datetime(frame[name])
    with connect_views({"chart_status": frame}, "2026-05-04") as con:
        assert con.execute("select words from time_to_threshold").fetchall() == [(words,)]
