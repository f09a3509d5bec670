"""Axles, speed, direction, track and type of trains in synthetic recordings."""

from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, RATE, impact_train, rolling_noise, sensors_for

from turnout.passage.analysis import analyse
from turnout.passage.kinematics import Motion
from turnout.passage.position_checks import inconsistent_positions
from turnout.passage.slowness_scan import scan_slowness
from turnout.passage.speed import slowness_from_sensors
from turnout.stages.passage_context import known_patterns

COACHES = np.concatenate(
    [[0.0, 3.0, 9.5, 12.5]] + [18.98 - 3.24 + 2.45 + 26.4 * k + np.array([0, 2.5, 19, 21.5]) for k in range(3)]
)
ODD = np.cumsum([0.0, 2.2, 12.9, 2.2, 6.1, 2.2, 13.7, 2.2])


def reasons(passage):
    return {f.reason for f in passage.findings}


@pytest.mark.parametrize("direction, name", [(1, "facing"), (-1, "trailing")])
@pytest.mark.parametrize("speed, acceleration, tolerance", [(8.0, 0.0, 0.1), (25.0, 0.4, 0.15), (55.0, -0.5, 0.6)])
def test_a_rolling_train_is_recognized_from_three_sensors(direction, name, speed, acceleration, tolerance, settings):
    """Speed within 0.3 % at mid-train with any acceleration; every axle; type; direction.

    At 55 m/s the train is past in a second: its change of speed moves no axle by more than the timing, and the
    prior of a steady speed stands.
    """
    positions = (-3.0, 1.5, 9.0)
    recording = rolling_noise(np.random.default_rng(1), IC3, speed, positions, direction, acceleration=acceleration)
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert passage.n_axle == 8 and passage.direction == name and passage.type.type == "IC3"
    first_at = 1.0 + (0.0 - np.min(direction * np.array(positions))) / speed
    lasted = IC3[-1] / speed
    middle = first_at + lasted / 2
    true = speed + acceleration * (middle - 1.0)
    assert passage.motion.speed_at(middle) == pytest.approx(true, rel=3e-3)
    assert passage.speed.acceleration == pytest.approx(acceleration, abs=tolerance)
    assert passage.status == "accepted"


def test_a_train_of_impulses_is_timed_to_microseconds_after_blind_detection(settings):
    """From the raw recording to impact times: 40 dB, the bound is 0.7 us and twice it holds for the rms of 8 wheels."""
    from benchmarks.passage_truth import paper_model

    from turnout.passage.channel_fit import fit_channel

    recording, times = impact_train(np.random.default_rng(2), ["CP A7", "OT"], [0.0, 4.0])
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert passage.type.type == "IC3" and passage.speed.speed == pytest.approx(44.4, rel=2e-3)
    fit = fit_channel(
        recording.signal("c0"), RATE, passage.at_sensor["c0"], passage.motion.speed, paper_model("CP A7"), settings
    )
    assert np.sqrt(np.mean((fit.times - times[0]) ** 2)) < 1.5e-6
    assert fit.status == "accepted" and not fit.ambiguous.any()


def test_a_locomotive_with_coaches_is_recognized_by_its_row_of_vehicles(settings):
    recording = rolling_noise(np.random.default_rng(3), COACHES, 33.0, (0.0, 6.0))
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert passage.type.type == "intercity"
    assert [v.name for v in passage.type.vehicles] == ["loco", "coach", "coach", "coach"]


def test_the_same_train_is_recognized_when_it_runs_backwards(settings):
    backwards = COACHES[-1] - COACHES[::-1]
    recording = rolling_noise(np.random.default_rng(4), backwards, 33.0, (0.0, 6.0))
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert [v.name for v in passage.type.vehicles] == ["coach", "coach", "coach", "loco"]


def test_a_train_without_a_template_is_unknown_and_its_speed_is_measured(settings):
    recording = rolling_noise(np.random.default_rng(5), ODD, 30.0, (0.0, 7.0, 15.0))
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert passage.type.type == "unknown" and passage.type.probability > 0.95
    assert passage.n_axle == 8
    assert passage.offsets - passage.offsets[0] == pytest.approx(ODD, abs=0.25)
    assert passage.speed.speed == pytest.approx(30.0, abs=4 * passage.speed.se)


