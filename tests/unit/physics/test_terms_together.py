"""Two effects on one sleeper: no spring becomes negative, they supply no energy, and each includes the other."""

import numpy as np
import pytest

from turnout.errors import SimulationError
from turnout.physics import (
    BallastHardening,
    BallastInertia,
    HangingSleeper,
    LiftingSleepers,
    LocalBallast,
    LocalPad,
    PadPreload,
    PadTemperature,
)
from turnout.simulate.frequency_response import receptance
from turnout.simulate.links import links_of, ports_of
from turnout.simulate.matrices import assemble
from turnout.simulate.preparation import prepare
from turnout.simulate.run import Drive, run
from turnout.simulate.track import uniform_track
from turnout.simulate.vehicle import lone_wheels

TWO = uniform_track(15.0, end_length=4.5, end_damping=400.0)
THREE = TWO.with_(
    layers=3, ballast_mass=300.0, ballast_stiffness=140e6, ballast_damping=60e3, subgrade_stiffness=78e6,
    subgrade_damping=31e3,
)  # fmt: skip
J = 12
HANGS = HangingSleeper(J, 3e-4)


def impact(t):
    """An impact of 5 kN and 1.2 ms."""
    return np.where(t < 1.2e-3, 5e3 * np.sin(np.pi * t / 1.2e-3) ** 2, 0.0)


def form(band, x):
    """x^T A x of a symmetric matrix in upper diagonals."""
    return sum(
        (1.0 if k == 0 else 2.0) * np.sum(row[: x.size - k] * x[: x.size - k] * x[k:]) for k, row in enumerate(band)
    )


def energy(prepared, duration):
    """Of rail, supports and the terms' laws after an impact at the middle [J]."""
    motion = run(prepared, duration, pulses=[(7.2, impact)]).motion
    inside = slice(prepared.arrays.pad, prepared.arrays.pad + prepared.arrays.n)
    u, v, m = motion.u[inside], motion.v[inside], prepared.matrices
    total = 0.5 * form(m.mass, v) + 0.5 * form(m.stiffness, u)
    for port in ports_of(prepared.terms, prepared.track):
        d = np.linspace(0.0, sum(weight * u[m.index[name]] for name, weight in port.ends), 2001)
        total += np.trapezoid(port.law.force(d), d)
    return total


@pytest.mark.parametrize(
    ("track", "terms"),
    [
        (TWO, (HANGS, LocalBallast(J, 0.3))),
        (TWO, (LocalBallast(J, 0.05), HANGS)),
        (TWO, (LiftingSleepers(10, 14, 1.0, 400.0), LocalBallast(J, 0.05))),
        (TWO, (BallastInertia(0.0, -3e4), LocalBallast(J, 0.05))),
        (TWO, (HANGS, BallastInertia(0.0, -3e4))),
        (TWO, (PadPreload(-3e3, 9e4), LocalPad(J, 0.05))),
        (TWO, (LocalPad(J, 0.05), PadTemperature(0.04, 40.0))),
        (THREE, (HANGS,)),
        (THREE, (HANGS, LocalBallast(J, 0.3))),
        (THREE, (LiftingSleepers(10, 14, 1.0, 400.0), BallastHardening(11, 13, 3.0))),
    ],
)
def test_after_an_impact_the_energy_falls_until_the_track_is_at_rest(track, terms):
    """Springs conserve energy and dampers dissipate it: long after an impact the track is at rest.

    A thousandth at 0.25 s: the slowest mode of these tracks decays with more than 1/e in 40 ms."""
    prepared = prepare(track, 1e-4, terms=terms)
    found = [energy(prepared, t) for t in (2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.25)]
    assert np.all(np.diff(found) < 0.0) and found[0] > 0.0
    assert abs(found[-1]) < 1e-3 * found[0]


