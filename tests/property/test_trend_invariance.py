"""A chart does not depend on units, order, names, a shift of time, or a change in temperature alone."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from hypothesis import given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[2]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from benchmarks.trend_fleet import Fleet, modes  # noqa: E402

from turnout.config.settings.trend import TrendSettings  # noqa: E402
from turnout.trend import evaluate  # noqa: E402
from turnout.trend.cusum import cusum  # noqa: E402

FLEET = Fleet(turnouts=2, sections=5, weeks=90, phi=0.3)
ROWS = modes(FLEET, 1).astype({"turnout_id": object, "section_id": object, "band": object, "source": object})
CHARTS = evaluate(ROWS, None, TrendSettings())


def assert_same_charts(other, a=slice(None)):
    assert np.allclose(other.z[a], CHARTS.z, atol=1e-7, equal_nan=True)
    assert np.array_equal(other.down_open[a], CHARTS.down_open)


@settings(max_examples=10, deadline=None)
@given(st.floats(0.01, 100.0))
def test_the_unit_of_frequency_does_not_matter(factor):
    rows = ROWS.assign(frequency_hz=ROWS["frequency_hz"] * factor, frequency_se_hz=ROWS["frequency_se_hz"] * factor)
    assert_same_charts(evaluate(rows, None, TrendSettings()))


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**31))
def test_the_order_of_rows_does_not_matter(seed):
    assert_same_charts(evaluate(ROWS.sample(frac=1.0, random_state=seed), None, TrendSettings()))


@settings(max_examples=10, deadline=None)
@given(st.floats(-30.0, 30.0), st.integers(-1000, 1000))
def test_origin_of_temperature_and_time_do_not_matter(shift, weeks):
    moved = ROWS["measured_at_utc"] + pd.Timedelta(days=7 * weeks)
    rows = ROWS.assign(rail_temperature_c=ROWS["rail_temperature_c"] + shift, measured_at_utc=moved)
    assert_same_charts(evaluate(rows, None, TrendSettings()))


@settings(max_examples=10, deadline=None)
@given(st.floats(-0.05, 0.05))
def test_a_pure_effect_of_temperature_is_removed(coefficient):
    # f (1 + c (T - 12)): to first order only a larger slope b. Second order is c (T - T0) times what f deviates by
    # already: 0.05 %/K * 27 K * 6 % = 0.08 %, a seventh of the scatter; without the correction it is 1.35 %.
    factor = 1 + coefficient / 100 * (ROWS["rail_temperature_c"] - 12.0)
    other = evaluate(ROWS.assign(frequency_hz=ROWS["frequency_hz"] * factor), None, TrendSettings())
    assert np.allclose(other.residual, CHARTS.residual, atol=0.1, equal_nan=True)
    slope = other.prepared.baseline.slope - CHARTS.prepared.baseline.slope
    assert np.allclose(slope[:10], coefficient, atol=0.004)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.2, 1.5), st.floats(0.0, 2.0))
def test_a_larger_allowance_never_raises_the_sum(seed, allowance, more):
    z = np.random.default_rng(seed).standard_normal((3, 50))
    on, h = np.ones(z.shape, bool), np.full(3, 4.0)
    low, _, _ = cusum(z, np.full(z.shape, allowance + more), h, np.full(z.shape, np.inf), np.zeros(len(z)), on, ~on)
    high, _, _ = cusum(z, np.full(z.shape, allowance), h, np.full(z.shape, np.inf), np.zeros(len(z)), on, ~on)
    assert (low <= high + 1e-12).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.integers(0, 49), st.floats(0.0, 5.0))
def test_a_lower_value_never_lowers_the_sum(seed, place, drop):
    z = np.random.default_rng(seed).standard_normal((2, 50))
    on, h, k = np.ones(z.shape, bool), np.full(2, 4.0), np.ones((2, 50))
    before, _, _ = cusum(z, k, h, np.full(z.shape, np.inf), np.zeros(len(z)), on, ~on)
    z[:, place] -= drop
    after, _, _ = cusum(z, k, h, np.full(z.shape, np.inf), np.zeros(len(z)), on, ~on)
    assert (after >= before - 1e-12).all()
