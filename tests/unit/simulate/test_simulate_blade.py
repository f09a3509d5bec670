"""A blade beside its stock rail: closed forms of two beams on common bearers, energy, limits, and wheels."""

from itertools import pairwise

import numpy as np
import pytest
from tests.oracles.march_numpy import march_numpy

from turnout.errors import SimulationError
from turnout.physics import LocalPad
from turnout.simulate.blade import GRAVITY, Blade, transfer_position
from turnout.simulate.frequency_response import receptance
from turnout.simulate.preparation import prepare
from turnout.simulate.rail import Rail, shape_functions
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.track import uniform_track
from turnout.simulate.vehicle import lone_wheels
from turnout.simulate.wheel_path import BladeTop, StockFall

EULER = Rail(6.42e6, 60.21, 2.5e8, 0.0, beam="euler")
TRACK = uniform_track(30.0)
BLADE = Blade(9.0, 15.0, 24.0, TRACK.rail, 3e8, 3e4)
SWITCH = TRACK.with_(blade=BLADE)
SURFACES = ((StockFall(10.5, 3.0, 0.02),), (BladeTop(9.0, 3.0, 0.015),))


def pulse(t):
    return np.where((t > 0.0) & (t < 1.2e-3), 300.0 * np.sin(np.pi * t / 1.2e-3) ** 2, 0.0)


def winkler(stiffness, spacing, rail=EULER):
    """Deflection per newton under a point load on an endless beam: 1 / (8 EI b³)."""
    b = (stiffness / spacing / (4.0 * rail.bending_stiffness)) ** 0.25
    return 1.0 / (8.0 * rail.bending_stiffness * b**3)


def test_two_rails_share_a_load_as_in_the_symmetric_and_antisymmetric_closed_forms():
    """Symmetric loads: each rail is on its pad and half of the ballast. Antisymmetric loads: on its pad alone."""
    spacing, pad, ballast = 0.1, 5e7, 2e7
    track = uniform_track(40.0, spacing, EULER, pad_stiffness=pad, ballast_stiffness=ballast, elements_per_bay=1)
    switch = track.with_(blade=Blade(2.0, 2.1, 38.0, EULER, pad, 3e4))
    matrices = prepare(switch, 1e-4).matrices
    j = track.nearest_support(20.0)
    on_blade = prepare(switch, 1e-4).static_response(*matrices.weights(("blade", j, 0)))
    together = winkler(1.0 / (1.0 / pad + 2.0 / ballast), spacing)
    against = winkler(pad, spacing)
    assert on_blade[matrices.index[("blade", j, 0)]] == pytest.approx(0.5 * (together + against), rel=2e-3)
    assert on_blade[matrices.index[("rail", j)]] == pytest.approx(0.5 * (together - against), rel=2e-3)


@pytest.mark.parametrize(("toe", "heel", "end"), [(9.0, 15.0, 24.0), (21.0, 15.0, 6.0), (9.3, 15.0, 24.2)])
def test_chairs_are_the_supports_from_toe_to_end_and_slide_chairs_those_before_the_heel(toe, heel, end):
    blade, x = Blade(toe, heel, end, TRACK.rail, 3e8, 3e4), TRACK.support
    last = TRACK.nearest_support(end)
    low, high = min(toe, x[last]) - 1e-6, max(toe, x[last]) + 1e-6
    under = [j for j in range(x.size) if low < x[j] < high and j != last][:: 1 if toe < end else -1]
    assert blade.chairs(TRACK) == under
    slides = [j for j in under if (x[j] < heel - 1e-6 if toe < end else x[j] > heel + 1e-6)]
    assert blade.slide_chairs(TRACK) == slides and slides != under


@pytest.mark.parametrize("mirrored", [False, True])
def test_wheels_change_rails_where_two_straight_tops_cross(mirrored):
    """5 mm a metre down from 10 m on the stock rail, 2.5 mm a metre up from 15 mm at 9 m: level at 11 2/3 m."""
    toe, length, fall = (9.0, 6.0, 4.0) if not mirrored else (21.0, -6.0, -4.0)
    blade = Blade(toe, toe + length, toe + 2.0 * length, TRACK.rail, 3e8, 3e4)
    surfaces = (
        (StockFall(20.0 if mirrored else 10.0, fall, 0.02, power=1.0),),
        (BladeTop(toe, length, 0.015, power=1.0),),
    )
    level_at = 30.0 - 35.0 / 3.0 if mirrored else 35.0 / 3.0
    assert transfer_position(surfaces, blade) == pytest.approx(level_at, abs=6.0 / 2000)  # a step of its grid


