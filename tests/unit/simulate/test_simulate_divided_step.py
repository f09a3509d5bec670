"""Steps in which Newton's iteration fails are divided; the result is that of the equations of motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from turnout.physics import LooseFastening
from turnout.simulate import divided_step
from turnout.simulate.march import NEWTON, march
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.track import uniform_track
from turnout.simulate.vehicle import lone_wheels
from turnout.simulate.wheel_path import Kink

DT, STEPS = 2e-4, 15
STIFF = uniform_track(6.0, elements_per_bay=2, pad_stiffness=8e8, pad_damping=1.2e5, ballast_stiffness=2.6e8)


def pulse(t):
    return np.where((t > 0.0) & (t < 1e-3), 8e4 * np.sin(np.pi * t / 1e-3) ** 2, 0.0)


def dense(upper):
    n = upper.shape[1]
    full = np.zeros((n, n))
    for k, row in enumerate(upper):
        full += np.diag(row[: n - k], k) + (np.diag(row[: n - k], -k) if k else 0.0)
    return full


def displacement_of_the_equations_of_motion(prepared, load, port, time):
    """(n_time,) at the loaded degree of freedom: the dense equations, integrated by another program to 1e-6."""
    matrices = prepared.matrices
    n, (row,) = matrices.n, [matrices.index[load]]
    m, c, k = (dense(a) for a in (matrices.mass, matrices.damping, matrices.stiffness))
    ends = np.zeros(n)
    for name, weight in port.ends:
        ends[matrices.index[name]] = weight
    inverse = np.linalg.inv(m)

    def derivative(t, state):
        u, v = state[:n], state[n:]
        force = -c @ v - k @ u - ends * port.law.force(ends @ u, ends @ v)
        force[row] += pulse(t)
        return np.concatenate([v, inverse @ force])

    motion = solve_ivp(
        derivative, (0.0, time[-1]), np.zeros(2 * n), "LSODA", time, rtol=1e-6, atol=1e-11, max_step=5e-5
    )
    return motion.y[row]


@pytest.mark.parametrize(("lost", "error"), [(0.5, 0.02), (0.9, 0.05)])
def test_a_damper_that_is_lost_within_a_micrometre_is_simulated_in_long_steps(lost, error, monkeypatch):
    """Newton's iteration alternates where the damper of a pad is lost; that step is divided.

    The error of steps of 0.2 ms is of the first order there: half of it with half the step.
    """
    steps, halved = [], divided_step._at_half_step
    monkeypatch.setattr(divided_step, "_at_half_step", lambda course, p: steps.append(p.dt) or halved(course, p))
    term = LooseFastening(5, 5, lost, 1.0)
    prepared = prepare(STIFF, DT, terms=(term,))
    load = ("rail", 5)
    outcome = run(prepared, DT * STEPS, [Probe(load, 0), Probe(load)], pulses=[(load, pulse)])
    assert steps  # otherwise the test would show nothing
    exact = displacement_of_the_equations_of_motion(prepared, load, *term.ports(STIFF), DT * np.arange(STEPS + 1))
    middle = 0.5 * (exact[1:] + exact[:-1])
    assert np.linalg.norm(outcome.signals[0] - middle) < error * np.linalg.norm(middle)
    velocity = outcome.motion.v[prepared.arrays.pad + prepared.matrices.index[load]]
    assert outcome.signals[1].sum() * DT == pytest.approx(velocity, rel=1e-9)  # means over whole steps


class Interrupted:
    """A march that reports a failure ``at`` a step of the run; lists the steps of all marches."""

    def __init__(self, at):
        self.steps, self.at = [], at

    def __call__(self, track, scheme, bodies, ports, run, motion, n_step, out, out_force):
        self.steps.append((scheme.dt, n_step))
        if len(self.steps) > 1:
            return march(track, scheme, bodies, ports, run, motion, n_step, out, out_force)
        status = march(track, scheme, bodies, ports, run, motion, self.at, out, out_force)
        assert status[0] == 0
        return NEWTON, self.at, 0, 1.0, status[4]


@pytest.mark.parametrize("forces", [True, False])
def test_a_divided_step_changes_no_other_step(forces):
    """Two wheels over a kink and a hammer's pulse: after a divided step all continues at its time and position."""
    prepared = prepare(uniform_track(15.0), 5e-5)
    wheels = lone_wheels(700.0, (0.0, 2.5), gravity=0.0, pressing=55e3)
    drive = Drive(7.2, 40.0, surfaces=((Kink(7.5, 1e-3, 0.4, 0.6),),), entry=0.0)
    given = [(5.0, lambda t: pulse(t - 4e-3))]
    marcher = Interrupted(100)
    probes = [Probe(7.5), Probe(7.83), Probe(("sleeper", 12), 0)]
    whole = run(prepared, 0.01, probes, wheels, drive, given, forces)
    divided = run(prepared, 0.01, probes, wheels, drive, given, forces, marcher=marcher)
    assert marcher.steps == [(5e-5, 200), (2.5e-5, 2), (5e-5, 99)]
    for a, b in ((divided.signals, whole.signals), (divided.force, whole.force)):
        assert a.shape == b.shape and np.all(a[:, :100] == b[:, :100])
        if a.size:
            scale = np.max(np.abs(b), axis=1, keepdims=True)
            assert np.max(np.abs(a - b)[:, 101:] / scale) < 2e-3


def test_a_divided_first_step_has_the_given_force_of_its_own_times():
    """A force that falls to 1/e within the first step gives that step and its halves the same impulse."""
    prepared = prepare(uniform_track(6.0), 5e-5)
    given = [(3.0, lambda t: 8e4 * np.exp(-t / 5e-5))]
    whole, divided = (
        run(prepared, 0.002, [Probe(3.0, 0)], pulses=given, marcher=marcher) for marcher in (march, Interrupted(0))
    )
    assert divided.signals[0, 10:] == pytest.approx(whole.signals[0, 10:], rel=0.01)
