"""The time integration against frequency domain, dense solution, other schemes, longer tracks and plain numpy."""

import numpy as np
import pytest
from tests.oracles.march_numpy import march_numpy

from turnout.physics import HangingSleeper, LiftingSleepers, PhysicsTerm
from turnout.simulate.force_laws import GapLaw, LinearLaw, Port
from turnout.simulate.frequency_response import responses
from turnout.simulate.links import Link
from turnout.simulate.matrices import assemble
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.track import uniform_track
from turnout.simulate.vehicle import car, lone_wheels
from turnout.simulate.wheel_path import Kink, Sections, WheelFlat

SPEED = 160.0 / 3.6


def pulse(t):
    return np.where((t > 0.0) & (t < 1.2e-3), 1e4 * np.sin(np.pi * t / 1.2e-3) ** 2, 0.0)


def test_a_simulated_impact_has_the_receptance_of_the_frequency_domain():
    """Check 15 at dt 5e-5: complex, 0.1 % in 20-500 Hz and 0.3 % in 500-1000 Hz."""
    prepared = prepare(uniform_track(48.0), 5e-5)
    outcome = run(prepared, 0.8, [Probe(24.0), Probe(24.3)], pulses=[(24.0, pulse)])
    stages = (np.arange(outcome.time.size)[:, None] + prepared.scheme.node) * prepared.dt
    force = np.fft.rfft(pulse(stages) @ prepared.scheme.quadrature)
    frequency = np.fft.rfftfreq(outcome.time.size, prepared.dt)
    band = (frequency >= 20.0) & (frequency <= 1000.0)
    low = frequency[band] <= 500.0
    for place, signal in zip((24.0, 24.3), outcome.signals):
        found = np.fft.rfft(signal)[band] / force[band] / -((2.0 * np.pi * frequency[band]) ** 2)
        rows, weights = prepared.matrices.rail_weights(place)
        exact = responses(prepared.matrices, frequency[band], [24.0], rows)[:, 0] @ weights
        error = np.abs(found / exact - 1.0)
        assert error[low].max() < 1e-3
        assert error.max() < 3e-3


def test_receptance_is_reciprocal():
    """Betti: the simulated response stays the same if the positions of impact and sensor are exchanged."""
    track = uniform_track(30.0)
    stiff = track.pad_stiffness.copy()
    stiff[20:30] *= 1.7
    prepared = prepare(track.with_(pad_stiffness=stiff), 1e-4)
    there = run(prepared, 0.03, [Probe(17.1)], pulses=[(12.05, pulse)]).signals[0]
    back = run(prepared, 0.03, [Probe(12.05)], pulses=[(17.1, pulse)]).signals[0]
    assert np.max(np.abs(there - back)) < 1e-9 * np.max(np.abs(there))


@pytest.mark.parametrize(("scheme", "order"), [("midpoint", 2), ("radau", 3), ("gauss", 4)])
def test_the_error_of_the_schemes_falls_with_their_order(scheme, order):
    """Displacement at a fixed time under a smooth pulse, against a step eight times finer."""
    track = uniform_track(12.0, elements_per_bay=2)

    def end(dt):
        prepared = prepare(track, dt, scheme)
        smooth = lambda t: 1e4 * np.exp(-(((t - 5e-3) / 1.5e-3) ** 2))  # noqa: E731
        motion = run(prepared, 0.012, pulses=[(6.0, smooth)]).motion
        rows, weights = prepared.matrices.rail_weights(6.0)
        return motion.u[prepared.arrays.pad + rows] @ weights

    exact = end(1.25e-5 if order < 4 else 2.5e-5)
    errors = [abs(end(dt) - exact) for dt in (2e-4, 1e-4)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.35)


def dense(upper, n):
    full = np.zeros((n, n))
    for k, row in enumerate(upper):
        full += np.diag(row[: n - k], k) + (np.diag(row[: n - k], -k) if k else 0.0)
    return full


class Gaps(PhysicsTerm):
    """Three sleepers on unilateral ballast with gaps; the linear ballast under them is taken away."""

    effect_type = "port"
    places, gaps = (8, 9, 10), (0.0, 1.5e-4, 5e-5)

    def links(self, track):
        return [
            Link(((("sleeper", j), 1.0),), -track.ballast_stiffness[j], -track.ballast_damping[j]) for j in self.places
        ]

    def ports(self, track):
        laws = [GapLaw(track.ballast_stiffness[j], track.ballast_damping[j]) for j in self.places]
        return [Port(((("sleeper", j), 1.0),), law, gap) for j, law, gap in zip(self.places, laws, self.gaps)]