def test_wheels_change_rails_only_between_a_surface_of_each():
    stock, top = SURFACES
    for surfaces in ((), (stock,), (stock, stock), (top,), (top, top)):
        assert transfer_position(surfaces, BLADE) is None


def test_a_blade_of_negligible_section_leaves_the_plain_track():
    ghost = TRACK.with_(blade=Blade(9.0, 24.0, 24.0, Rail(1.0, 1e-6, 1e3, 1e-9), 1e-2, 0.0))
    frequency = np.linspace(20.0, 1000.0, 50)
    plain, changed = (receptance(prepare(t, 1e-4).matrices, frequency, 12.0, 13.5) for t in (TRACK, ghost))
    assert np.max(np.abs(changed / plain - 1.0)) < 1e-6
    drive = Drive(6.0, 40.0)
    a, b = (run(prepare(t, 1e-4), 0.2, [Probe(12.0)], lone_wheels(600.0), drive) for t in (TRACK, ghost))
    assert np.max(np.abs(a.force - b.force)) < 1e-3
    assert np.max(np.abs(a.signals - b.signals)) < 1e-5 * np.max(np.abs(a.signals))


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_planed_blade_has_the_mass_of_its_section_and_ends_at_the_closure_rail(mirrored):
    """Mass of the blade as the integral of its section; no term of the sum is that of an average section."""
    rail, length, share = Rail(5e6, 66.0, 2e8, 0.2, 3000.0), 2.5, 0.4
    toe, heel, end = (23.3, 15.7, 6.0) if mirrored else (6.7, 14.3, 24.0)
    track = TRACK.with_(blade=Blade(toe, heel, end, rail, 3e8, 3e4, length, share), elements_per_bay=3)
    matrices = prepare(track, 1e-4).matrices
    node = matrices.node[matrices.blade_start :][: len(matrices.blade_rows)]
    mass = sum(r.mass * h for r, h in zip(matrices.blade_rails, np.diff(node)))
    exact = 66.0 * length * (0.5 * share - 0.5) + 66.0 * abs(heel - toe) + TRACK.rail.mass * abs(end - heel)
    assert mass == pytest.approx(exact, rel=1e-6)
    beyond = matrices.blade_rails[0 if mirrored else -1]
    assert beyond == TRACK.rail
    middle = matrices.blade_rails[np.searchsorted(node, 0.5 * (toe + heel)) - 1]
    assert middle == rail
    ratio, flexibility = matrices.line_elements[2][1], matrices.line_elements[3][1]
    inside = slice(matrices.blade_start, matrices.blade_start + node.size - 1)
    assert flexibility[inside] == pytest.approx([1.0 / r.bending_stiffness for r in matrices.blade_rails], abs=0.0)
    assert ratio[inside] == pytest.approx([r.shear_ratio(h) for r, h in zip(matrices.blade_rails, np.diff(node))])


def test_a_tapered_cantilever_bends_as_its_closed_form():
    r"""The overhanging toe, :math:`w = \frac{F}{EI} \int_0^L \frac{x^2 dx}{q + (1-q)x/L} + F \int \frac{dx}{GA(x)}`."""
    rail, q, length, force, per_bay = Rail(6e6, 60.0, 2.4e8, 0.0), 0.3, 0.6, 1.0, 12
    track = TRACK.with_(blade=Blade(9.05, 20.0, 24.0, rail, 0.0, 0.0, length, q), elements_per_bay=per_bay)
    elements = np.linspace(0.0, length, per_bay + 1)
    w = 0.0  # of the tip beside the clamped end, summed over the elements
    for a, b in pairwise(elements.tolist()):
        section, square = track.blade.element_rail(track, 9.05 + a, 9.05 + b), (a * a + a * b + b * b) / 3.0
        w += force * (b - a) * (square / section.bending_stiffness + 1.0 / section.shear_stiffness)
    c = (1.0 - q) / length
    exact = force / rail.bending_stiffness * (length**2 / (2 * c) - q * length / c**2 + q**2 / c**3 * np.log(1.0 / q))
    exact += force / rail.shear_stiffness * np.log(1.0 / q) / c
    assert w == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("mirrored", [False, True])
