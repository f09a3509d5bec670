"""The stated error of a speed is the scatter of the speed, from two sensors as from the distances in the train."""

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, passing_times, rolling_noise

from turnout.passage.axles import sensor_times
from turnout.passage.kinematics import Motion
from turnout.passage.speed import slowness_from_sensors
from turnout.passage.train_detection import sensor_envelopes
from turnout.passage.train_type import axle_times_to_motion, find_type
from turnout.stages.passage_context import known_patterns

N_DRAWS = 300  # its scatter is known to 4 %
SPEED = 40.0


def test_the_error_from_the_distances_of_a_train_is_the_scatter_of_its_speed(settings):
    """The position of every axle has a normal error."""
    rng = np.random.default_rng(4)
    position_se = 0.03
    sigma = float(np.hypot(position_se, settings.type_tolerance / np.sqrt(2.0)))
    found = [
        find_type((IC3 + sigma * rng.standard_normal(IC3.size)) / SPEED, PATTERNS, settings, position_se=position_se)
        for _ in range(N_DRAWS)
    ]
    motions = np.array([f.middle_motion for f in found if f.type == "IC3"])
    assert len(motions) > 0.95 * N_DRAWS
    assert motions[:, 0].std() / motions[:, 1].mean() == pytest.approx(1.0, abs=0.15)
    assert motions[:, 0].mean() == pytest.approx(SPEED, rel=1e-3)


def test_the_covariance_of_the_motion_is_that_of_repeated_trains():
    rng, sigma, acceleration = np.random.default_rng(5), 0.05, 0.2
    t = np.linspace(0.0, 2.5, 16)
    positions = SPEED * t + 0.5 * acceleration * t**2
    draws = []
    for _ in range(N_DRAWS):
        times = t + sigma / SPEED * rng.standard_normal(t.size)
        values, covariance = axle_times_to_motion(times, positions, sigma, 1.0)
        draws.append([*values, *np.sqrt(np.diag(covariance))])
    speed, change, speed_se, change_se = np.array(draws).T
    assert speed.std() / speed_se.mean() == pytest.approx(1.0, abs=0.15)
    assert change.std() / change_se.mean() == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("positions", [(0.0, 18.0), (0.0, 9.0, 18.0, 40.0)])
def test_the_error_from_sensors_is_the_scatter_of_their_slowness(positions):
    """A sensor records all wheels by one distance too early or too late; the timing adds a centimetre."""
    rng, offset = np.random.default_rng(6), 0.1
    positions, draws = np.array(positions), []
    for _ in range(N_DRAWS):
        times = IC3[None] / SPEED + positions[:, None] / SPEED
        times = times + offset / SPEED * rng.standard_normal(positions.size)[:, None]
        times = times + 0.01 / SPEED * rng.standard_normal(times.shape)
        q, _, q_se, *_ = slowness_from_sensors(times, positions, 1, offset, 1.0)
        draws.append((q, q_se))
    q, q_se = np.array(draws).T
    # the spread of more than two sensors is estimated and at least the given one: the error is somewhat large then
    assert (0.7 if positions.size > 2 else 0.88) < q.std() / q_se.mean() < 1.12
    assert q.mean() == pytest.approx(1.0 / SPEED, rel=1e-3)


@pytest.mark.parametrize("speed", [8.0, 15.0])
@pytest.mark.parametrize("axles", [(0.0, 5.0), (0.0, 3.0, 9.5, 12.5), tuple(3.0 * np.arange(24))])
@pytest.mark.parametrize("places", [(3.6, 40.2), (20.0, 24.6, 28.1, 33.0)])
def test_the_acceleration_of_few_axles_has_the_error_of_their_positions(places, axles, speed):
    """Steady trains with axle positions off by 5 cm, as stated: an interval of 95 % holds 0 in 200 x 0.95 ± 9 draws.

    Two axles leave no residual that could show the error.
    """
    rng, inside, errors, estimates = np.random.default_rng(1), 0, [], []
    for _ in range(200):
        positions = np.array(axles) + np.array(places)[:, None] + 0.05 * rng.standard_normal((len(places), len(axles)))
        q, change, _, change_se, _, _ = slowness_from_sensors(positions / speed, places, 1, 0.05, 1.2)
        inside += abs(change) <= 1.96 * change_se
        errors.append(change_se / q**2)
        estimates.append(-change / q**2)
    assert inside >= 180
    assert np.median(errors) < 2.0 * np.std(estimates) + 0.3 * (len(axles) == 2)  # m/s²; the prior is 0 ± 0.3


def test_axles_that_fit_by_chance_do_not_determine_the_acceleration(settings):
    """Four axles within 0.6 s: 0.5 m/s² moves them by 2 cm, so the prior's standard deviation is that of the result."""
    axles = np.array([0.0, 3.0, 9.5, 12.5])
    finding = find_type(axles / 21.0, known_patterns("config/vehicles/axle_patterns.yaml"), settings, 21.0, 0.2, 0.05)
    assert finding.type == "locomotive" and finding.residual < 1e-3
    prior = np.sqrt(0.8 * 0.02**2 + 0.2 * (0.25 * settings.acceleration_limit) ** 2)
    assert finding.acceleration_se == pytest.approx(prior, rel=0.1)


def test_a_sensor_that_records_no_axle_at_the_common_position_has_no_time(settings):
    """Its position is 5 m wrong; the others record the axles where they are."""
    recording = rolling_noise(np.random.default_rng(21), IC3, 40.0, (0.0, 4.0, 9.0, 16.5, 22.0))
    positions = np.array([0.0, 4.0, 9.0, 21.5, 22.0])
    envelopes = sensor_envelopes(recording.samples, recording.rate, positions, settings.envelope_step)
    times = sensor_times(envelopes, Motion(40.0, 1.0), IC3)
    assert np.isnan(times[3]).sum() >= 6  # two lie on the slope of another axle
    expected = passing_times(IC3, positions, 40.0, 0.0, 1, 1.0)
    right = [0, 1, 2, 4]
    assert np.nanmax(np.abs(times - expected)[right]) * 40.0 < 0.3 and np.isfinite(times[right]).mean() > 0.9
