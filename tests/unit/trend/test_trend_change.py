"""Date and size of a change: against statsmodels and ruptures; and the intervals contain the true values."""

from itertools import combinations, product

import numpy as np
import pytest
import statsmodels.api as sm
from scipy import stats
from scipy.integrate import trapezoid

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.change_point import find_change, fit_onsets


def irregular(rng, n, spacing):
    """Campaigns up to 40 % of their spacing too early or too late; an eighth of them is missing."""
    time = np.arange(n) * spacing + rng.uniform(-0.4, 0.4, n) * spacing
    return time[rng.random(n) > 0.125]


def history(rng, time, kind, percent, since, phi, sigma=0.6):
    """Values of a chart [%] with AR(1) memory, and the true change at the last one."""
    step = np.diff(time)
    share = phi ** (step / np.median(step)) if phi else np.zeros(step.size)
    noise = rng.standard_normal(time.size)
    for i in range(1, time.size):
        noise[i] = share[i - 1] * noise[i - 1] + np.sqrt(1 - share[i - 1] ** 2) * noise[i]
    years = (time - since) / DAYS_PER_YEAR
    truth = percent * np.maximum(years, 0.0) if kind == "drift" else percent * (years >= 0)
    return truth + sigma * noise, truth[-1]


@pytest.mark.parametrize("warm", [False, True])
@pytest.mark.parametrize("phi", [0.0, 0.4])
def test_every_onset_equals_generalised_least_squares(phi, warm):
    rng = np.random.default_rng(3)
    time = irregular(rng, 30, 35.0)
    values, _ = history(rng, time, "drift", -6.0, 700.0, phi)
    lag = np.abs(time[:, None] - time[None]) / np.median(np.diff(time))
    covariance = phi**lag if phi else np.eye(time.size)
    temperature = rng.normal(10.0, 9.0, time.size) if warm else None
    for kind, found in fit_onsets(time, values, phi, pieces=3, temperature=temperature).items():
        for j in range(0, found.onset.size, 7):
            onset = time[-1] + DAYS_PER_YEAR * found.onset[j]
            ramp = np.maximum(time - onset, 0.0) / (time[-1] - onset)
            x = ramp if kind == "drift" else (time >= onset).astype(float)
            columns = np.column_stack([x, temperature]) if warm else x
            oracle = sm.GLS(values, sm.add_constant(columns), sigma=covariance).fit()
            assert found.size[j] == pytest.approx(oracle.params[1], rel=1e-8)
            assert found.rss[j] == pytest.approx(oracle.ssr, rel=1e-8)
            assert found.weight[j] == pytest.approx(oracle.scale / oracle.bse[1] ** 2, rel=1e-8)


def test_a_prior_of_the_slope_acts_like_one_more_measurement():
    # Ridge regression is least squares with a further row, 0 = sqrt(known) b + noise.
    rng = np.random.default_rng(5)
    time, temperature = np.arange(20) * 35.0, rng.normal(10.0, 9.0, 20)
    values, known = rng.standard_normal(20), 700.0
    found = fit_onsets(time, values, 0.0, pieces=1, temperature=temperature, slope_weight=known)["step"]
    for j in range(18):
        x = (time >= time[-1] + DAYS_PER_YEAR * found.onset[j]).astype(float)
        warm = temperature - temperature.mean()
        rows = np.vstack([np.column_stack([np.ones(20), x, warm]), [0.0, 0.0, np.sqrt(known)]])
        oracle = sm.OLS(np.append(values, 0.0), rows).fit()
        assert found.size[j] == pytest.approx(oracle.params[1], rel=1e-8)
        assert found.rss[j] == pytest.approx(oracle.ssr, rel=1e-8)


