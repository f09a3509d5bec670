"""A curved temperature law raises no alarms of whole turnouts, and a true loss of a whole turnout is still seen."""

import numpy as np
import pytest
from benchmarks.trend_fleet import Fleet, modes

from turnout.config.settings.trend import TrendSettings
from turnout.trend import evaluate
from turnout.trend.curvature import SIGNIFICANCE, curvature_term

SETTINGS = TrendSettings()
YEAR, TURNOUTS = 52, 120


def alarms_of_turnouts(curvature, change=None):
    """Alarms that open in the charts of whole turnouts, over the number promised; share of turnouts in alarm."""
    fleet = Fleet(turnouts=TURNOUTS, weeks=4 * YEAR, phi=0.2, curvature=curvature)
    charts = evaluate(modes(fleet, 9412, change), None, SETTINGS)
    n = fleet.charts
    is_open = np.stack([charts.down_open[n:], charts.up_open[n:]])
    opened = np.diff(is_open.astype(int), axis=2, prepend=0) > 0
    promised = 1.0 / SETTINGS.run_length_loss + 1.0 / SETTINGS.run_length_gain
    return opened.sum() / (np.isfinite(charts.z[n:]).sum() * promised), charts.down_open[n:].any(axis=1).mean()


@pytest.mark.parametrize("curvature", [0.0, -0.005])  # %/°C²
def test_a_curved_law_raises_no_more_alarms_of_turnouts_than_promised(curvature):
    """Before, 2.5 times the promised number at -0.005 %/°C²; three alarms are promised here."""
    assert alarms_of_turnouts(curvature)[0] < 1.2


def test_a_loss_of_a_whole_turnout_with_a_curved_law_is_seen():
    change = -1.5 * (np.arange(4 * YEAR) >= 2 * YEAR)
    assert alarms_of_turnouts(-0.005, change)[1] > 0.95


def test_a_straight_law_has_a_curvature_by_chance_in_the_stated_share():
    rng = np.random.default_rng(1)
    temperature = 12.0 + 15.0 * rng.standard_normal((4000, 52))
    values = 0.6 * rng.standard_normal((4000, 52)) - 0.1 * temperature
    everything, epoch = np.ones(values.shape, bool), np.zeros(values.shape, int)
    term, ratio = curvature_term(values, temperature, everything, epoch, np.zeros(4000))
    assert np.mean(term.any(axis=1)) == pytest.approx(SIGNIFICANCE, abs=0.005)  # three standard errors
    assert np.all(ratio[~term.any(axis=1)] == 1.0)


def test_the_term_is_that_of_a_polynomial_fit():
    rng = np.random.default_rng(2)
    temperature = rng.uniform(-10.0, 40.0, (1, 30))
    values = 0.3 - 0.1 * temperature - 0.01 * temperature**2 + 0.1 * rng.standard_normal((1, 30))
    inside = np.arange(30)[None] < 20
    term, _ = curvature_term(values, temperature, inside, np.zeros((1, 30), int), np.zeros(1))
    expected = np.polyval(np.polyfit(temperature[0, :20], values[0, :20], 2), temperature[0])
    assert np.ptp(expected - term[0]) < 1e-9  # all but the level
