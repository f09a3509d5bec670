"""Thresholds against published run lengths, and against another computation."""

import numpy as np
import pytest
from benchmarks.trend_detectable import share_seen
from scipy.special import ndtr

from turnout.trend.detectability import detectable_shift
from turnout.trend.threshold import run_length, threshold_for


def markov_run_length(threshold, allowance, shift=0.0, states=200):
    """Brook and Evans 1972: mean time to absorption, (I - P)^-1 1; independent of Siegmund's formula."""
    width = 2 * threshold / (2 * states - 1)
    cell = np.arange(states)
    reach = ndtr((cell[None] - cell[:, None] + 0.5) * width + allowance - shift)
    stay = np.diff(reach, axis=1, prepend=0.0)
    return np.linalg.solve(np.eye(states) - stay, np.ones(states))[0]


@pytest.mark.parametrize(
    ("threshold", "published"), [(3.0, 2 * 59.0), (4.0, 2 * 168.0), (5.0, 2 * 465.0)], ids=["h3", "h4", "h5"]
)
def test_run_lengths_are_the_published_ones(threshold, published):
    # Hawkins 1993 and Montgomery, table of ARL for k = 0.5, two-sided; a one-sided chart has twice that.
    # Montgomery prints no decimals: 0.5 of 59 is 0.8 %; Siegmund's approximation is good to 2 %.
    assert markov_run_length(threshold, 0.5) == pytest.approx(published, rel=0.01)
    assert run_length(threshold, 0.5) == pytest.approx(published, rel=0.02)


@pytest.mark.parametrize("allowance", [0.5, 1.0])
@pytest.mark.parametrize("length", [336.0, 5600.0, 56000.0])
def test_the_threshold_gives_the_requested_rate_of_false_alarms(allowance, length):
    h = threshold_for(length, allowance)
    assert run_length(h, allowance) == pytest.approx(length, rel=1e-6)
    # Siegmund's overshoot is derived for small k; at k = 1 it is 8 % off.
    assert markov_run_length(h, allowance) == pytest.approx(length, rel=0.08)


def test_delay_of_a_shift_is_the_published_one():
    # Montgomery: k = 0.5, h = 5, shift 1 sigma: 10.4 campaigns.
    assert run_length(5.0, 0.5, 1.0) == pytest.approx(10.4, rel=0.03)
    assert run_length(5.0, 0.5, 0.5) == pytest.approx((5.0 + 1.166) ** 2)


@pytest.mark.parametrize(
    ("threshold", "allowance", "campaigns", "known"),
    [(3.5, 1.0, 26, 1.18), (6.77, 0.5, 26, 0.92), (3.5, 1.0, 52, 0.95), (6.77, 0.5, 52, 0.70)],
)
def test_the_detectable_shift_of_a_known_baseline_is_that_of_a_simulation(threshold, allowance, campaigns, known):
    # Simulated elsewhere with known baselines and without the rule of outliers, two decimals. Here 2000 charts: the
    # probability has a standard error of 0.007, the shift of 0.01.
    shift = detectable_shift(threshold, allowance, campaigns, 1500, single_share=100.0, outlier_limit=1e3)
    assert shift == pytest.approx(known, abs=0.035)


def test_an_estimated_baseline_detects_less_and_more_campaigns_detect_more():
    shifts = [detectable_shift(3.5, 1.0, n, 52) for n in (2, 4, 12, 26, 52, 365)]
    assert shifts == sorted(shifts, reverse=True)
    assert detectable_shift(3.5, 1.0, 0, 52) == np.inf
    # The level is known to 1/sqrt(52), after an event only to 1/sqrt(12), as large as a quarter of the shift.
    known, year, event = (detectable_shift(3.5, 1.0, 52, *n, guard=1.12) for n in ((1500,), (52,), (52, 12)))
    assert 1.02 * known < year < 0.95 * event < 1.3 * known


@pytest.mark.parametrize(("days", "campaign"), [(7.0, 0.6), (46.0, 0.0)], ids=["weekly", "46 d"])
def test_nine_of_ten_charts_detect_their_stated_detectable_change(days, campaign):
    """Whole charts, with everything estimated: baselines, temperature slopes, memory, siblings."""
    share, n = share_seen(days, campaign, 0.2, turnouts=150, seed=77)
    assert n > 140 and abs(share - 0.9) < 3.0 * np.sqrt(0.09 / n)