def test_gap_ports_solve_the_full_two_stage_system():
    """Check 16: both stages of all degrees of freedom at once, dense Newton, no condensation: 1e-8."""
    track, dt, steps = uniform_track(10.8, elements_per_bay=2), 1e-4, 150
    prepared = prepare(track, dt, "radau", (Gaps(),))

    def force(t):
        return 4e4 * (1.0 - np.cos(2.0 * np.pi * t / 6e-3))

    outcome = run(prepared, steps * dt, [Probe(5.4)], pulses=[(5.4, force)])
    matrices = prepared.matrices
    n = matrices.n
    m, c, k = (dense(a, n) for a in (matrices.mass, matrices.damping, matrices.stiffness))
    rows = [matrices.index["sleeper", j] for j in Gaps.places]
    rail, weights = matrices.rail_weights(5.4)
    a = np.array([[5 / 12, -1 / 12], [3 / 4, 1 / 4]])
    inverse, node = np.linalg.inv(a), np.array([1 / 3, 1.0])
    law, gap = GapLaw(track.ballast_stiffness[8], track.ballast_damping[8]), np.array(Gaps.gaps)
    u, v, found, contact = np.zeros(n), np.zeros(n), [], []
    for step in range(steps):
        z = np.zeros(2 * n)
        for _ in range(40):
            stage_u = u + z.reshape(2, n)
            stage_v = inverse @ z.reshape(2, n) / dt
            stage_a = inverse @ (stage_v - v) / dt
            residual = np.empty((2, n))
            jacobian = np.kron(inverse @ inverse / dt**2, m) + np.kron(inverse / dt, c) + np.kron(np.eye(2), k)
            reaction = np.empty((2, 3))
            for s in range(2):
                load = np.zeros(n)
                load[rail] = weights * force((step + node[s]) * dt)
                residual[s] = m @ stage_a[s] + c @ stage_v[s] + k @ stage_u[s] - load
                for g, r in enumerate(rows):
                    d, rate, eps = stage_u[s, r] - gap[g], stage_v[s, r], 1e-11
                    reaction[s, g] = law.force(d, rate)
                    residual[s, r] += reaction[s, g]
                    by_d = (law.force(d + eps, rate) - law.force(d - eps, rate)) / (2 * eps)
                    by_v = (law.force(d, rate + 1e-6) - law.force(d, rate - 1e-6)) / 2e-6
                    jacobian[s * n + r, s * n + r] += by_d
                    for q in range(2):
                        jacobian[s * n + r, q * n + r] += by_v * inverse[s, q] / dt
            if np.max(np.abs(residual)) < 1e-6:
                break
            z -= np.linalg.solve(jacobian, residual.ravel())
        new_v = stage_v[1]
        found.append((new_v - v)[rail] @ weights / dt)
        contact.append(reaction.T @ np.array([0.75, 0.25]))
        u, v = stage_u[1], new_v
    assert np.max(np.abs(outcome.signals[0] - found)) < 1e-8 * np.max(np.abs(found))
    contact = np.array(contact).T
    assert np.max(np.abs(outcome.port_force - contact)) < 1e-8 * contact.max()
    assert np.all(contact.min(axis=1) == 0.0) and np.all(contact.max(axis=1) > 1e3)  # all opened and closed


class Unilateral(PhysicsTerm):
    """Sleepers 15 to 25 on ballast that only presses, written out: no linear ballast, max(0, W + k y), -W."""

    kind, places, dead_load = "port", range(15, 26), 1.83e3

    def links(self, track):
        return [Link(((("sleeper", j), 1.0),), -track.ballast_stiffness[j]) for j in self.places]

    def ports(self, track):
        found = []
        for j in self.places:
            end, k = ((("sleeper", j), 1.0),), track.ballast_stiffness[j]
            found += [Port(end, GapLaw(k), -self.dead_load / k), Port(end, LinearLaw(0.0, 0.0, -self.dead_load))]
        return found


def test_sleepers_that_lift_are_those_on_ballast_that_only_presses():
    """The term on the linear track against the unilateral track: an impact that throws the sleepers up, 1e-8."""
    track = uniform_track(24.0, ballast_damping=0.0)
    outcomes = []
    for terms in ((Unilateral(),), (LiftingSleepers(15, 25, 1.0),), ()):
        prepared = prepare(track, 1e-4, terms=terms)
        probes = [Probe(12.1), Probe(("sleeper", 20), 0)]
        outcomes.append(run(prepared, 0.03, probes, pulses=[(12.0, lambda t: -8.0 * pulse(t))]))
    written_out, term, linear = (o.signals for o in outcomes)
    scale = np.max(np.abs(written_out), axis=1, keepdims=True)
    assert written_out[1].min() < -1.83e3 / 90e6  # the sleepers lift off
    assert np.max(np.abs(term - written_out) / scale) < 1e-8
    assert np.max(np.abs(linear - written_out) / scale) > 0.02