@pytest.mark.parametrize("track", [TWO, THREE], ids=["2 layers", "3 layers"])
def test_a_closed_gap_reacts_by_its_ballast_stiffness_times_the_deflection_less_the_gap(track):
    """Superposition: the reaction k (d - g) of the closed gap is that of the linear track and a force k g held against
    it. Half the ballast there; the wheel of 90 kN closes 0.1 mm."""
    softer = track.ballast_stiffness.copy()
    softer[J] *= 0.5
    plain = prepare(track.with_(ballast_stiffness=softer), 1e-4)
    gap, ends = 1e-4, track.ballast_link(J).ends
    rows, weights = plain.matrices.rail_weights(7.2)
    expected = 90e3 * plain.static_response(rows, weights)
    own = np.array([plain.matrices.index[name] for name, _ in ends])
    signs = np.array([weight for _, weight in ends])
    expected += softer[J] * gap * plain.static_response(own, signs)
    assert signs @ expected[own] > 1.1 * gap  # it is closed
    prepared = prepare(track, 1e-4, terms=(HangingSleeper(J, gap), LocalBallast(J, 0.5)))
    wheel = lone_wheels(700.0, gravity=0.0, pressing=90e3)
    motion = run(prepared, 1e-3, [], wheel, Drive(7.2, 0.0, entry=0.0)).motion
    found = motion.u[prepared.arrays.pad :][: prepared.arrays.n]
    assert np.max(np.abs(found - expected)) < 1e-6 * np.max(expected)  # Newton: 1e-7 N of 90 kN; march: 1e-6


@pytest.mark.parametrize("track", [TWO, THREE], ids=["2 layers", "3 layers"])
def test_within_its_gap_a_sleeper_on_soft_ballast_is_free(track):
    """The gap withholds the stiffness and damping that the track has with the other term: r k and sqrt(r) c."""
    for terms in ((HANGS, LocalBallast(J, 0.25)), (LocalBallast(J, 0.25), HANGS)):
        (port,) = ports_of(terms, track)
        link = track.ballast_link(J)
        assert port.ends == link.ends
        for d, rate in ((1e-4, 0.02), (-1e-4, 0.05)):
            expected = -0.25 * link.stiffness * d - 0.5 * link.damping * rate
            assert float(port.law.force(d, rate)) == pytest.approx(expected, rel=1e-12)


def test_a_warm_and_worn_pad_has_both_factors_in_either_order():
    """k r (1 - a dT) under support 12; the damper goes with the root of r."""
    warm, worn = PadTemperature(0.02, 30.0), LocalPad(J, 0.25)
    stiffness, damping = 0.7 * TWO.pad_stiffness, TWO.pad_damping.copy()
    stiffness[J] *= 0.25
    damping[J] *= 0.5
    frequency = np.array([40.0, 200.0, 700.0])
    expected = receptance(assemble(TWO.with_(pad_stiffness=stiffness, pad_damping=damping)), frequency, 7.2, 7.5)
    for terms in ((warm, worn), (worn, warm)):
        assert np.allclose(receptance(assemble(TWO, terms), frequency, 7.2, 7.5), expected, atol=0.0, rtol=1e-9)


def test_a_single_term_adds_its_own_links_and_ports():
    for term in (LocalBallast(J, 0.3), PadTemperature(0.01)):
        assert links_of((term,), TWO) == list(term.links(TWO))
    assert ports_of((HANGS,), TWO) == list(HANGS.ports(TWO))


def test_two_effects_that_take_the_same_ballast_are_rejected():
    lifts = LiftingSleepers(J, J, 1.0)
    with pytest.raises(SimulationError, match="keep one of them"):
        ports_of((HANGS, HANGS), TWO)
    with pytest.raises(SimulationError, match=r"hanging_sleeper \(gap .* 12\) and lifting_sleepers .* withhold more"):
        ports_of((HANGS, lifts), TWO)
    assert len(ports_of((HangingSleeper(J, 3e-4, 0.5), LiftingSleepers(J, J, 0.5)), TWO)) == 2  # half and half
