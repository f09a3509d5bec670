"""Positions between nodes: static and dynamic closed forms on any mesh."""

from itertools import pairwise

import numpy as np
import pytest

from turnout.simulate.decay_rate import DISTANCES, track_decay_rate
from turnout.simulate.force_laws import LinearLaw
from turnout.simulate.frequency_response import receptance, receptance_gradient
from turnout.simulate.infinite_track import floquet_receptance
from turnout.simulate.matrices import assemble
from turnout.simulate.preparation import prepare
from turnout.simulate.rail import Rail
from turnout.simulate.run import Drive, Probe, run
from turnout.simulate.track import Track, uniform_track
from turnout.simulate.vehicle import lone_wheels

SPAN = 2.4
UIC60 = {"bending_stiffness": 6.42e6, "mass": 60.21, "shear_stiffness": 2.4e8}
PLACES = [(0.5, 0.5), (0.5, 0.7), (1.1, 0.85), (1.3, 0.2)]  # some in one element of 0.6 m, some not


def simple_beam(beam="timoshenko"):
    """Two bays without a support between, on ends of 1e14 N/m: they give 1e-6 of the beam's deflection."""
    rail = Rail(**UIC60, beam=beam)
    return Track(rail, [0.0, SPAN / 2, SPAN], [1e14, 0.0, 1e14], 0.0, layers=1, elements_per_bay=2)


def influence(x, a, beam="timoshenko"):
    """Deflection at ``x`` of a simply supported beam under 1 N at ``a`` [m/N] (Timoshenko, Strength of materials)."""
    low, high = min(x, a), max(x, a)
    bend = (SPAN - high) * low * (SPAN**2 - (SPAN - high) ** 2 - low**2) / (6.0 * SPAN * UIC60["bending_stiffness"])
    return bend + (beam == "timoshenko") * (SPAN - high) * low / (SPAN * UIC60["shear_stiffness"])


@pytest.mark.parametrize("beam", ["timoshenko", "euler"])
@pytest.mark.parametrize(("x", "a"), PLACES)
def test_the_static_receptance_is_the_influence_line_of_the_beam(x, a, beam):
    """To 1e-5, for the compliance of the ends and rounding."""
    matrices = assemble(simple_beam(beam))
    h = receptance(matrices, [0.0], a, x)[0]
    assert h.real == pytest.approx(influence(x, a, beam), rel=1e-5, abs=0.0)
    assert receptance_gradient(matrices, [0.0], a, x, [])[0][0] == h


@pytest.mark.parametrize(("x", "a"), PLACES)
def test_a_standing_load_deflects_a_sensor_by_the_influence_line(x, a):
    """The load is in equilibrium from the start and does not move: 1e-5 as above; 1e-9 of gravity."""
    load = lone_wheels(1.0, contact=LinearLaw(0.0, 0.0, 5e4), gravity=0.0, pressing=5e4)
    probes = [Probe(x, order) for order in (0, 1, 2)]
    outcome = run(prepare(simple_beam(), 1e-4), 1e-3, probes, load, Drive(a, 0.0, entry=0.0), forces=False)
    assert outcome.signals[0] == pytest.approx(5e4 * influence(x, a), rel=1e-5)
    assert np.max(np.abs(outcome.signals[1:])) < 1e-6


def test_velocity_and_acceleration_between_nodes_add_up_to_the_motion():
    """An impact beside the sensor: summed to the middle of each step they are what is stamped there, to the 1 % by
    which a pulse of 1 ms is no straight line over two steps of 50 µs."""
    dt, force = 5e-5, lambda t: 1e4 * np.sin(np.pi * np.clip(t / 1e-3, 0.0, 1.0)) ** 2
    probes = [Probe(6.04, order) for order in (0, 1, 2)]
    signals = run(prepare(uniform_track(12.0), dt), 5e-3, probes, pulses=[(6.08, force)]).signals
    for whole, rate in pairwise(signals):
        assert np.max(np.abs(np.cumsum(rate) * dt - 0.5 * rate * dt - whole)) < 0.01 * np.max(np.abs(whole))


@pytest.mark.parametrize("offset", [0.04, 0.075])
def test_an_impact_between_nodes_has_the_receptance_of_the_infinite_track(offset):
    """Floquet's closed form, 60 to 350 Hz, to 1 %: four elements per bay cost 0.6 %, its own element gives 6 %."""
    track = uniform_track(60.0, end_length=12.0, end_damping=400.0)
    prepared, place = prepare(track, 5e-5), 30.0 + offset
    force = lambda t: np.where(t < 1e-3, 5e3 * np.sin(np.pi * t / 1e-3) ** 2, 0.0)  # noqa: E731
    outcome = run(prepared, 0.3, [Probe(place)], pulses=[(place, force)])
    stages = (np.arange(outcome.time.size)[:, None] + prepared.scheme.node) * prepared.dt
    pressed = np.fft.rfft(force(stages) @ prepared.scheme.quadrature)
    frequency = np.fft.rfftfreq(outcome.time.size, prepared.dt)
    band = (frequency >= 60.0) & (frequency <= 350.0)
    found = np.fft.rfft(outcome.signals[0])[band] / pressed[band] / -((2.0 * np.pi * frequency[band]) ** 2)
    assert np.max(np.abs(found / floquet_receptance(frequency[band], track, offset) - 1.0)) < 0.01


def test_the_decay_rate_does_not_depend_on_the_mesh():
    """Far below its first mode (89 Hz) a simple beam deflects by its influence line: 1 %, of which the frequency takes
    0.3 %. The grid is laid so close that all of it lies in the accelerometer's element."""
    place, spacing = 0.3, 0.004
    found = track_decay_rate(assemble(simple_beam()), place, spacing, bands=np.array([5.0]))[0]
    x = place + spacing * DISTANCES
    energy = np.array([influence(position, place) for position in x]) ** 2
    width = np.diff(np.concatenate([[x[0]], 0.5 * (x[1:] + x[:-1]), [x[-1] + 0.5 * (x[-1] - x[-2])]]))
    assert found == pytest.approx(4.343 / np.sum(energy / energy[0] * width), rel=0.01)
