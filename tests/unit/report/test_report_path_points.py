"""Numbers of long paths are written together, and are those that Python writes one by one."""

import numpy as np
import pytest

from turnout.report.path_data import MAX_PIXEL, MIN_TOGETHER, _format_together, path_points

ONE_BY_ONE = "%.2f %.2f"


def expected(points):
    return "L".join(ONE_BY_ONE % tuple(point) for point in points)


@pytest.mark.parametrize(
    "numbers",
    [
        np.random.default_rng(1).uniform(0.0, MAX_PIXEL - 1.0, (5000, 2)),
        np.arange(1, 4001).reshape(-1, 2) / 8.0,  # every fourth is the middle of two hundredths, and exact
        np.nextafter(np.arange(1, 4001).reshape(-1, 2) / 8.0, 0.0),
        np.linspace(-2.0, 2.0, 400).reshape(-1, 2),  # above and left of the drawing
        np.full((MIN_TOGETHER, 2), MAX_PIXEL - 0.001),
        np.full((MIN_TOGETHER, 2), 1e9),
    ],
    ids=["any", "ties", "just below ties", "outside", "rounded to the limit", "far"],
)
def test_numbers_are_rounded_as_one_by_one(numbers):
    for some in (numbers, numbers[: MIN_TOGETHER - 1], numbers[:1]):
        assert path_points(some[:, 0], some[:, 1]) == expected(some)


def test_usual_numbers_are_format_together_and_others_are_not():
    assert _format_together(np.array([[62.0, 7.25], [999.0, 0.01]])) == "62.00 7.25L999.00 0.01L"
    for odd in (0.0, -1.0, 0.125, MAX_PIXEL, np.nan):
        assert _format_together(np.array([[62.0, odd]])) is None
