"""Where most sections of a turnout change, its chart is in alarm, and the unchanged sections are not."""

import numpy as np
import pytest
from benchmarks.trend_fleet import Fleet, modes
from tests.oracles.trend_views import connect_views

from turnout.config.settings.trend import TrendSettings
from turnout.trend import evaluate
from turnout.trend.tables import alarm_rows, baseline_rows, chart_rows

SETTINGS = TrendSettings()
YEAR = 52


def changed_fleet(percent, sections, n_changed, seed, turnouts=40):
    """Fleet in which the first ``n_changed`` sections of each turnout change by ``percent`` after two years."""
    fleet = Fleet(turnouts=turnouts, sections=sections, weeks=4 * YEAR, phi=0.0)
    change = np.zeros((1, sections, 4 * YEAR))
    change[:, :n_changed, 2 * YEAR :] = percent
    return fleet, modes(fleet, seed, change)


@pytest.mark.parametrize("percent", [-3.0, -8.0, 4.0])
@pytest.mark.parametrize("sections, n_changed", [(5, 4), (8, 5)])
def test_a_change_of_most_sections_is_an_alarm_of_the_turnout_and_none_of_the_others(percent, sections, n_changed):
    """Formerly nine in ten of the unchanged sections stayed in alarm, in the other direction."""
    fleet, rows = changed_fleet(percent, sections, n_changed, 7401)
    charts = evaluate(rows, None, SETTINGS)
    n = fleet.charts
    unchanged = np.arange(n) % sections >= n_changed
    same, other = ("down_open", "up_open") if percent < 0.0 else ("up_open", "down_open")
    assert getattr(charts, same)[n:, -1].mean() > 0.9
    assert getattr(charts, other)[:n][unchanged, 2 * YEAR :].any(axis=1).mean() < 0.05
    assert (charts.down_open | charts.up_open)[:n][unchanged, -1].mean() < 0.05


def test_a_section_that_changes_otherwise_than_its_turnout_is_in_alarm():
    """All lose 3 %; the first one loses 3 % more half a year later, and the second one gains 6 %."""
    fleet = Fleet(turnouts=40, sections=8, weeks=4 * YEAR, phi=0.0)
    change = np.zeros((1, 8, 4 * YEAR))
    change[:, :, 2 * YEAR :] = -3.0
    change[:, 0, 5 * YEAR // 2 :] -= 3.0
    change[:, 1, 5 * YEAR // 2 :] += 6.0
    charts = evaluate(modes(fleet, 7402, change), None, SETTINGS)
    section = np.arange(fleet.charts) % 8
    assert charts.down_open[: fleet.charts, -1][section == 0].mean() > 0.95
    assert charts.up_open[: fleet.charts, -1][section == 1].mean() > 0.95
    assert (charts.down_open | charts.up_open)[: fleet.charts, -1][section > 1].mean() < 0.05


def test_residuals_in_sql_are_those_of_charts_with_an_alarm_of_the_turnout():
    _, rows = changed_fleet(-3.0, 5, 4, 7403, turnouts=4)
    charts = evaluate(rows, None, SETTINGS)
    frames = {
        "modes": rows.assign(method="joint"),
        "charts": chart_rows(charts),
        "baselines": baseline_rows(charts, SETTINGS),
        "alarms": alarm_rows(charts, SETTINGS),
    }
    assert (frames["alarms"]["section_id"] == "*").any()
    with connect_views(frames, rows["measured_at_utc"].max(), rounded=False) as con:
        n, worst = con.execute(
            "select count(*), max(abs(r.residual_pct - c.residual_pct)) from charts c "
            "join mode_residuals(timestamp '2016-01-01') r using (section_id, band, source, measured_at_utc)"
        ).fetchall()[0]
    assert n == 4 * 5 * 4 * YEAR and worst < 1e-8