def test_rail_and_blade_are_reciprocal(mirrored):
    """Betti, marched, with chairs that stay closed; a blade may point either way."""
    blade = Blade(24.0, 18.0, 9.0, TRACK.rail, 3e8, 3e4) if mirrored else BLADE
    prepared = prepare(TRACK.with_(blade=blade), 1e-4)
    there = run(prepared, 0.03, [Probe(10.5)], pulses=[(("blade", 23, 0), pulse)]).signals[0]
    back = run(prepared, 0.03, [Probe(("blade", 23, 0))], pulses=[(10.5, pulse)]).signals[0]
    assert np.max(np.abs(there)) > 1e-3
    assert np.max(np.abs(there - back)) < 1e-9 * np.max(np.abs(there))


def test_the_work_of_an_impact_on_the_blade_is_the_energy_of_both_rails():
    rail = Rail(6.42e6, 60.21, 2.485e8, 0.24)
    still = {"pad_damping": 0.0, "ballast_damping": 0.0}
    track = uniform_track(30.0, rail=rail, **still, blade=Blade(9.0, 9.1, 24.0, rail, 3e8, 0.0))
    prepared = prepare(track, 2e-5, "gauss")
    point = ("blade", 20, 0)
    outcome = run(prepared, 0.012, [Probe(point, 1)], pulses=[(point, pulse)])
    work = float(np.sum(pulse(outcome.time) * outcome.signals[0]) * prepared.dt)
    m, pad = prepared.matrices, prepared.arrays.pad
    u, v = (x[pad : pad + m.n] for x in (outcome.motion.u, outcome.motion.v))
    energy = 0.0
    for upper, x in ((m.mass, v), (m.stiffness, u)):
        for k, row in enumerate(upper):
            energy += (0.5 if k == 0 else 1.0) * float(np.sum(row[: m.n - k] * x[: m.n - k] * x[k:]))
    assert energy == pytest.approx(work, rel=2e-3)


def test_a_wheel_moves_its_load_from_the_stock_rail_to_the_blade():
    """At walking pace both rails together carry the wheel; the stock rail before the change, the blade after it."""
    prepared = prepare(TRACK.with_(blade=Blade(9.0, 9.1, 24.0, TRACK.rail, 3e8, 3e4)), 2e-4)
    drive = Drive(9.9, 3.0, surfaces=SURFACES)
    outcome = run(prepared, 1.2, vehicle=lone_wheels(6000.0), drive=drive)
    weight = 6000.0 * GRAVITY
    x, stock, blade = 9.9 + 3.0 * outcome.time, *outcome.surface_force[0]
    before, after = x < 10.6, x > 12.2
    assert np.all(blade[before] == 0.0) and np.all(stock[after] == 0.0)
    assert np.mean(stock[before]) == pytest.approx(weight, rel=0.02)
    assert np.mean(blade[after]) == pytest.approx(weight, rel=0.02)
    both = np.flatnonzero((stock > 0.0) & (blade > 0.0))
    first, last = both[0], both[-1]
    level = [np.sum([part(x, 0) for part in surface], axis=0) for surface in SURFACES]
    assert level[1][first] - level[0][first] == pytest.approx(reach_of_a_loaded_wheel(prepared, x[first], 0), rel=0.05)
    assert level[0][last] - level[1][last] == pytest.approx(reach_of_a_loaded_wheel(prepared, x[last], 1), rel=0.05)


def reach_of_a_loaded_wheel(prepared, x, line):
    """How far the other rail may lie below the one that carries the wheel and be touched: approach and deflection."""
    m, weight = prepared.matrices, 6000.0 * GRAVITY
    first, last, p, _, _ = (v[:, m.element_at(x)] for v in m.line_elements)
    h, s = m.node[m.element_at(x) + 1] - m.node[m.element_at(x)], (x - m.node[m.element_at(x)])
    shape = shape_functions(s / h, h, p[0])
    rows = [np.array([first[k], first[k] + 1, last[k], last[k] + 1]) for k in (0, 1)]
    deflection = prepared.static_response(rows[line], shape * weight)
    own, other = (float(shape @ deflection[rows[k]]) for k in (line, 1 - line))
    return own - other + m.compliance(x) * weight + (weight / lone_wheels(1.0).contact.stiffness) ** (2.0 / 3.0)


