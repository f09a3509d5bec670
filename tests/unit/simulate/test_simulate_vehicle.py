"""Vehicles: weights, symmetry, shared bogies, trains of files."""

import numpy as np
import pytest
from scipy.linalg import eigh

from turnout.config.parameter_files import read_parameters
from turnout.constants import GRAVITY
from turnout.errors import SimulationError
from turnout.installation import shipped_path
from turnout.simulate import car, load_track, load_vehicle
from turnout.simulate.ports import contact_ports
from turnout.simulate.train import couple
from turnout.simulate.vehicle import Body, Suspension, Vehicle, lone_wheels

AXLES = {
    "ic3": 8,
    "locomotive": 4,
    "coach": 4,
    "wagon_four_axles": 4,
    "wagon_two_axles": 2,
    "intercity": 24,
    "freight": 40,
}
FILES = [shipped_path("config/vehicles") / f"{name}.yaml" for name in AXLES]


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
@pytest.mark.parametrize("load", [0.0, 1.0])
def test_the_loads_of_the_wheels_sum_to_the_weight_of_the_vehicle(path, load):
    vehicle = load_vehicle(path.stem, load)
    assert len(vehicle.wheels) == AXLES[path.stem]
    assert vehicle.static_loads.sum() == pytest.approx(GRAVITY * sum(b.mass for b in vehicle.bodies), rel=1e-9)
    axle_loads = 2.0 * vehicle.static_loads / GRAVITY / 1e3
    assert np.all((axle_loads > 4.0) & (axle_loads < 23.0)), axle_loads
    mass, damping, stiffness, _ = vehicle.matrices
    for matrix in (mass, damping, stiffness):
        assert np.allclose(matrix, matrix.T, atol=0.0) and np.linalg.eigvalsh(matrix).min() > -1e-3 * abs(matrix).max()
    lift = np.zeros(vehicle.n)
    lift[vehicle.row[:-1]] = 1.0
    assert np.max(np.abs(stiffness @ lift)) < 1e-9 * np.max(stiffness)  # lifting the whole train causes no strain


def test_the_ic3_has_97_tonnes_8_axles_and_two_shared_bogies():
    """DSB litra MF: 58.8 m, 97 t tare, three cars on four bogies."""
    ic3 = load_vehicle("ic3", 0.0)
    assert 2.0 * ic3.static_loads.sum() / GRAVITY == pytest.approx(97e3, rel=5e-3)
    assert [b.name for b in ic3.bodies].count("bogie") == 4 and ic3.length == pytest.approx(58.8)
    assert np.allclose(ic3.static_loads, ic3.static_loads[::-1], atol=0.0)
    assert len(ic3.blocks) == 2  # shared bogies couple all three cars
    two = load_vehicle("ic3", 0.0, units=2)
    assert np.allclose(two.wheel_positions[8:] - two.wheel_positions[:8], 58.8, atol=0.0) and len(two.blocks) == 3


def test_the_manchester_bounce_frequencies_follow_from_its_masses_and_springs():
    """Two-mass chain body-bogies with wheels held: closed form of the 2 x 2 problem."""
    coach = load_vehicle("coach", 0.0)
    mass, _, stiffness, _ = coach.matrices
    held = np.setdiff1d(np.arange(coach.n), coach.wheel_rows)
    values = np.linalg.eigvals(np.linalg.solve(mass[np.ix_(held, held)], stiffness[np.ix_(held, held)])).real
    found = np.sqrt(np.sort(values)) / (2.0 * np.pi)
    mb, mt, ks, kp = 32e3, 2 * 2615.0, 2 * 0.86e6, 4 * 2.40e6
    a, b, c = mb * mt, -(mb * (ks + kp) + mt * ks), ks * kp
    low, high = np.sort(np.sqrt(np.roots([a, b, c]).real)) / (2.0 * np.pi)
    assert np.min(np.abs(found - low)) < 1e-6 and np.min(np.abs(found - high)) < 1e-6


@pytest.mark.parametrize("name", ["ic3", "coach", "locomotive", "wagon_four_axles", "wagon_two_axles"])
def test_the_contact_stiffness_is_that_of_hertz(name):
    """4/3 E* (R r)^(1/4) for crossed cylinders; the ellipse's own correction is below 4 % up to R = 2 r."""
    vehicle = load_vehicle(name)
    hertz = 4.0 / 3.0 * 210e9 / (2.0 * (1.0 - 0.3**2)) * (vehicle.radius * 0.3) ** 0.25
    assert vehicle.contact.stiffness == pytest.approx(hertz, rel=0.02)