@pytest.mark.parametrize("scheme", ["radau", "midpoint"])
def test_plain_numpy_gives_the_same_simulation(scheme):
    """Two wheels on two surfaces, a flat, a kink, sleepers that hang or lift, absorbing ends: equal to rounding."""
    terms = (HangingSleeper(12, 2e-4), HangingSleeper(13, 1e-4), LiftingSleepers(9, 10, 1.0, 100.0))
    prepared = prepare(uniform_track(15.0, end_length=3.0, end_damping=300.0), 1e-4, scheme, terms)
    surfaces = (
        (Kink(7.6, 1e-3, 0.4, 0.6),),
        (Sections((6.0, 7.0, 7.7, 8.0), (3e-4, 1e-4, 0.0, 0.0)), WheelFlat(1, 0.05, 0.43)),
    )
    drive = Drive(7.2, 40.0, surfaces=surfaces, entry=2.0, margin=1.0)
    probes = [Probe(7.5), Probe(7.8, 1), Probe(("sleeper", 12), 0)]
    wheels = lone_wheels(700.0, (0.0, 2.5), gravity=0.0, pressing=55e3)
    one = run(prepared, 0.015, probes, wheels, drive)
    other = run(prepared, 0.015, probes, wheels, drive, marcher=march_numpy)
    for a, b in (
        (one.signals, other.signals),
        (one.surface_force, other.surface_force),
        (one.port_force, other.port_force),
    ):
        scale = np.max(np.abs(b), axis=-1, keepdims=True) + 1e-300
        assert np.max(np.abs(a - b) / scale) < 1e-9
    assert one.surface_force[:, 0].max() > 1e3 and one.surface_force[:, 1].max() > 1e3


def test_a_longer_track_gives_the_same_results():
    """Check 13: 96 m against 288 m, force within 1e-5 and acceleration within 1e-4."""
    outcomes = []
    for length in (96.0, 288.0):
        prepared = prepare(uniform_track(length, start=-0.5 * length), 1e-4)
        drive = Drive(-8.0, SPEED, surfaces=((Kink(1.0, 1e-3, 0.5, 0.6),),), entry=0.0)
        outcomes.append(run(prepared, 0.5, [Probe(0.1)], car(), drive))
    a, b = outcomes
    swing = b.force - b.force.mean(axis=1, keepdims=True)
    assert np.linalg.norm(a.force - b.force) < 1e-5 * np.linalg.norm(swing)
    assert np.linalg.norm(a.signals - b.signals) < 1e-4 * np.linalg.norm(b.signals)


def test_the_start_of_wheels_on_their_stand_in_does_not_affect_the_recording():
    """A car that enters 96 m of track has the same recording as one that is always on a track of 288 m: 3e-4."""
    surfaces = ((Kink(1.0, 1e-3, 0.5, 0.6),),)
    short = prepare(uniform_track(96.0, start=-48.0, end_length=9.0, end_damping=400.0), 1e-4)
    long = prepare(uniform_track(288.0, start=-144.0), 1e-4)
    entering = run(short, 1.6, [Probe(0.1)], car(), Drive(-45.0, SPEED, surfaces=surfaces), forces=False)
    riding = run(long, 1.6, [Probe(0.1)], car(), Drive(-45.0, SPEED, surfaces=surfaces, entry=0.0), forces=False)
    error = np.linalg.norm(entering.signals - riding.signals) / np.linalg.norm(riding.signals)
    assert error < 3e-4


def test_energy_never_grows_without_a_load():
    """After a pulse the mechanical energy of track only falls, with the L-stable and the conserving scheme."""
    for scheme in ("radau", "midpoint", "gauss"):
        prepared = prepare(uniform_track(12.0, elements_per_bay=2), 1e-4, scheme)
        n = prepared.matrices.n
        m, k = dense(prepared.matrices.mass, n), dense(prepared.matrices.stiffness, n)
        energies = []
        for steps in range(20, 60, 4):
            motion = run(prepared, steps * 1e-4, pulses=[(6.0, pulse)]).motion
            u, v = (w[prepared.arrays.pad : prepared.arrays.pad + n] for w in (motion.u, motion.v))
            energies.append(0.5 * (v @ m @ v + u @ k @ u))
        assert np.all(np.diff(energies) < 0.0), scheme


def test_a_track_in_equilibrium_stays_there():
    """A train at rest on a smooth track with hanging sleepers stays at rest: 1e-6 of gravity."""
    prepared = prepare(uniform_track(48.0), 1e-4, terms=(HangingSleeper(40, 3e-4),))
    outcome = run(prepared, 0.05, [Probe(24.1)], car(), Drive(35.0, 0.0, entry=0.0))
    assert np.max(np.abs(outcome.signals)) < 1e-5
    assert np.allclose(outcome.force, outcome.force[:, :1], atol=0.0, rtol=1e-9)
    assert outcome.force[:, 0].sum() == pytest.approx(car().static_loads.sum(), rel=1e-9)


def test_matrices_with_and_without_pivoting_agree():
    matrices = assemble(uniform_track(18.0))
    frequency = np.array([5.0, 96.0, 486.0, 1070.0])
    direct = responses(matrices, frequency, [9.0, ("sleeper", 14)])
    pivoted = responses(matrices, frequency, [9.0, ("sleeper", 14)], pivoted=True)
    assert np.max(np.abs(direct - pivoted)) < 1e-9 * np.max(np.abs(pivoted))