def test_the_compiled_simulation_and_plain_numpy_agree_over_the_change():
    """Whole columns of the inverse and one dense Newton system, with slide chairs that open."""
    prepared = prepare(SWITCH, 1e-4, terms=(LocalPad(19, 0.5),))
    drive = Drive(10.6, 30.0, surfaces=SURFACES)
    probes = [Probe(12.05), Probe(("blade", 19, 0))]
    outcomes = [
        run(prepared, 0.04, probes, lone_wheels(6000.0), drive, **kind) for kind in ({}, {"marcher": march_numpy})
    ]
    force, other = (o.surface_force for o in outcomes)
    assert np.all(force.max(axis=2) > 3e4)
    assert np.max(np.abs(force - other)) < 1e-9 * np.max(force)
    signals, others = (o.signals for o in outcomes)
    assert np.max(np.abs(signals - others)) < 1e-9 * np.max(np.abs(signals))


def test_slide_chairs_press_but_do_not_pull():
    """With the blade's own weight the force of a slide chair is never a pull; that of a fastened chair is."""
    prepared = prepare(SWITCH, 2.5e-5)
    j, k = 16, 27
    names = [("blade", j, 0), ("sleeper", j), ("blade", k, 0), ("sleeper", k)]
    probes = [Probe(name, order) for name in names for order in (0, 1)]
    drive = Drive(7.0, 40.0, surfaces=SURFACES)
    outcome = run(prepared, 0.3, probes, lone_wheels(6000.0), drive)
    s = outcome.signals
    spring = [BLADE.chair_stiffness * (a - c) + BLADE.chair_damping * (b - d) for a, b, c, d in (s[:4], s[4:])]
    weight = GRAVITY * BLADE.rail.mass * 0.6
    port = outcome.port_force[BLADE.slide_chairs(SWITCH).index(j)]
    assert spring[0].min() < -2.0 * weight, "the blade lifts off here: otherwise the test would show nothing"
    assert (spring[0] + port).min() > -1.05 * weight
    assert spring[1].min() < -1.05 * weight


@pytest.mark.parametrize(
    ("blade", "message"),
    [
        ({"toe": 15.0, "heel": 9.0}, "not in this order"),
        ({"end": 31.0}, "the end at 31.000 m is not from 0.000 to 30.000 m"),
        ({"chair_stiffness": -1.0}, "chair_stiffness must not be negative"),
    ],
)
def test_an_impossible_blade_is_rejected(blade, message):
    values = {"toe": 9.0, "heel": 15.0, "end": 24.0, "rail": TRACK.rail, "chair_stiffness": 3e8, "chair_damping": 3e4}
    with pytest.raises(SimulationError, match=message):
        TRACK.with_(blade=Blade(**{**values, **blade}))


@pytest.mark.parametrize("toe", [9.2, 9.04, 20.8])
def test_a_blade_has_the_same_length_on_every_mesh(toe):
    """Without a node at its toe it would be up to 0.15 m too long or too short, and be on another chair."""
    heel, end = (15.0, 24.0) if toe < 15.0 else (14.0, 6.0)
    switch, frequency = TRACK.with_(blade=Blade(toe, heel, end, TRACK.rail, 3e8, 3e4)), np.linspace(20.0, 112.0, 20)
    position = toe + 0.1 * np.sign(heel - toe)
    meshes = (prepare(switch.with_(elements_per_bay=n), 1e-4).matrices for n in (2, 4, 6, 8))
    *coarse, fine = (receptance(matrices, frequency, position, position) for matrices in meshes)
    assert max(np.max(np.abs(h / fine - 1.0)) for h in coarse) < 0.005


def test_a_wheel_on_the_stock_rail_sinks_by_a_power_of_the_distance():
    """Closed form at half the way, in either direction; 2 unless the file gives another."""
    x = np.array([9.0, 10.5, 12.0, 13.5, 20.0])
    for power, half in ((1.8, 0.02 * 0.5**1.8), (2.0, 0.005)):
        expected = pytest.approx([0.0, 0.0, half, 0.02, 0.02])
        assert StockFall(10.5, 3.0, 0.02, power)(x) == expected
        assert StockFall(-10.5, -3.0, 0.02, power)(-x) == expected
    assert StockFall(10.5, 3.0, 0.02).power == 2.0
    with pytest.raises(SimulationError, match="power"):
        StockFall(10.5, 3.0, 0.02, 0.5)