def lopsided():
    """A body that rests on wheels 2 m before and 5 m behind its centre, with a shear link from its pitch to a wheel."""
    bodies = (Body("body", 2e4, 3e5, 2.0), Body("a", 700.0, None, 0.0), Body("b", 900.0, None, 7.0))
    springs = (Suspension(0, 1, -2.0, 5e5, 4e3), Suspension(0, 2, 5.0, 8e5, 6e3))
    link = (((1, 0.7), (3, -1.0)), 2e5, 1e3, 5.0)
    return Vehicle("lopsided", bodies, springs, (1, 2), extra_links=(link,), length=10.0, overhang=1.0)


@pytest.mark.parametrize("vehicle", [load_vehicle("intercity"), lopsided()], ids=["intercity", "lopsided"])
def test_a_reversed_train_has_its_wheels_loads_and_modes_in_reverse_order(vehicle):
    turned = vehicle.reverse()
    last = vehicle.wheel_positions[-1]
    assert turned.wheel_positions == pytest.approx(last - vehicle.wheel_positions[::-1])
    assert turned.static_loads == pytest.approx(vehicle.static_loads[::-1])
    assert turned.static_loads[0] != pytest.approx(vehicle.static_loads[0], rel=1e-3)  # the input has no symmetry
    assert turned.overhang + vehicle.overhang + last == pytest.approx(vehicle.length)
    modes = [np.sort(eigh(v.matrices[2], v.matrices[0], eigvals_only=True)) for v in (vehicle, turned)]
    assert modes[0] == pytest.approx(modes[1], abs=1e-9 * modes[0][-1])
    again = turned.reverse()
    assert [b.position for b in again.bodies] == pytest.approx([b.position for b in vehicle.bodies])
    assert (again.suspensions, again.wheels, again.extra_links) == (
        vehicle.suspensions, vehicle.wheels, vehicle.extra_links,
    )  # fmt: skip


def test_coupled_cars_keep_their_places_and_blocks():
    pair = couple("pair", [car(length=26.0, overhang=1.9), car(length=24.0, overhang=1.5)])
    assert pair.wheel_positions[4] == pytest.approx(26.0 - 1.9 + 1.5)
    assert list(pair.blocks) == [0, 10, 20]


def test_wheels_of_a_composed_train_keep_their_radius_and_contact():
    """Four wheels of the locomotive, twenty of its coaches; of the reversed train the coaches come first."""
    train, locomotive, coach = (load_vehicle(name) for name in ("intercity", "locomotive", "coach"))
    assert locomotive.radius != coach.radius and locomotive.contact != coach.contact
    assert train.wheel_values("radius") == (locomotive.radius,) * 4 + (coach.radius,) * 20
    assert train.reverse().wheel_values("radius") == (coach.radius,) * 20 + (locomotive.radius,) * 4
    laws = [law for *_, law in contact_ports(train, ((), ()), 0.0, 1)]
    assert laws == [locomotive.contact] * 8 + [coach.contact] * 40
    assert load_vehicle("wagon_four_axles", units=2).radius == load_vehicle("wagon_four_axles").radius


def test_coupled_vehicles_keep_their_gravity():
    """Half of it: half of the load on every wheel."""
    moon = car(length=26.0, overhang=1.9, gravity=0.5 * 9.81)
    assert couple("two", [moon, moon]).static_loads == pytest.approx(0.5 * car().static_loads[0])


def test_coupled_vehicles_keep_the_loads_on_their_wheels():
    light, heavy = (lone_wheels(900.0, (0.0, 2.0), pressing=force, length=5.0) for force in (3e4, 7e4))
    pair = couple("pair", [light, heavy])
    assert pair.static_loads == pytest.approx([*light.static_loads, *heavy.static_loads])
    with pytest.raises(SimulationError, match="radius of 3 wheels, the train has 4"):
        pair.with_(radius=(0.4, 0.4, 0.4))


@pytest.mark.parametrize("path", [*FILES, *sorted(shipped_path("config/tracks").glob("*.yaml"))], ids=lambda p: p.stem)
def test_every_number_has_a_source_and_every_estimate_a_prior(path):
    numbers = list(read_parameters(path).numbers())
    assert numbers or "compose" in path.read_text()
    for place, number in numbers:
        assert len(number.source) > 3, place
        assert not number.source.startswith("estimate") or number.prior, place


def test_scatter_is_drawn_by_the_seed():
    one, same, other = (load_track("tommerup", seed=s).track for s in (1, 1, 2))
    assert np.array_equal(one.ballast_stiffness, same.ballast_stiffness)
    assert one.support.size == other.support.size == 171