def test_the_best_step_agrees_with_ruptures():
    ruptures = pytest.importorskip("ruptures")
    rng = np.random.default_rng(6)
    for n in (9, 40, 301):
        for shift in (1.0, 4.0):
            time, values = np.arange(n) * 7.0, rng.standard_normal(n) - shift * (np.arange(n) >= 2 * n // 3)
            break_at = ruptures.KernelCPD(kernel="linear", min_size=2, jump=1).fit(values[:, None]).predict(n_bkps=1)[0]
            step = fit_onsets(time, values, 0.0, pieces=1)["step"]
            inner = step.onset < (time[-2] - time[-1]) / DAYS_PER_YEAR  # ruptures wants two values behind the break
            best = time[-1] + DAYS_PER_YEAR * step.onset[inner][np.argmin(step.rss[inner])]
            assert time[break_at - 1] < best < time[break_at]


def test_the_interval_of_the_size_agrees_with_a_numerical_integration():
    # The posterior on a grid of onset, size and scatter, nothing integrated in closed form. Seven values have no pairs.
    rng = np.random.default_rng(4)
    time = np.arange(7) * 35.0
    values, _ = history(rng, time, "step", -6.0, 120.0, 0.0)
    sizes, sigmas = np.linspace(-40.0, 30.0, 4001), np.geomspace(0.05, 20.0, 300)
    density = np.zeros(sizes.size)
    for kind in ("step", "drift"):
        for onset in np.concatenate([time[i] + 35.0 * (np.arange(4) + 0.5) / 4 for i in range(1, 6)]):
            x = np.maximum(time - onset, 0) / (time[-1] - onset) if kind == "drift" else (time >= onset).astype(float)
            rest = values[None] - sizes[:, None] * x[None]
            rss = np.sum((rest - rest.mean(axis=1, keepdims=True)) ** 2, axis=1)
            # Level integrated: sigma^-(n-1); scale prior 1/sigma; the integral over sigma is left to the grid.
            terms = sigmas[None] ** -(time.size) * np.exp(-0.5 * rss[:, None] / sigmas[None] ** 2)
            density += trapezoid(terms, sigmas, axis=1)
    running = np.cumsum(density) / density.sum()
    low, middle, high = np.interp([0.025, 0.5, 0.975], running, sizes)
    found = find_change(time, values, 0.0)
    assert found.size == pytest.approx(middle, abs=0.05)
    # One degree of freedom less (the onset) makes ours wider: t(4) for t(5).
    wider = stats.t.isf(0.025, 4) / stats.t.isf(0.025, 5) * np.sqrt(5 / 4)
    assert found.high - found.low == pytest.approx(wider * (high - low), rel=0.05)


CASES = [
    ("drift", -10.0, 0.0, 5), ("drift", -6.0, 0.3, 8), ("drift", -3.0, 0.0, 11), ("drift", -3.0, 0.3, 11),
    ("step", -2.0, 0.0, 6), ("step", -3.0, 0.3, 5), ("step", -2.0, 0.3, 9),
]  # fmt: skip


def test_95_percent_of_the_intervals_of_date_and_size_contain_the_truth():
    rng, n = np.random.default_rng(12), 150
    held = []
    for kind, percent, phi, after in CASES:
        is_covered = []
        for _ in range(n):
            time = irregular(rng, 26, 35.0)
            since = rng.uniform(time[-after - 1], time[-after])
            values, now = history(rng, time, kind, percent, since, phi)
            found = find_change(time, values, phi)
            is_covered.append((found.earliest <= since <= found.latest, found.low <= now <= found.high))
        # One case alone scatters by sqrt(0.95 x 0.05 / 150) = 1.8 %; 0.86 is five of that below.
        assert np.mean(is_covered, axis=0).min() > 0.86, (kind, percent, phi)
        held.append(np.mean(is_covered, axis=0))
    # All together: 0.67 % scatter, and 2 % for what a flat prior may miss at chosen sizes.
    assert np.mean(held, axis=0) == pytest.approx([0.95, 0.95], abs=0.02 + 2 * 0.0067)


def test_clear_steps_and_drifts_are_distinguished():
    rng, time = np.random.default_rng(7), np.arange(104) * 7.0
    right = []
    for i in range(60):
        kind = ("step", "drift")[i % 2]
        values, _ = history(rng, time, kind, -1.5 if kind == "step" else -3.0, 360.0, 0.0)
        right.append(find_change(time, values, 0.0).shape == kind)
    assert np.mean(right) >= 0.9


@pytest.mark.parametrize("values", [[1.0, 2.0, 3.0], [2.0] * 9])
def test_too_few_or_constant_values_have_no_change(values):
    found = find_change(np.arange(len(values)) * 7.0, np.array(values), 0.2)
    assert np.isnan([found.since, found.size, found.low]).all()


def test_a_change_without_scatter_is_found_exactly():
    time = np.arange(40.0) * 7.0
    found = find_change(time, -2.0 * (np.arange(40) >= 30), 0.0)
    assert found.shape == "step" and time[29] <= found.earliest <= found.latest <= time[30]
    assert (found.low, found.high) == pytest.approx((-2.0, -2.0), abs=1e-4)


def test_the_interval_of_a_clear_step_is_that_of_students_t():
    """The two-sample interval in closed form, with one degree of freedom less for the onset; no pairs of changes."""
    values = 0.1 * np.array([1, -2, 0.5, 0.5, 2, -1.5, -0.5])
    values[4:] -= 10.0
    found = find_change(np.arange(7) * 7.0, values, 0.0)
    before, after = values[:4], values[4:]
    rss = np.sum((before - before.mean()) ** 2) + np.sum((after - after.mean()) ** 2)
    half = stats.t.isf(0.025, 4) * np.sqrt(rss / 4 * (1 / 4 + 1 / 3))
    assert found.size == pytest.approx(after.mean() - before.mean(), abs=1e-3)
    # the normal distribution would give an interval that is 29 % narrower
    assert found.high - found.low == pytest.approx(2.0 * half, rel=0.01)


def brute_force_size(time, values, pieces, level):
    """Quantiles of the size by a sum over every onset and shape: least squares by numpy, Student's t by scipy."""
    years, n, parts = (time - time[-1]) / DAYS_PER_YEAR, time.size, []
    for i in range(2, n):
        width = (years[i] - years[i - 1]) / pieces
        for k in range(pieces):
            onset = years[i - 1] + (k + 0.5) * width
            for x in ((years >= onset).astype(float), np.maximum(years - onset, 0.0) / -onset):
                design = np.column_stack([np.ones(n), x])
                coefficient, rss, *_ = np.linalg.lstsq(design, values, rcond=None)
                weight = 1.0 / np.linalg.inv(design.T @ design)[1, 1]
                parts.append((width * weight**-0.5 * rss[0] ** (-0.5 * (n - 2)), coefficient[1], rss[0], weight))
    p, size, rss, weight = np.array(parts).T
    freedom = n - 3  # level, size and onset
    scale = np.sqrt(rss / freedom / weight)
    grid = np.linspace(size.min() - 60 * scale.max(), size.max() + 60 * scale.max(), 20_001)
    probability = np.zeros(grid.size)
    for share, middle, width in zip(p / p.sum(), size, scale):
        probability += share * stats.t.cdf(grid, freedom, middle, width)
    return np.interp([0.5 - level / 2, 0.5 + level / 2], probability, grid)


def test_the_interval_of_a_size_from_few_values_is_that_of_students_t():
    """With three degrees of freedom its 95 % limit is 3.18 standard errors; that of a normal distribution is 1.96."""
    rng, n = np.random.default_rng(6), 6
    time = np.arange(n) * 46.0
    values = np.where(np.arange(n) >= n // 2, -3.0, 0.0) + 0.4 * rng.standard_normal(n)
    found = find_change(time, values, 0.0)
    assert [found.low, found.high] == pytest.approx(brute_force_size(time, values, 4, 0.95), rel=2e-3)


def brute_force_two_changes(time, values, level):
    """Interval of the size and probability of two changes: numpy's least squares for every onset and pair of onsets."""
    years, n = (time - time[-1]) / DAYS_PER_YEAR, time.size
    duration, freedom = years[-1] - years[1], n - 2

    def course(shape, onset):
        return (years >= onset).astype(float) if shape == "step" else np.maximum(years - onset, 0.0) / -onset

    def fit(*courses):
        design = np.column_stack([np.ones(n), *courses])
        if np.linalg.matrix_rank(design) < design.shape[1]:
            return None
        coefficient, rss, *_ = np.linalg.lstsq(design, values, rcond=None)
        covariance = np.linalg.inv(design.T @ design)[1:, 1:]
        return coefficient[1:], rss[0], covariance

    def onsets(pieces):
        width = np.diff(years)[1:] / pieces
        return [(years[i + 1] + (k + 0.5) * width[i], width[i]) for i in range(n - 2) for k in range(pieces)]

    one, two, shapes = [], [], ("step", "drift")
    for onset, width in onsets(4):
        for shape in shapes:
            size, rss, covariance = fit(course(shape, onset))
            p = width / (2 * duration) * covariance[0, 0] ** 0.5 * rss ** (-freedom / 2)
            one.append((p, size[0], np.sqrt(rss / (freedom - 1) * covariance[0, 0])))
    for (first, (onset, width)), (second, (later, later_width)) in combinations(enumerate(onsets(1)), 2):
        if second - first < 3:
            continue
        for shape, later_shape in product(shapes, shapes):
            fitted = fit(course(shape, onset), course(later_shape, later))
            if fitted is not None:
                size, rss, covariance = fitted
                alone = np.linalg.inv(np.atleast_2d(np.sum((course(shape, onset) - course(shape, onset).mean()) ** 2)))
                p = width * later_width / (2 * duration**2) * n**-0.5 * alone[0, 0] ** 0.5 * rss ** (-freedom / 2)
                two.append((p, size.sum(), np.sqrt(rss / (freedom - 3) * covariance.sum())))
    grid = np.linspace(-30.0, 30.0, 60_001)
    total = sum(part[0] for part in one + two)
    below = sum(p / total * stats.t.cdf(grid, freedom - 1, size, scale) for p, size, scale in one)
    below = below + sum(p / total * stats.t.cdf(grid, freedom - 3, size, scale) for p, size, scale in two)
    return np.interp([0.5 - level / 2, 0.5 + level / 2], below, grid), sum(part[0] for part in two) / total


@pytest.mark.parametrize("return_size", [2.0, 0.3, -3.0])
def test_the_interval_over_one_and_two_changes_equals_a_sum_over_every_pair(return_size):
    rng, n = np.random.default_rng(8), 16
    time = np.arange(n) * 35.0
    values = -4.0 * (np.arange(n) >= 5) + return_size * (np.arange(n) >= 11) + 0.7 * rng.standard_normal(n)
    interval, probability = brute_force_two_changes(time, values, 0.95)
    found = find_change(time, values, 0.0)
    assert [found.low, found.high] == pytest.approx(interval, abs=0.05)
    assert (len(found.course) == 2) == (probability > 0.95)


TWO_CHANGES = [  # at most two steps or drifts: kind, percent (a year), campaigns before the end
    [("step", -3.0, 80), ("step", 2.0, 30)], [("step", -2.0, 80), ("step", -2.0, 30)],
    [("step", 3.0, 80), ("step", -5.0, 30)], [("drift", -4.0, 90), ("drift", 4.0, 40)],
    [("step", -2.0, 90), ("drift", -3.0, 50)],
]  # fmt: skip


def test_the_intervals_contain_the_truth_after_two_changes():
    """Weekly campaigns. A model of one change contains no size after a partial return and 0.38 after a second step."""
    rng, time, n = np.random.default_rng(31), np.arange(140) * 7.0, 30
    held = []
    for changes in TWO_CHANGES:
        for _ in range(n):
            begins = [time[-before] - rng.uniform(0.0, 7.0) for _, _, before in changes]
            parts = [history(rng, time, k, c, since, 0.2, 0.0) for (k, c, _), since in zip(changes, begins)]
            values = history(rng, time, "step", 0.0, 0.0, 0.2)[0] + parts[0][0] + parts[1][0]
            since = begins[0 if changes[0][1] < 0.0 else 1]  # the first fall
            found = find_change(time, values, 0.2, direction="down")
            now = parts[0][1] + parts[1][1]
            held.append((found.earliest <= since <= found.latest, found.low <= now <= found.high))
    # 150 histories scatter by 1.8 %; 0.86 is five of that below 0.95.
    assert np.mean(held, axis=0).min() > 0.86


def test_no_onset_lies_before_the_last_closed_alarm():
    """A drift that began before a gap fits as well as a step after it."""
    rng, time = np.random.default_rng(3), np.delete(np.arange(100) * 7.0, np.arange(50, 80))
    values = -3.0 * (time >= 560.0) + 0.6 * rng.standard_normal(time.size)
    free, bound = find_change(time, values, 0.0), find_change(time, values, 0.0, not_before=7.0 * 79)
    assert free.earliest < 7.0 * 60
    assert 7.0 * 79 <= bound.earliest <= bound.latest < 570.0


def test_a_clear_drift_is_seldom_taken_for_two_changes():
    """Otherwise its forecast would use only the values after a second change that is none."""
    rng, time = np.random.default_rng(1), np.arange(80) * 7.0
    n_pairs = 0
    for _ in range(40):
        values, _ = history(rng, time, "drift", -10.0, 283.0, 0.0, 0.2)
        n_pairs += len(find_change(time, values, 0.0, direction="down").course) == 2
    assert n_pairs <= 2  # 5 %
