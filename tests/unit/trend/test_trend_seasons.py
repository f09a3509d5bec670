"""Baselines that lack a season, sections that begin later: no more false alarms than promised, and no stale states."""

import numpy as np
import pandas as pd
import pytest
from benchmarks.trend_fleet import Fleet, modes

from turnout.config.settings.trend import TrendSettings
from turnout.trend import evaluate
from turnout.trend.curvature import fit_curved_law
from turnout.trend.panel import panel_of
from turnout.trend.preparation import prepare
from turnout.trend.states import chart_status
from turnout.trend.times import days

SETTINGS = TrendSettings()
YEAR = 52


def weeks_of(rows):
    since = rows["measured_at_utc"] - rows["measured_at_utc"].min()
    return np.round(since / pd.Timedelta(days=7)).to_numpy()


def alarms_over_promise(charts, rows):
    """Alarms of the chosen charts over their promised number."""
    is_open = np.stack([charts.down_open[rows], charts.up_open[rows]])
    opened = np.diff(is_open.astype(int), axis=2, prepend=0) > 0
    promised = 1.0 / SETTINGS.run_length_loss + 1.0 / SETTINGS.run_length_gain
    judged = np.isfinite(charts.z[rows]) & ~charts.learning[rows]
    return opened.sum() / (judged.sum() * promised)


@pytest.mark.parametrize("paused", [(16, 62), (6, 47)])  # weeks without a campaign, from the second to the third season
def test_the_first_summer_after_a_baseline_of_winters_raises_no_alarms(paused):
    """Formerly 7 times the promised number: the curvature of a winter was continued into the summer."""
    fleet = Fleet(turnouts=150, sections=2, weeks=5 * YEAR, phi=0.0)
    rows = modes(fleet, 7301)
    week = weeks_of(rows)
    charts = evaluate(rows[(week < paused[0]) | (week >= paused[1])], None, SETTINGS)
    assert alarms_over_promise(charts, slice(0, fleet.charts)) < 1.2


def test_a_loss_after_a_baseline_of_winters_is_detected_in_winter():
    fleet = Fleet(turnouts=60, sections=2, weeks=5 * YEAR, phi=0.0)
    rows = modes(fleet, 7302, -4.0 * (np.arange(5 * YEAR) >= 4 * YEAR))
    week = weeks_of(rows)
    charts = evaluate(rows[(week < 16) | (week >= 62)], None, SETTINGS)
    assert charts.down_open[: fleet.charts].any(axis=1).mean() > 0.95


def test_the_stated_error_of_a_curvature_is_that_of_curvatures_drawn_from_its_prior():
    """Root mean square of error over stated error is 1, for winters alone as well as for whole years."""
    rng = np.random.default_rng(7303)
    shape = (4000, 60)
    for spread, in_every_season in ((4.0, False), (4.0, True), (14.0, True)):
        temperature = spread * rng.standard_normal(shape)
        truth = 0.01 * rng.standard_normal(shape[0])
        values = -0.1 * temperature + truth[:, None] * temperature**2 + 0.6 * rng.standard_normal(shape)
        whole, epoch = np.ones(shape, bool), np.zeros(shape, int)
        seasons = np.full(shape[0], in_every_season)
        law = fit_curved_law(values, temperature, whole, epoch, np.zeros(shape[0]), in_every_season=seasons)
        assert law.is_curved.any() == in_every_season
        assert np.sqrt(np.mean(((truth - law.quadratic) / law.error) ** 2)) == pytest.approx(1.0, abs=0.07)


def later_sections(fleet, seed, start):
    """Rows of a fleet in which all sections but two begin at week ``start``."""
    rows = modes(fleet, seed)
    is_first = rows["section_id"].str[-1].astype(int).to_numpy() < 2
    return rows[is_first | (weeks_of(rows) >= start)]


@pytest.mark.parametrize("start", [42, 46, 62])
def test_a_turnout_with_later_sections_has_a_baseline_of_its_own(start):
    """Formerly it was where the baselines of sections overlap: 11 times the promised alarms, or never complete."""
    fleet = Fleet(turnouts=150, sections=5, weeks=4 * YEAR, phi=0.0)
    rows = later_sections(fleet, 7304, start)
    base = prepare(panel_of(rows, SETTINGS, None, None), None, SETTINGS).baseline
    assert base.complete[fleet.charts :].all() and (base.count[fleet.charts :] == YEAR).all()
    charts = evaluate(rows, None, SETTINGS)
    assert np.isfinite(charts.z[fleet.charts :]).sum(axis=1).min() > 2 * YEAR
    assert alarms_over_promise(charts, slice(fleet.charts, None)) < 1.2


def test_a_turnout_whose_sections_are_rarely_measured_together_needs_as_many_campaigns_as_a_section():
    """Of two sections in turn with two others, twelve common campaigns take three years."""
    fleet = Fleet(turnouts=3, sections=5, weeks=2 * YEAR, phi=0.0)
    rows = modes(fleet, 7305)
    week, section = weeks_of(rows), rows["section_id"].str[-1].astype(int).to_numpy()
    rows = rows[(section < 3) | (week % 12 == 0)]  # four sections and more in every twelfth week
    base = prepare(panel_of(rows, SETTINGS, None, None), None, SETTINGS).baseline
    n = fleet.charts
    assert base.complete[:n].sum() == 3 * 3 and (base.count[n:] == 9).all() and not base.complete[n:].any()


def test_a_turnout_without_a_median_because_of_alarms_is_not_to_be_confirmed():
    """All sections lose 8 % and are in alarm. The last median of the turnout is old: no test of it can be repeated."""
    fleet = Fleet(turnouts=40, sections=5, weeks=4 * YEAR, phi=0.0, campaign=0.0, thermometer=0.0)
    charts = evaluate(modes(fleet, 7306, -8.0 * (np.arange(4 * YEAR) >= 2 * YEAR)), None, SETTINGS)
    status = chart_status(charts, SETTINGS).iloc[fleet.charts :]
    assert (days(status["last_measured_at_utc"]) < charts.prepared.panel.as_of - 600.0).all()
    assert set(status["reason"]) == {"too_few_sections"}
