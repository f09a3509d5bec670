"""Intervals of modes from the history of a section equal an independent computation and have the stated coverage."""

from datetime import date, timedelta

import numpy as np
import pytest
from registry_rows import hammer_result
from scipy.stats import t

from turnout.registry.database import open_registry
from turnout.report.site import write_pages

N, REPEATABILITY, BETWEEN, SLOPE = 25, 0.002, 0.006, -0.0015  # relative, and per °C


def campaigns(section, rng, between=BETWEEN, step=None, **mode):
    """Results of N campaigns, with log frequency and temperature; ``step`` (campaign, factor) changes the section."""
    temperature = np.round(10.0 + 10.0 * np.sin(np.arange(N) * 0.8) + rng.normal(0.0, 3.0, N), 1)  # as stored
    log_f = np.log(150.0) + SLOPE * temperature + rng.normal(0.0, np.hypot(REPEATABILITY, between), N)
    if step is not None:
        log_f[step[0] :] += np.log(step[1])
    results = []
    for k in range(N):
        day = (date(2024, 1, 10) + timedelta(days=40 * k)).isoformat()
        f = float(np.exp(log_f[k]))
        values = {"rail_temperature_c": float(temperature[k]), "frequency_repeatability_hz": REPEATABILITY * f} | mode
        results.append(hammer_result(day=day, file=day, key=f"{section}{k}", section=section, frequency=f, **values))
    return results, log_f, temperature


def between_variance(log_f, temperature):
    """Variance between campaigns beyond their repeatability, from successive differences."""
    step, warmer = np.diff(log_f), np.diff(temperature)
    residual = step - (step @ warmer) / (warmer @ warmer) * warmer
    residual = residual[np.abs(residual) <= 6 * 1.4826 * np.median(np.abs(residual))]
    return max(0.0, residual @ residual / (len(residual) - 1) / 2 - REPEATABILITY**2), len(residual)


def test_the_interval_follows_from_the_steps_of_its_section_and_the_mean_of_the_fleet(bench):
    rng = np.random.default_rng(5)
    histories = {
        "A1": campaigns("A1", rng), "A2": campaigns("A2", rng, 0.02), "A3": campaigns("A3", rng, step=(12, 0.7)),
    }  # fmt: skip
    bench.register(*(result for history in histories.values() for result in history[0]))
    estimates = {name: between_variance(*history[1:]) for name, history in histories.items()}
    fleet = np.mean([variance for variance, _ in estimates.values()])
    for name, (variance, n) in estimates.items():
        freedom = 1 + 2 * (n - 1) / 3
        expected = np.sqrt((fleet + (freedom - 1) * variance) / freedom)
        rows = bench.ask(
            "select value, value_low, value_high, between_campaigns_pct, n_steps from mode_intervals"
            f" where section_id = 't1/{name}' and quantity = 'frequency' order by measured_at_utc"
        )
        value, low, high, between, n_steps = np.array(rows, float).T
        np.testing.assert_allclose(np.log(value), histories[name][1], atol=1e-5)  # stored with three decimals
        assert set(n_steps) == {n} and n == (N - 2 if name == "A3" else N - 1)  # the change of A3 is no scatter
        np.testing.assert_allclose(between, 100 * expected, rtol=1e-3)
        half = t.ppf(0.975, freedom) * np.hypot(REPEATABILITY, expected)
        np.testing.assert_allclose(np.log(high / low) / 2, half, rtol=0.01)


def test_intervals_cover_the_frequency_at_the_temperature_in_19_of_20_campaigns(bench):
    """Twelve sections of 25 campaigns: .95 ± .025 (two standard errors)."""
    rng = np.random.default_rng(6)
    histories = [campaigns(f"S{k}", rng) for k in range(12)]
    bench.register(*(result for history in histories for result in history[0]))
    with open_registry(bench.registry) as connection:
        rows = connection.execute(
            "select i.value_low, i.value_high, m.rail_temperature_c from mode_intervals i"
            " join modes_current m using (model_id, band) where quantity = 'frequency'"
        ).fetchall()
    low, high, temperature = np.array(rows).T
    law = 150.0 * np.exp(SLOPE * temperature)
    assert len(rows) == 12 * N
    assert np.mean((low <= law) & (law <= high)) == pytest.approx(0.955, abs=0.025)


def test_seven_campaigns_are_too_few_for_a_history(bench):
    results, _, _ = campaigns("A1", np.random.default_rng(7))
    bench.register(*results[:7])
    assert bench.ask("select * from mode_intervals") == []


SECTION = {
    "turnouts": [{"turnout_id": "t1", "name": "t1", "line": "L", "km": 1.5, "layout": "l", "config_hash": "h"}],
    "sections": [
        {"turnout_id": "t1", "section_id": "t1/A1", "label": "A1", "panel": "CP", "track": "main", "position_m": 1.0}
    ],
}


def page_of(bench, tmp_path):
    """Text of the page of the turnout."""
    with open_registry(bench.registry) as connection:
        write_pages(connection, tmp_path / "pages", progress=False)
    return (tmp_path / "pages" / "turnouts" / "t1.html").read_text(encoding="utf-8")


def test_the_page_shows_the_interval_of_the_history_with_its_number_of_steps(bench, tmp_path):
    results, log_f, _ = campaigns("A1", np.random.default_rng(8))
    bench.register(*results, tables=SECTION)
    rows = bench.ask("select value_low, value_high from mode_intervals where quantity = 'frequency' order by model_id")
    order = [model for (model,) in bench.ask("select model_id from modes_current order by measured_at_utc")]
    limits = [rows[sorted(order).index(model)] for model in order]
    text = page_of(bench, tmp_path)
    for k in (0, N - 1):
        half = 0.5 * (limits[k][1] - limits[k][0])
        assert f"{np.exp(log_f[k]):.1f} Hz ± {half:.2g} (95 %, from {N - 1} differences)" in text
    assert f">{np.exp(log_f[-1]):.1f} ± {half:.1f}</td>" in text  # the table of the newest resonances


def test_the_page_of_a_section_without_history_shows_the_interval_of_the_campaign(bench, tmp_path):
    results, log_f, _ = campaigns("A1", np.random.default_rng(9), frequency_se_hz=0.7)
    bench.register(*results[:7], tables=SECTION)
    text = page_of(bench, tmp_path)
    assert f"{np.exp(log_f[0]):.1f} Hz ± {t.ppf(0.975, 29) * 0.7:.2g} (95 %)" in text
    assert " differences)" not in text


def test_the_page_reports_a_mode_that_departs_from_the_history_of_its_section(bench, tmp_path):
    """A pole with a third of the damping and a 15 % higher frequency; the campaigns around it are not reported."""
    results, log_f, _ = campaigns("A1", np.random.default_rng(10), frequency_se_hz=0.3, damping_se=0.002)
    odd = results[9].tables["modes"][0]
    odd |= {"frequency_hz": 1.15 * odd["frequency_hz"], "damping_ratio": 0.03}
    bench.register(*results[:12], tables=SECTION)
    text = page_of(bench, tmp_path)
    day = (date(2024, 1, 10) + timedelta(days=40 * 9)).isoformat()
    mode = f"On {day} the ballast mode differs from that before: {1.15 * np.exp(log_f[9]):.1f} Hz against"
    assert mode in text and "damping 0.030 against" in text and text.count("differs from that before") == 1
    assert f"{1.15 * np.exp(log_f[9]):.1f} ± 0.6</td>" in text and "0.030 ± 0.004</td>" in text
    assert "(1 campaign, against the median of 9 before)" in text
