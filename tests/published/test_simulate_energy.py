"""Conservation of energy and momentum: rolling resistance, impacts of Hertz, loads beyond the critical speed."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from turnout.simulate import Hammer, Sensor, simulate_hammer, uniform_track
from turnout.simulate.force_laws import PowerLaw
from turnout.simulate.preparation import prepare
from turnout.simulate.rail import Rail
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.vehicle import lone_wheels


def test_the_rolling_resistance_of_a_wheel_is_the_loss_of_the_track():
    """Force times mean slope times speed over one bay is what pad, ballast and rail of one bay dissipate in a passage.

    Of 60 kN at 30 m/s 0.31 J, a drag of half a newton. Both agree to 1e-5.
    """
    rail, speed = Rail(6.42e6, 60.21, 2.5e8, damping=20.0, beam="euler"), 30.0
    track = uniform_track(108.0, start=-54.0, elements_per_bay=8, rail=rail)
    support = track.nearest_support(0.0)
    bay, near = np.arange(0.0, 0.6, 0.0375), np.linspace(-0.15, 0.75, 97)
    rates = [Probe(x, 1) for x in (*bay, ("sleeper", support))]
    wheel = lone_wheels(600.0, gravity=0.0, pressing=60e3)
    drive = Drive(-18.0, speed, entry=0.0)
    outcome = run(prepare(track, 5e-5), 1.2, [*rates, *(Probe(x, 0) for x in near)], wheel, drive)
    rail_rate, sleeper_rate = outcome.signals[: bay.size], outcome.signals[bay.size]
    power = track.pad_damping[support] * (rail_rate[0] - sleeper_rate) ** 2
    power += track.ballast_damping[support] * sleeper_rate**2 + 20.0 * 0.6 * np.mean(rail_rate**2, axis=0)
    loss = np.trapezoid(power, outcome.time)
    position = -18.0 + speed * outcome.time
    inside = np.flatnonzero((position >= 0.0) & (position < 0.6))
    slopes = [CubicSpline(near, outcome.signals[bay.size + 1 :, k])(position[k], 1) for k in inside]
    work = -np.sum(outcome.force[0, inside] * slopes) * speed * 5e-5
    assert work == pytest.approx(loss, rel=1e-4) and 0.2 < loss < 0.5


def test_a_mass_bounces_off_a_rigid_rail_as_hertz_calculated():
    r"""Hertz 1882: :math:`d = (5 m v^2 / 4 k)^{2/5}`, force :math:`k d^{3/2}`, contact 2.943 d / v, momentum 2 m v."""
    rigid = uniform_track(9.0, rail=Rail(1e14, 1e6, 1e14, beam="euler"), layers=1, pad_stiffness=1e14, pad_damping=0.0)
    mass, velocity, stiffness, rate = 5.5, 1.2, 1.2e9, 80e3
    exact = {"velocity_spread": 0.0, "position_spread": 0.0, "force": Sensor("hammer", 0.0, "", "force", cutoff=None)}
    hammer = Hammer(mass, velocity, tip=PowerLaw(stiffness, 1.5), **exact)
    (recording,) = simulate_hammer(rigid, 4.5, hammer, [Sensor("a", 4.5)], 1, rate=rate, duration=0.06)
    force, depth = recording.signal("hammer"), (5.0 * mass * velocity**2 / (4.0 * stiffness)) ** 0.4
    assert force.max() == pytest.approx(stiffness * depth**1.5, rel=1e-3)
    assert np.sum(force) / rate == pytest.approx(2.0 * mass * velocity, rel=1e-5)
    assert np.count_nonzero(force) / rate == pytest.approx(2.9432 * depth / velocity, abs=1.5 / rate)


def deflection(distance, speed, bending, mass, damping, stiffness):
    """Of a beam on a damped foundation ``distance`` [m] ahead of 1 N, by residues; any speed."""
    roots = np.roots([bending, 0.0, mass * speed**2, -damping * speed, stiffness])
    residues = 1.0 / (4.0 * bending * roots**3 + 2.0 * mass * speed**2 * roots - damping * speed)
    ahead, behind = roots.real < 0.0, roots.real > 0.0
    waves = np.exp(np.where(np.outer(distance >= 0.0, ahead) | np.outer(distance < 0.0, behind), 0.0, -np.inf))
    waves = waves * np.exp(np.minimum(np.outer(distance, roots).real, 0.0) + 1j * np.outer(distance, roots).imag)
    return (waves @ np.where(ahead, residues, -residues)).real


@pytest.mark.parametrize(("share", "tolerance"), [(0.95, 2e-3), (1.0, 3e-3), (1.2, 3e-3)])
def test_a_load_at_and_beyond_the_critical_speed(share, tolerance):
    """The damping is 10 % of the critical one: without any, the deflection at the critical speed has no limit."""
    bending, mass, stiffness, bay = 6.42e6, 60.21, 1e8, 0.15
    damping, critical = 0.2 * np.sqrt(stiffness * mass), (4.0 * stiffness * bending / mass**2) ** 0.25
    rail = Rail(bending, mass, 2.4e8, beam="euler")
    pads = {"pad_stiffness": stiffness * bay, "pad_damping": damping * bay}
    track = uniform_track(180.0, bay, rail, start=-120.0, layers=1, elements_per_bay=1, **pads)
    speed = share * critical
    load = lone_wheels(100.0, gravity=0.0, pressing=60e3, contact=PowerLaw(1e4, 1.0))  # so soft that it is constant
    outcome = run(prepare(track, 2e-5), 45.0 / speed, [Probe(0.0, 0)], load, Drive(-40.0, speed, entry=0.0))
    distance = 40.0 - speed * outcome.time
    near = np.abs(distance) < 5.0
    exact = 60e3 * deflection(distance[near], speed, bending, mass, damping, stiffness)
    assert np.linalg.norm(outcome.signals[0, near] - exact) < tolerance * np.linalg.norm(exact)
