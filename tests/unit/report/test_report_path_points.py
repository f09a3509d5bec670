"""Path data of curves: the sums of the steps are the points, rounded to hundredths of a pixel."""

import re

import numpy as np
import pytest

from turnout.report.path_data import MAX_STEP, MIN_TOGETHER, path_bars, path_points

NUMBER = r"-?(?:\d+(?:\.\d+)?|\.\d+)"


def points_of(path):
    """(n, 2) hundredths of a pixel of the points of path data, as a browser reads them."""
    assert re.fullmatch(rf"M?{NUMBER} {NUMBER}(l({NUMBER} ?)+)?", path)
    numbers = np.array([float(v) for v in re.findall(NUMBER, path)]).reshape(-1, 2)
    return np.cumsum(np.rint(100.0 * numbers).astype(int), axis=0)


@pytest.mark.parametrize(
    "numbers",
    [
        np.random.default_rng(1).uniform(0.0, 999.0, (5000, 2)),
        np.random.default_rng(2).uniform(0.0, 0.1, (500, 2)),
        np.cumsum(np.full((3000, 2), 1.0 / 300.0), axis=0),
        np.linspace(-2.0, 2.0, 400).reshape(-1, 2),
        np.full((MIN_TOGETHER, 2), 7.0),
        np.resize([0.0, MAX_STEP - 0.01], (MIN_TOGETHER, 2)).cumsum(axis=0) % (3 * MAX_STEP),
        np.resize([1.0, -1e6, 1e6], (MIN_TOGETHER, 2)),
    ],
    ids=["any", "small steps", "no error accumulates", "outside", "no step", "large steps", "far"],
)
def test_steps_add_up_to_the_rounded_points(numbers):
    for some in (numbers, numbers[: MIN_TOGETHER - 1], numbers[:1]):
        path = path_points(some[:, 0], some[:, 1])
        np.testing.assert_array_equal(points_of(path), np.rint(100.0 * some).astype(int))


def test_long_and_short_paths_have_the_same_texts():
    points = np.random.default_rng(3).uniform(-50.0, 900.0, (2 * MIN_TOGETHER, 2)).round(1)
    points[10:20] = points[10]
    together, short = path_points(*points.T), path_points(*points[: MIN_TOGETHER - 1].T)
    assert together.startswith(short) and " 0 0 0" in short


def test_bars_start_and_end_at_the_given_positions():
    assert path_bars(np.array([10.0, 0.5]), np.array([20.254, 3.0]), np.array([1.0, 0.0])) == "M10 20.25V1M.5 3V0"