def test_one_sensor_determines_the_speed_by_the_template_and_no_direction(settings):
    recording = rolling_noise(np.random.default_rng(6), IC3, 40.0, (2.0,))
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert (passage.type.type, passage.direction, passage.speed.source) == ("IC3", "unknown", "axle spacing")
    # 8 axles over 53 m, each placed to some 10 cm by bursts of 0.4 m: 0.2 % of the speed
    assert passage.speed.se < 3e-3 * 40.0
    assert passage.speed.speed == pytest.approx(40.0, abs=3 * passage.speed.se)


def test_the_speed_of_an_unknown_train_at_one_sensor_has_a_large_error(settings):
    recording = rolling_noise(np.random.default_rng(7), ODD, 30.0, (2.0,))
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert passage.type.type == "unknown" and passage.speed.source == "bogie"
    assert passage.speed.se > 0.1 * passage.speed.speed


def test_the_track_of_a_train_is_that_of_the_sensors_that_record_it(settings):
    recording = rolling_noise(np.random.default_rng(8), IC3, 40.0, (0.0, 5.0, 9.0, 12.0))
    samples = recording.samples.copy()
    samples[1] = samples[3] = 0.02 * np.random.default_rng(9).standard_normal(samples.shape[1:])
    recording = replace(recording, samples=samples)
    tracks = ["both", "diverging", "main", "diverging"]
    passage = analyse(recording, sensors_for(recording, tracks), PATTERNS, settings)
    assert passage.track == "main" and set(passage.audible_sensors) == {"c0", "c2"}
    swapped = ["both", "main", "diverging", "main"]
    assert analyse(recording, sensors_for(recording, swapped), PATTERNS, settings).track == "diverging"


def test_noise_is_no_train(settings):
    recording = rolling_noise(np.random.default_rng(10), IC3, 40.0, (0.0, 4.0))
    noise = np.random.default_rng(11).standard_normal(recording.samples.shape)
    passage = analyse(replace(recording, samples=noise), sensors_for(recording), PATTERNS, settings)
    assert (passage.status, passage.reason, passage.n_axle) == ("rejected", "no_train", 0)


def test_a_train_cut_off_at_either_end_is_reported(settings):
    recording = rolling_noise(np.random.default_rng(12), IC3, 40.0, (0.0, 4.0))
    for part, words in (
        (slice(int(1.5 * RATE), None), "after the start"),
        (slice(0, int(2.2 * RATE)), "before the end"),
    ):
        cut = replace(recording, samples=recording.samples[:, part])
        passage = analyse(cut, sensors_for(cut), PATTERNS, settings)
        assert passage.status == "partly" and "train_cut_off" in reasons(passage)
        assert any(words in f.detail for f in passage.findings)
        assert 3 <= passage.n_axle < 8 and passage.type.type == "unknown"


def test_a_second_train_in_the_other_direction_is_detected_and_reported(settings):
    positions = (0.0, 6.0, 11.0, 19.0)
    first = rolling_noise(np.random.default_rng(13), IC3, 40.0, positions)
    other = rolling_noise(np.random.default_rng(14), COACHES, 25.0, positions, direction=-1, lead=1.4)
    n = min(first.n_sample, other.n_sample)
    both = replace(first, samples=first.samples[:, :n] + 0.5 * other.samples[:, :n])
    passage = analyse(both, sensors_for(both), PATTERNS, settings)
    assert "two_trains" in reasons(passage)
    alone = analyse(first, sensors_for(first), PATTERNS, settings)
    assert "two_trains" not in reasons(alone)


def test_clipped_dead_and_lost_channels_are_reported_and_the_others_are_used(settings):
    recording = rolling_noise(np.random.default_rng(15), IC3, 40.0, (0.0, 3.0, 6.0, 9.0, 12.0))
    samples = recording.samples.copy()
    samples[1] = np.clip(samples[1], -1.0, 1.0)
    samples[2] = 0.0
    samples[3, int(1.9 * RATE) :] = 0.125
    samples[4, 777] = np.nan
    recording = replace(recording, samples=samples)
    passage = analyse(recording, sensors_for(recording), PATTERNS, settings)
    assert reasons(passage) == {"clipped", "dead_channel", "sensor_lost", "not_finite"}
    assert passage.status == "partly" and passage.n_axle == 8 and passage.type.type == "IC3"
    lost = next(f for f in passage.findings if f.reason == "sensor_lost")
    assert lost.value == pytest.approx(1.9, abs=0.01) and "c3: constant from 1.90 s on" in lost.detail


