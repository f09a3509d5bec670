"""A curved temperature law raises no alarms of turnouts or lone sections; a true loss is still detected."""

import numpy as np
import pytest
from benchmarks.trend_fleet import Fleet, modes

from turnout.config.settings.trend import TrendSettings
from turnout.trend import evaluate
from turnout.trend.curvature import fit_curved_law
from turnout.trend.panel import panel_of
from turnout.trend.preparation import prepare

SETTINGS = TrendSettings()
YEAR, TURNOUTS = 52, 120


def alarms_of_turnouts(curvature, change=None):
    """Alarms in the charts of whole turnouts over their promised number, and the share of turnouts in alarm."""
    fleet = Fleet(turnouts=TURNOUTS, weeks=4 * YEAR, phi=0.2, curvature=curvature)
    charts = evaluate(modes(fleet, 9412, change), None, SETTINGS)
    n = fleet.charts
    is_open = np.stack([charts.down_open[n:], charts.up_open[n:]])
    opened = np.diff(is_open.astype(int), axis=2, prepend=0) > 0
    promised = 1.0 / SETTINGS.run_length_loss + 1.0 / SETTINGS.run_length_gain
    return opened.sum() / (np.isfinite(charts.z[n:]).sum() * promised), charts.down_open[n:].any(axis=1).mean()


@pytest.mark.parametrize("curvature", [0.0, -0.005])  # %/°C²
def test_a_curved_law_raises_no_more_alarms_of_turnouts_than_promised(curvature):
    """Formerly there were 2.5 times the promised number at -0.005 %/°C²; three alarms are promised here."""
    assert alarms_of_turnouts(curvature)[0] < 1.2


def test_a_loss_of_a_whole_turnout_with_a_curved_law_is_detected():
    change = -1.5 * (np.arange(4 * YEAR) >= 2 * YEAR)
    assert alarms_of_turnouts(-0.005, change)[1] > 0.95


def test_a_curvature_by_chance_shrinks_and_a_clear_curvature_stays():
    """Shrinkage by 1 - 1/F leaves a fifth to a half of the mean square of a curvature by chance (0.33 of F(1, 49))."""
    rng = np.random.default_rng(1)
    temperature = 12.0 + 15.0 * rng.standard_normal((4000, 52))
    noise = 0.6 * rng.standard_normal((4000, 52)) - 0.1 * temperature
    everything, epoch = np.ones(noise.shape, bool), np.zeros(noise.shape, int)
    law = fit_curved_law(noise, temperature, everything, epoch, np.zeros(4000))
    plain = np.array([np.polyfit(t, v, 2)[0] for t, v in zip(temperature, noise)])
    assert 0.2 < np.mean(law.quadratic**2) / np.mean(plain**2) < 0.5
    assert np.mean(law.is_curved) == pytest.approx(0.322, abs=0.025)  # F(1, 49) above 1, three standard errors
    assert np.all(law.spread_ratio[~law.is_curved] == 1.0)
    assert not law.term(temperature)[~law.is_curved].any()
    curved = fit_curved_law(noise - 0.02 * temperature**2, temperature, everything, epoch, np.zeros(4000))
    assert np.mean(curved.quadratic) == pytest.approx(-0.02, rel=0.005)


def test_the_temperature_term_is_that_of_a_polynomial_fit():
    rng = np.random.default_rng(2)
    temperature = rng.uniform(-10.0, 40.0, (1, 30))
    values = 0.3 - 0.1 * temperature - 0.01 * temperature**2 + 0.1 * rng.standard_normal((1, 30))
    inside = np.arange(30)[None] < 20
    expected = np.polyval(np.polyfit(temperature[0, :20], values[0, :20], 2), temperature[0])
    for reference in (None, np.array([17.0])):
        law = fit_curved_law(values, temperature, inside, np.zeros((1, 30), int), np.zeros(1), reference)
        assert np.ptp(expected - law.term(temperature)[0]) < 1e-3 * np.ptp(expected)  # all but the level


def lone_sections(curvature, turnouts, change=None):
    """Charts of turnouts with two sections, none of which has enough siblings."""
    fleet = Fleet(turnouts=turnouts, sections=2, weeks=4 * YEAR, phi=0.2, curvature=curvature)
    return evaluate(modes(fleet, 9413, change), None, SETTINGS)


@pytest.mark.parametrize("curvature", [0.0, -0.005])  # %/°C²
def test_a_curved_law_raises_no_more_alarms_of_lone_sections_than_promised(curvature):
    """Straight laws give 1.45 times the promised number at -0.005 %/°C²; 22 alarms are promised here."""
    charts = lone_sections(curvature, 360)
    opened = np.diff(np.stack([charts.down_open, charts.up_open]).astype(int), axis=2, prepend=0) > 0
    promised = 1.0 / SETTINGS.run_length_loss + 1.0 / SETTINGS.run_length_gain
    assert opened.sum() / (np.isfinite(charts.z[:, YEAR:]).sum() * promised) < 1.2


def test_a_loss_of_a_lone_section_with_a_curved_law_is_detected():
    change = -3.0 * (np.arange(4 * YEAR) >= 2 * YEAR)
    assert lone_sections(-0.005, 60, change).down_open[:120].any(axis=1).mean() > 0.95


def test_the_baseline_of_a_lone_section_has_the_curvature_of_its_law():
    """Mean within a twentieth; sections with siblings keep the straight law that siblings correct."""
    fleet = Fleet(turnouts=100, sections=2, weeks=4 * YEAR, phi=0.0, curvature=-0.005, thermometer=0.0)
    panel = panel_of(modes(fleet, 9414), SETTINGS, None, None)
    base = prepare(panel, None, SETTINGS).baseline
    assert np.mean(base.curvature[:200]) == pytest.approx(-0.005, rel=0.05)
    eight = Fleet(turnouts=20, sections=8, weeks=2 * YEAR, phi=0.0, curvature=-0.005)
    panel = panel_of(modes(eight, 9415), SETTINGS, None, None)
    assert not prepare(panel, None, SETTINGS).baseline.curvature[:160].any()
