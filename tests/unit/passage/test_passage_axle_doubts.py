"""A count of axles is in doubt where wheels are left out, another count is as clear, or the speed was not sought."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, rolling_noise, sensors_for

from turnout.passage import axle_count
from turnout.passage.analysis import analyse
from turnout.passage.axles import GRID_STEP
from turnout.passage.profile_decoding import decode_profile
from turnout.passage.train_type import UNKNOWN

PLACES = (0.0, 3.6, 9.2, 14.1, 20.0, 26.4)  # m
LOCOMOTIVE = np.array([0.0, 3.0, 9.5, 12.5])
COACH = np.array([0.0, 2.5, 19.0, 21.5])
INTERCITY = np.concatenate([LOCOMOTIVE] + [18.19 + 26.4 * k + COACH for k in range(3)])
END = INTERCITY[-1]  # m
LONGER = {
    "a second locomotive behind": np.concatenate([INTERCITY, END + 5.69 + LOCOMOTIVE]),
    "a locomotive that tows a unit": np.concatenate([LOCOMOTIVE, LOCOMOTIVE[-1] + 6.1 + IC3]),
    "a two-axle wagon behind a unit": np.concatenate([IC3, IC3[-1] + 5.3 + np.array([0.0, 5.0])]),
}


def uncertain(passage):
    return "axles_uncertain" in {f.reason for f in passage.findings}


@pytest.mark.parametrize("name", LONGER)
def test_a_known_train_with_a_further_vehicle_is_not_counted_without_it(name, settings):
    """The wheels of the further vehicle are as loud as the others, so no template of the shorter train fits."""
    offsets = LONGER[name]
    recording = rolling_noise(np.random.default_rng(2), offsets, 30.0, PLACES)
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert (passage.type.type, passage.n_axle) == (UNKNOWN, len(offsets))
    assert passage.speed.speed == pytest.approx(30.0, rel=0.01)


@pytest.mark.parametrize(("offsets", "name"), [(INTERCITY, "intercity"), (IC3, "IC3")])
def test_the_known_train_alone_is_named(offsets, name, settings):
    recording = rolling_noise(np.random.default_rng(2), offsets, 30.0, PLACES)
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert (passage.type.type, passage.n_axle, passage.status) == (name, len(offsets), "accepted")


@pytest.mark.parametrize("position", [-6.0, 26.0, IC3[-1] + 6.0])
@pytest.mark.parametrize(("height", "is_part"), [(0.5, False), (0.7, True)])
def test_a_row_that_leaves_out_a_peak_of_a_wheel_is_a_part_of_another_train(position, height, is_part):
    """Eight peaks of height 1 at the axles of an IC3, and one of 0.5 or 0.7 before, between or behind them."""
    grid = np.arange(0.0, 100.0, GRID_STEP)
    profile = np.exp(-0.5 * ((grid[:, None] - 20.0 - IC3) / 0.3) ** 2).sum(axis=1)
    assert len(decode_profile(profile, 0.0, PATTERNS[0], 60.0, "level").offsets) == 8
    profile += height * np.exp(-0.5 * ((grid - 20.0 - position) / 0.3) ** 2)
    row = decode_profile(profile, 0.0, PATTERNS[0], 60.0, "level")
    assert (row is None) == is_part


@pytest.mark.parametrize(("contrast", "is_doubted"), [(2.9, True), (2.0, False)])
def test_a_count_is_uncertain_where_another_count_is_nearly_as_clear(contrast, is_doubted, settings, monkeypatch):
    """The count of all axles has a contrast of 4, that without the last axle one of 2.9 (4 / 1.38) or 2 (4 / 2)."""
    count_axles = axle_count.axle_counts

    def two_counts(envelopes, motion, settings):
        axles = next(c for c in count_axles(envelopes, motion, settings) if len(c.offsets) == len(IC3))
        fewer = replace(axles, offsets=axles.offsets[:-1], height=axles.height[:-1], contrast=contrast)
        return [replace(axles, contrast=4.0), fewer]

    monkeypatch.setattr(axle_count, "axle_counts", two_counts)
    recording = rolling_noise(np.random.default_rng(2), IC3, 30.0, PLACES)
    passage = analyse(recording, sensors_for(recording), (), settings)
    assert (passage.n_axle, uncertain(passage)) == (len(IC3), is_doubted)


@pytest.mark.parametrize(
    ("speed", "limits", "is_doubted"),
    [(40.0, (15.0, 250.0), False), (40.0, (15.0, 120.0), True), (2.8, (15.0, 250.0), True), (2.8, (5.0, 250.0), False)],
)
def test_a_speed_outside_the_range_that_is_sought_is_a_guess(speed, limits, is_doubted, settings):
    """144 km/h is above 120 km/h, and 10 km/h below 15 km/h."""
    recording = rolling_noise(np.random.default_rng(2), IC3, speed, PLACES, lead=2.0 if speed > 20.0 else 6.0)
    settings = replace(settings, speed_minimum=limits[0], speed_maximum=limits[1])
    passage = analyse(recording, sensors_for(recording), (), settings)
    outside = [f for f in passage.findings if "trains are sought from" in f.detail]
    assert bool(outside) == is_doubted
    if outside:
        assert passage.status == "partly" and outside[0].limit in limits
    else:
        assert passage.n_axle == len(IC3) and passage.speed.speed == pytest.approx(speed, rel=0.01)
