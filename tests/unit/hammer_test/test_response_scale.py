"""At first an impact moves the rail alone: free rails bound every track, and wrong units leave this range."""

from dataclasses import replace
from datetime import date

import numpy as np
import pytest
from benchmarks.random_tracks import RandomTrack

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.demo.hammer import RATE, hammer_test, pulse, response_to, simulated_response
from turnout.hammer_test import find_impacts
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.hammer_test.response_scale import (
    AREA,
    MASS,
    MAX_INCOMPLETE,
    RAILS,
    RATES,
    SECOND_MOMENT,
    SHEAR_COEFFICIENT,
    SHEAR_MODULUS,
    YOUNGS_MODULUS,
    _resistance,
    equivalent_free_rails,
    free_rail_mobility,
)
from turnout.records import Channel, Recording

SECTIONS = "OT", "SP", "CLP", "A7", "A8", "A9", "ASM", "ASD"
# Factors of the response by the confusions lbf/N, g/(m/s²), inch/mm, kN/N; the inverse ones apply to the force.
FACTORS = 4.448, 1 / 4.448, 9.81, 1 / 9.81, 25.4, 1 / 25.4, 1000.0, 1 / 1000.0
CHANNELS = Channel("force", "force"), Channel("rail", "acceleration")


def track_test(section, ballast=1.0, railpad=1.0, n=5, seed=1):
    response = simulated_response(section, ballast, railpad)
    return hammer_test(response, 12.0, date(2024, 5, 13), 1, np.random.default_rng(seed), n_impacts=n)[0]


def rails_of(recordings):
    return equivalent_free_rails([i for i in find_impacts(recordings, "force", "rail") if i.accepted])


def random_foundation(rng, s):
    """Stiffness of two-layer supports per metre at a real s: pads of 50 to 1,500 MN/m, ballast of 15 to 300."""
    pad, ballast = (np.exp(rng.uniform(*np.log(limits))) for limits in ((50e6, 1500e6), (15e6, 300e6)))
    upper = pad + np.exp(rng.uniform(*np.log((3e3, 60e3)))) * s
    lower = ballast + np.exp(rng.uniform(*np.log((20e3, 200e3)))) * s + rng.uniform(60.0, 350.0) * s**2
    return upper * lower / (upper + lower) / rng.uniform(0.5, 0.75)


@pytest.mark.parametrize("foundation", [0.0, 3e8])
@pytest.mark.parametrize("s", RATES)
def test_the_closed_form_is_the_integral_over_the_wave_number(s, foundation):
    k = np.concatenate([np.linspace(0.0, 100.0, 20001), np.geomspace(100.0, 1e6, 6000)[1:]])
    shear, rotation = SHEAR_COEFFICIENT * SHEAR_MODULUS * AREA, MASS / AREA * SECOND_MOMENT * s**2
    bending = YOUNGS_MODULUS * SECOND_MOMENT * k**2
    stiffness = MASS * s**2 + foundation + shear * k**2 * (bending + rotation) / (shear + bending + rotation)
    y = 1.0 / stiffness
    integral = s / np.pi * (np.sum((y[1:] + y[:-1]) * np.diff(k)) / 2.0 + 1.0 / (shear * k[-1]))
    assert free_rail_mobility(s, foundation) == pytest.approx(integral, rel=3e-3)


def test_rails_and_crossings_are_within_the_range_and_outside_with_wrong_factors():
    """Rails 45 to 60 kg/m, or a crossing of up to twice the mass and four times the stiffness of 60E1."""
    rng, values = np.random.default_rng(20), []
    for k in range(4000):
        mass, stiffness = [(45.0, 1500.0), (49.4, 1816.0), (60.2, 3037.0), (60.2, 3037.0)][k % 4]
        if k % 4 == 3:
            mass, stiffness = mass * rng.uniform(1.0, 2.0), stiffness * rng.uniform(1.0, 4.0)
        foundation = random_foundation(rng, RATES[0])
        free = free_rail_mobility(RATES[0])
        values.append(free / free_rail_mobility(RATES[0], foundation, mass / MASS, stiffness * 1e-8 / SECOND_MOMENT))
    values = np.array(values)
    outside = np.mean((values < RAILS[0]) | (values > RAILS[1]))
    assert outside <= 1e-3
    assert np.all(values * 9.81 > RAILS[1]) and np.mean(values / 4.448 >= RAILS[0]) <= 1e-3
    # Newton read as pounds-force: a light rail beyond 5.4 / 4.448 = 1.21 is found.
    assert np.array_equal(values * 4.448 > RAILS[1], values > 1.214)


