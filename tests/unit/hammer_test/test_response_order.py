"""The force supplies energy to a passive structure, so the phase distinguishes an acceleration from a velocity."""

import numpy as np
import pytest

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.demo.hammer import RATE, pulse, response_to, simulated_response
from turnout.hammer_test import find_impacts
from turnout.hammer_test.response_order import (
    MAX_DELAY,
    REFUTED,
    PhaseLines,
    active_share,
    is_velocity,
    judge_response_order,
)
from turnout.hammer_test.response_quality import find_track_impacts
from turnout.hammer_test.response_scale import equivalent_free_rails
from turnout.records import Channel, Recording

SECTIONS = "OT", "SP", "CLP", "A7", "A8", "A9", "ASM", "ASD"
TRACKS = (1.0, 1.0), (0.3, 0.4), (2.0, 2.0)  # factors of the stiffness of ballast and pads
CHANNELS = Channel("force", "force"), Channel("rail", "acceleration")
FREQUENCY = np.linspace(30.0, 800.0, 155)
OMEGA = 2.0 * np.pi * FREQUENCY
MOBILITY = {  # driving points in closed form
    "mass": 1.0 / (250j * OMEGA),
    "spring": 1j * OMEGA / 40e6,
    "damper": np.full_like(OMEGA, 1e-5) + 0j,
    "resonator": 1j * OMEGA / (250.0 * ((2 * np.pi * 160.0) ** 2 - OMEGA**2 + 0.16j * 2 * np.pi * 160.0 * OMEGA)),
    "infinite Euler beam": (1.0 - 1j) / (4.0 * 60.0**0.75 * 6.4e6**0.25 * np.sqrt(OMEGA)),
}


@pytest.mark.parametrize("structure", MOBILITY)
@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_passive_structure_is_never_active_in_its_own_order(structure, order):
    h = MOBILITY[structure] * (1j * OMEGA) ** (order - 1)
    assert active_share(PhaseLines(FREQUENCY, h, np.zeros(155)), order) == 0.0
    reversed_sign = PhaseLines(FREQUENCY, -h, np.zeros(155))
    assert active_share(reversed_sign, order + 2) == 0.0
    is_lossless = structure in ("mass", "spring")  # its power is 0 with both signs
    assert is_lossless or active_share(reversed_sign, order) > REFUTED


def test_a_resonator_is_active_in_each_other_order_on_one_side_of_its_resonance():
    """Its mobility turns from 90 to -90 degrees at 160 Hz: 26 of 155 lines are below, 129 at or above."""
    h = MOBILITY["resonator"]
    lines = PhaseLines(FREQUENCY, h, np.zeros(155))
    delayed = OMEGA * MAX_DELAY  # a delay turns a line by up to so much
    phase = np.angle(h)
    as_acceleration = np.mean(phase - np.pi / 2 + delayed < -np.pi / 2)
    as_displacement = np.mean(phase + np.pi / 2 - delayed > np.pi / 2)
    assert active_share(lines, 2) == pytest.approx(as_acceleration, abs=0.01) and as_acceleration > 0.3
    assert active_share(lines, 0) == pytest.approx(as_displacement, abs=0.01) and as_displacement > 0.1


def beam_receptance(distance, pad, ballast, sleeper):
    r"""Infinite Euler beam on two layers, :math:`-(i e^{-i\kappa x} + e^{-\kappa x}) / (4 EI \kappa^3)`, 60 kg/m."""
    upper, lower = pad * (1.0 + 0.25j), ballast * (1.0 + 0.3j) - sleeper * OMEGA**2
    power = (60.0 * OMEGA**2 - upper * lower / (upper + lower)) / 6.4e6  # of the fourth order in the wave number
    roots = np.abs(power) ** 0.25 * np.exp(0.25j * np.angle(power)) * 1j ** np.arange(4)[:, None]
    outgoing = np.argmax((roots.real > 0.0) & (roots.imag <= 0.0), axis=0)
    kappa = roots[outgoing, np.arange(OMEGA.size)]
    return -(1j * np.exp(-1j * kappa * distance) + np.exp(-kappa * distance)) / (4.0 * 6.4e6 * kappa**3)


@pytest.mark.parametrize("supports", [(4e8, 1e8, 250.0), (1e9, 3e8, 300.0), (1e8, 3e7, 250.0)])
@pytest.mark.parametrize("distance", [0.0, 0.2, 0.5, 0.7, 1.0, 1.5])
def test_near_the_hammer_no_acceleration_is_mistaken_for_a_velocity(distance, supports):
    """A velocity is found up to half a metre from the hammer. Farther away nothing is stated."""
    receptance = beam_receptance(distance, *supports)
    velocity, acceleration = (PhaseLines(FREQUENCY, (1j * OMEGA) ** n * receptance, np.zeros(155)) for n in (1, 2))
    assert is_velocity(velocity) == (distance <= 0.5) and not is_velocity(acceleration)


def hammer_test(section, factors, order, n=5, delay=0, sign=1.0, noise=0.01):
    """Recordings whose response is a derivative of the displacement: in m/s², mm/s or µm."""
    rng, response, recordings = np.random.default_rng(3), simulated_response(section, *factors), []
    for record in range(n):
        force = pulse(6000.0 * rng.uniform(0.8, 1.2), 1.5e-3, (100 + rng.uniform()) / RATE)
        spectrum = np.fft.rfft(response_to(force, response(rng)))
        omega = 2.0 * np.pi * np.fft.rfftfreq(force.size, 1.0 / RATE)
        spectrum[0] *= order == 2
        spectrum[1:] *= (1j * omega[1:]) ** (order - 2) * 1e3 ** (2 - order)
        x = sign * np.roll(np.fft.irfft(spectrum, force.size), delay)
        samples = np.stack([force, x]) + rng.normal(size=(2, x.size)) * [[6.0], [noise * np.abs(x).max()]]
        recordings.append(Recording(samples, RATE, CHANNELS, "a", record=record))
    return recordings


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("factors", TRACKS)
def test_a_velocity_in_mm_s_is_rejected_with_its_reason_and_an_acceleration_is_accepted(section, factors):
    recordings = hammer_test(section, factors, 1)
    impacts = find_track_impacts(recordings, "force", "rail", ReceptanceSettings())
    reasons = {(r.reason, r.channel) for i in impacts for r in i.rejections}
    assert reasons == {("out_of_scale", "rail")} and not any(i.accepted for i in impacts)
    assert all("rail has the phase of a velocity" in r.detail for i in impacts for r in i.rejections)
    for delay in (-2, 0, 2):
        impacts = find_impacts(hammer_test(section, factors, 2, delay=delay), "force", "rail")
        assert judge_response_order(impacts, "rail") == tuple(impacts)


def test_the_scale_of_a_response_alone_does_not_reveal_a_velocity():
    """The scale alone corresponds to 2.2 times the actual number of rails, as at a crossing."""
    impacts = [i for i in find_impacts(hammer_test("SP", (1.0, 1.0), 1), "force", "rail") if i.accepted]
    assert equivalent_free_rails(impacts).is_track


@pytest.mark.parametrize("section", ["OT", "A9"])
def test_a_reversed_accelerometer_and_few_or_noisy_impacts_are_no_velocity(section):
    for recordings in (
        hammer_test(section, (1.0, 1.0), 2, sign=-1.0),
        hammer_test(section, (1.0, 1.0), 2, noise=0.2),
        hammer_test(section, (1.0, 1.0), 1, n=2),
    ):
        impacts = find_impacts(recordings, "force", "rail")
        assert judge_response_order(impacts, "rail") == tuple(impacts)
