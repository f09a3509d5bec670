"""A wheel flat: its signature on a car, its force against a closed form (reference check 11)."""

import numpy as np
import pytest
from scipy.signal import welch

from turnout.simulate.force_laws import LinearLaw, PowerLaw
from turnout.simulate.infinite_track import winkler_receptance
from turnout.simulate.preparation import prepare
from turnout.simulate.rail import Rail
from turnout.simulate.roughness import roughness
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.track import uniform_track
from turnout.simulate.vehicle import car, lone_wheels
from turnout.simulate.wheel_path import WheelFlat

EI, M, K = 210e9 * 3.055e-5, 60.21, 1e8
KMH_160 = 160.0 / 3.6


def test_a_wheel_flat_raises_the_level_above_300_hz_and_not_below_40_hz():
    """Check 11, as a signature: 50 mm, R 0.43 m, on 6 µm of roughness: +16 to +20 dB in 300-1000 Hz were found.

    14 dB are required on the sleepers, where one realisation of the roughness gave 17 to 23; below 40 Hz no change.
    """
    prepared = prepare(uniform_track(96.0), 1e-4)
    rough = roughness(0.0, 96.0, 3, offset=-11.7)
    assert rough.dip.std() == pytest.approx(6e-6, rel=0.02)
    power = []
    for flat in ((), (WheelFlat(0, 0.05, 0.43, 0.3),)):
        drive = Drive(30.0, KMH_160, surfaces=((rough, *flat),), entry=0.0)
        outcome = run(prepared, 0.9, [Probe(("sleeper", 90)), Probe(("sleeper", 100))], car(), drive)
        frequency, density = welch(outcome.signals, 1e4, nperseg=1000)
        power.append(density)
    swing = outcome.force.max(axis=1) - outcome.force.min(axis=1)
    assert swing[0] > 2.0 * swing[1:].max()  # one wheel
    for low, high, least, most in ((5, 40, -1.0, 1.0), (300, 600, 14.0, 26.0), (600, 1000, 14.0, 26.0)):
        band = (frequency >= low) & (frequency < high)
        change = 10.0 * np.log10(power[1][:, band].sum(axis=1) / power[0][:, band].sum(axis=1))
        assert np.all((change > least) & (change < most)), (low, high, change)


def test_the_force_of_a_flat_is_that_of_three_receptances():
    r"""A linear contact on Winkler's beam: F = -P / (1/k_H + H_rail - 1/(m w^2)), 40-1000 Hz, magnitude to 2 %.

    In the closed form the wheel does not move along the rail; here it moves at 5 % of the critical speed.
    """
    h, mass, load, damping, dt = 0.15, 600.0, 60e3, 1e5, 5e-5
    rail = Rail(EI, M, 2.4e8, beam="euler")
    track = uniform_track(72.0, h, rail, layers=1, pad_stiffness=K * h, pad_damping=damping * h, elements_per_bay=1)
    tangent, flat = PowerLaw(93e9).tangent(load), WheelFlat(0, 0.05, 0.43, phase=36.0)
    wheel = lone_wheels(mass, contact=LinearLaw(tangent, 0.0, load), gravity=0.0, pressing=load)
    drive = Drive(30.0, KMH_160, surfaces=((flat,),), entry=0.0, path_step=0.001)
    turn = 2.0 * np.pi * 0.43 / KMH_160  # from 34.65 m on, one hit at 36 m
    outcome = run(prepare(track, dt), 6.0 / KMH_160 + 0.5 * turn, [], wheel, drive)
    kept = outcome.time > 6.0 / KMH_160 - 0.5 * turn
    path = flat(30.0 + KMH_160 * outcome.time, 0)
    force, dip = (np.fft.rfft(signal[kept]) for signal in (outcome.force[0] - load, path))
    frequency = np.fft.rfftfreq(int(kept.sum()), dt)
    band = (frequency >= 40.0) & (frequency <= 1000.0)
    omega = 2.0 * np.pi * frequency[band]
    rail_h = winkler_receptance(frequency[band], EI, M, K, damping)
    closed = -dip[band] / (1.0 / tangent + rail_h - 1.0 / (mass * omega**2))
    assert np.max(np.abs(np.abs(force[band] / closed) - 1.0)) < 0.02
