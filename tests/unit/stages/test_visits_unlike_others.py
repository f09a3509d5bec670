"""A channel that a visit leaves unlike its other visits is stated, whatever the calibrated model answers."""

from types import SimpleNamespace

import numpy as np
import pytest

from turnout.mismatch.turnout.calibration import channel_levels
from turnout.stages.stored_visits import StoredVisit
from turnout.stages.visits_unlike_others import notes_on_channels

A2 = "channel A2 in the hammer tests"


def visits_with(*levels, sections="S1, S2", first=2020):
    """Visits of June 2020, 2021, ... with these mean squares of one channel."""
    return [
        StoredVisit(
            f"{first + k}-06-01",
            sections,
            "",
            (),
            (),
            levels={A2: level, "channel A1 in the passages": 0.5 + 0.9 * level},
        )
        for k, level in enumerate(levels)
    ]


def test_a_channel_that_one_visit_leaves_nine_times_as_much_is_stated_with_the_command():
    """The median of 0.4, 0.5 and 0.7 is 0.5; 4.55 is 9.1 times as much. A1 shows it a little less."""
    assert notes_on_channels("t1", visits_with(0.4, 4.55, 0.5, 0.7)) == [
        "visit 2021-06-01: channel A2 in the hammer tests differs from the fitted simulation 9.1 times as much as at "
        "the other visits (mean square, 3 visits): turnout diagnose --turnout t1 --visit 2021-06-01 examines it"
    ]


@pytest.mark.parametrize(
    "levels",
    [
        (0.4, 0.5, 1.3),  # 2.9 times the median of the two others
        (5.0, 4.5, 6.0, 5.5),  # always as large: an error of the model, not of a visit
        (0.5, 4.5),  # one other visit does not tell which of the two is right
    ],
)
def test_ordinary_scatter_a_constant_error_and_two_visits_are_not_stated(levels):
    assert notes_on_channels("t1", visits_with(*levels)) == []


def test_groups_of_sections_are_compared_each_with_itself():
    """Compared together, the visits of S3 from 2024 on would differ by 8 times the median of the others."""
    visits = [*visits_with(0.4, 0.5, 0.6, 0.5), *visits_with(5.0, 4.5, 6.0, sections="S3", first=2024)]
    assert notes_on_channels("t1", visits) == []


def test_levels_are_mean_squares_by_channel_and_type_of_recording():
    sensors = (SimpleNamespace(name="A1"), SimpleNamespace(name="A2"))
    case = SimpleNamespace(
        observations=[SimpleNamespace(name=n) for n in ("frf 1", "frf 2", "train")],
        aligned_passages={"train": SimpleNamespace(sensors=sensors)},
        frf_pairs={n: SimpleNamespace(channel="A2") for n in ("frf 1", "frf 2")},
    )
    white = [np.array([1.0, -1.0]), np.array([3.0, 0.0, 0.0]), np.array([1.0, 2.0, -4.0, 2.0])]
    assert channel_levels(case, SimpleNamespace(white=white)) == {
        A2: pytest.approx(2.0),  # of 1 and 9 / 3
        "channel A1 in the passages": pytest.approx(2.5),
        "channel A2 in the passages": pytest.approx(10.0),
    }