def test_stiff_tracks_stay_within_the_range_with_the_accelerometer_beside_the_hammer():
    """Transfer mobilities up to 0.2 m from the impact, by the closed form of the benchmark in the wave number."""
    rng, inside, n_stiff = np.random.default_rng(22), [], 0
    for k in range(2000):
        is_crossing = k % 2
        pad, ballast = np.exp(rng.uniform(*np.log(((50e6, 15e6), (1500e6, 300e6)))))
        mass, second_moment = rng.uniform(49.0, 60.3), 3055e-8
        if is_crossing:
            mass, second_moment = mass * rng.uniform(1.0, 2.0), second_moment * rng.uniform(1.0, 4.0)
        track = RandomTrack(mass, second_moment, (pad, 1e-4 * pad), rng.uniform(35.0, 300.0), (ballast, 5e-4 * ballast))
        distance = rng.uniform(0.0, 0.2)
        mobilities = [s * abs(track.receptance(np.array([-1j * s]), distance)[0]) for s in RATES]
        rails, limits = _resistance(*mobilities)
        inside.append(limits[0] <= rails <= limits[1])
        n_stiff += rails > 3.45
    assert np.mean(inside) >= 0.999
    assert n_stiff > 20  # a limit for an accelerometer at the hammer rejected these


@pytest.mark.parametrize(("rate", "is_measured"), [(5_000.0, False), (7_900.0, False), (8_000.0, True)])
def test_a_sampling_rate_that_does_not_resolve_the_first_moments_gives_no_value(rate, is_measured):
    impacts = [i for i in find_impacts(track_test("SP"), "force", "rail") if i.accepted]
    assert (equivalent_free_rails([replace(i, rate=rate) for i in impacts]) is not None) == is_measured


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize(("ballast", "railpad"), [(1.0, 1.0), (0.3, 0.4), (2.0, 2.0)])
def test_tracks_are_accepted_and_each_factor_is_found(section, ballast, railpad):
    found = find_impacts(track_test(section, ballast, railpad), "force", "rail")
    impacts = [i for i in found if i.accepted]
    rails, limits, is_track = equivalent_free_rails(impacts)
    assert RAILS[0] <= rails <= RAILS[1] and limits == RAILS and is_track
    for factor in FACTORS:
        if factor == 1 / 4.448 and rails < 1.25:
            continue  # newton read as pounds-force on a light rail, and what noise may change
        scaled = [replace(i, acceleration=i.acceleration * factor, noise_acceleration=i.noise_acceleration * factor)
                  for i in impacts]  # fmt: skip
        assert not equivalent_free_rails(scaled).is_track, factor


@pytest.mark.parametrize("channel", [0, 1])
@pytest.mark.parametrize("factor", FACTORS)
def test_a_factor_on_either_channel_rejects_the_test_with_its_reason(channel, factor):
    scale = np.ones((2, 1))
    scale[channel] = factor
    limitless = [Recording(r.samples * scale, RATE, CHANNELS, "a", record=r.record) for r in track_test("SP")]
    impacts = find_track_impacts(limitless, "force", "rail", ReceptanceSettings())
    assert {r.reason for i in impacts for r in i.rejections} == {"out_of_scale"}


@pytest.mark.parametrize("contact", [0.4e-3, 0.8e-3, 1.5e-3, 3e-3])
@pytest.mark.parametrize("shift", [-2, 0, 3])
def test_a_track_is_within_the_range_with_any_contact_time_and_lag_of_a_filter(contact, shift):
    rng, recordings = np.random.default_rng(3), []
    response = simulated_response("CLP", 1.0, 1.0)
    for k in range(5):
        force = pulse(6000.0, contact, (100 + rng.uniform()) / RATE)
        rail = np.roll(response_to(force, response(rng)), shift)
        samples = np.stack([force, rail]) + rng.normal(size=(2, force.size)) * [[6.0], [0.01 * np.max(np.abs(rail))]]
        recordings.append(Recording(samples, RATE, CHANNELS, "a", record=k))
    rails, limits, _ = rails_of(recordings)
    assert RAILS[0] <= rails <= RAILS[1]
    assert rails / 4.448 < limits[0]
    assert shift > 0 or rails * 9.81 > limits[1]


def test_a_single_mass_of_a_heavy_track_is_accepted_and_not_ten_times_as_much():
    """A model of one mode lacks the rail: 250 kg at 160 Hz."""
    rng, t, recordings = np.random.default_rng(3), np.arange(3000) / RATE, []
    omega, damping = 2 * np.pi * 160.0, 0.08
    line = 2 * np.pi * np.fft.rfftfreq(t.size, 1 / RATE)
    mode = np.fft.irfft(-(line**2) / 250.0 / (omega**2 - line**2 + 2j * damping * omega * line), t.size) * RATE
    for k in range(5):
        force = pulse(6000.0, 1.2e-3, (100 + rng.uniform()) / RATE)
        rail = response_to(force, mode)
        samples = np.stack([force, rail]) + rng.normal(size=(2, t.size)) * [[6.0], [0.01 * np.max(np.abs(rail))]]
        recordings.append(Recording(samples, RATE, CHANNELS, "a", record=k))
    rails, limits, _ = rails_of(recordings)
    assert 5.0 < rails < limits[1] == MAX_INCOMPLETE < 9.81 * rails


def test_without_impacts_or_response_there_is_no_value():
    assert equivalent_free_rails([]) is None