def test_exchanged_channels_are_reported_and_left_out(settings):
    positions = (0.0, 4.0, 9.0, 15.0, 22.0)
    recording = rolling_noise(np.random.default_rng(16), IC3, 40.0, positions)
    samples = recording.samples.copy()
    samples[[1, 3]] = samples[[3, 1]]
    passage = analyse(replace(recording, samples=samples), sensors_for(recording), PATTERNS, settings)
    swapped = [f for f in passage.findings if f.reason == "channels_swapped"]
    assert len(swapped) == 1 and "c1 and c3" in swapped[0].detail
    assert passage.n_axle == 8 and passage.speed.speed == pytest.approx(40.0, rel=3e-3)
    assert not {"c1", "c3"} & set(passage.audible_sensors)


def test_a_clock_with_an_offset_of_a_tenth_of_a_second_is_reported(settings):
    positions = (0.0, 4.0, 9.0, 15.0, 22.0)
    recording = rolling_noise(np.random.default_rng(17), IC3, 40.0, positions)
    samples = recording.samples.copy()
    samples[2] = np.roll(samples[2], int(0.1 * RATE))
    passage = analyse(replace(recording, samples=samples), sensors_for(recording), PATTERNS, settings)
    named = [f for f in passage.findings if f.reason == "clock_drift"]
    assert len(named) == 1 and named[0].detail.startswith("c2: ")
    assert passage.speed.speed == pytest.approx(40.0, rel=3e-3)


def test_fewer_than_four_sensors_do_not_identify_the_faulty_one(settings):
    recording = rolling_noise(np.random.default_rng(18), IC3, 40.0, (0.0, 4.0, 9.0))
    findings, keep = inconsistent_positions(recording, Motion(40.0), sensors_for(recording))
    assert findings == [] and keep.all()


def test_slowness_from_sensors_of_exact_times():
    """Times of an accelerated motion at three places give its slowness and its change back."""
    motion = Motion(30.0, 2.0, 0.5, -1)
    offsets, positions = np.array([0.0, 3.0, 17.0, 20.0, 40.0]), np.array([-4.0, 0.0, 7.0])
    times = np.array([motion.passing(offsets, x) for x in positions])
    q, change, se, *_ = slowness_from_sensors(times, positions, -1, 1e-4, 50.0)
    assert 1 / q == pytest.approx(float(motion.speed_at(times.mean())), rel=2e-3)
    # slowness 1/v changes by -a/v² per second; over the train's way the second order is 5 % of it
    assert -change / q**2 == pytest.approx(0.5, rel=0.06)
    assert se > 0


def test_slant_stack_of_shifted_pulses_gives_direction_and_speed(settings):
    """A box of 60 ms moved by 20 m at 25 m/s: the likeness has its maximum at 0.04 s/m, a grid step is 0.8 %."""
    values = np.zeros((2, 4000))
    values[0, 1000:1060], values[1, 1800:1860] = 1.0, 1.0
    scan = scan_slowness(values, 0.001, [0.0, 20.0], settings)
    assert scan.peaks(1)[0][0] == pytest.approx(0.04, rel=0.01)
    turned = scan_slowness(values[::-1], 0.001, [0.0, 20.0], settings)
    assert turned.peaks(1)[0][0] == pytest.approx(-0.04, rel=0.01)


def test_motion_and_its_inverse_agree_with_the_law_of_motion():
    motion = Motion(20.0, 1.5, -0.3, 1)
    way = np.array([-30.0, 0.0, 55.0])
    time = motion.time(way)
    assert 20.0 * (time - 1.5) - 0.15 * (time - 1.5) ** 2 == pytest.approx(way)
    assert motion.distance(time) == pytest.approx(way)
    later = motion.relative_to_axle(40.0)
    assert later.time(0.0) == pytest.approx(motion.time(40.0))
    assert later.speed == pytest.approx(np.sqrt(20.0**2 - 2 * 0.3 * 40.0))


@pytest.mark.parametrize(
    ("axles", "type_"),
    [
        ((0.0, 3.0, 9.5, 12.5), "locomotive"),
        ((0.0, 3.0, 9.5, 12.5, 18.98, 21.98, 28.48, 31.48), "locomotive"),
        ((0.0, 2.5, 19.0, 21.5), "unknown"),  # a single coach
    ],
)
def test_a_single_locomotive_has_its_template_and_a_single_coach_has_none(axles, type_, settings, repository):
    patterns = known_patterns(str(repository / "config" / "vehicles" / "axle_patterns.yaml"))
    recording = rolling_noise(np.random.default_rng(9), np.array(axles), 25.0, (0.0, 10.0, 30.0, 40.0))
    passage = analyse(recording, sensors_for(recording), patterns, settings)
    assert (passage.n_axle, passage.type.type) == (len(axles), type_)
