"""Thresholds against published run lengths, and against another way of computing them."""

import numpy as np
import pytest
from scipy.special import ndtr

from turnout.trend.threshold import alarm_probability, detectable_shift, run_length, threshold_for


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
def test_threshold_keeps_the_false_alarms_asked_for(allowance, length):
    h = threshold_for(length, allowance)
    assert run_length(h, allowance) == pytest.approx(length, rel=1e-6)
    # Siegmund's overshoot is derived for small k; at k = 1 it is 8 % off.
    assert markov_run_length(h, allowance) == pytest.approx(length, rel=0.08)


def test_delay_of_a_shift_is_the_published_one():
    # Montgomery: k = 0.5, h = 5, shift 1 sigma: 10.4 campaigns.
    assert run_length(5.0, 0.5, 1.0) == pytest.approx(10.4, rel=0.03)
    assert run_length(5.0, 0.5, 0.5) == pytest.approx((5.0 + 1.166) ** 2)


def test_probability_of_an_alarm_agrees_with_playing_it_through():
    rng = np.random.default_rng(5)
    n, h, k, shift, campaigns = 40_000, 3.5, 1.0, 1.2, 26
    total, alarmed = np.zeros(n), np.zeros(n, bool)
    for _ in range(campaigns):
        total = np.maximum(0.0, total + rng.standard_normal(n) + shift - k)
        alarmed |= total > h
    expected = alarm_probability(shift, h, k, campaigns)
    error = np.sqrt(expected * (1 - expected) / n)
    # 4 standard errors of the play, and 0.002 for 80 cells in place of a continuous sum.
    assert abs(alarmed.mean() - expected) < 4 * error + 0.002


@pytest.mark.parametrize(
    ("threshold", "allowance", "campaigns", "known"),
    [(3.5, 1.0, 26, 1.18), (6.77, 0.5, 26, 0.92), (3.5, 1.0, 52, 0.95), (6.77, 0.5, 52, 0.70)],
)
def test_detectable_shift_is_what_a_simulation_found(threshold, allowance, campaigns, known):
    # Simulated elsewhere with known baselines, two decimals: half a digit and its sampling error.
    assert detectable_shift(threshold, allowance, campaigns) == pytest.approx(known, abs=0.015)


def test_more_campaigns_show_smaller_changes():
    shifts = [detectable_shift(3.5, 1.0, n) for n in (1, 4, 12, 26, 52, 365)]
    assert shifts == sorted(shifts, reverse=True)
    assert detectable_shift(3.5, 1.0, 0) == np.inf
