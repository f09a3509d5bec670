"""Build trains from parameter sets: cars on single or shared bogies, wagons on two axles, coupled units."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.force_laws import PowerLaw
from turnout.simulate.vehicle import WHEEL_FIELDS, Body, Suspension, Vehicle, one_or_all

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from turnout.config.parameters import ParameterSet

CAR_UNITS = {"mass": "kg", "payload": "kg", "inertia": "kg m²"}
BOGIE_UNITS = {
    "mass": "kg",
    "inertia": "kg m²",
    "base": "m",
    "wheelset_mass": "kg",
    "primary_stiffness": "N/m",
    "primary_damping": "N s/m",
    "secondary_stiffness": "N/m",
    "secondary_damping": "N s/m",
}
AXLE_UNITS = {"wheelset_mass": "kg", "suspension_stiffness": "N/m", "suspension_damping": "N s/m"}
TRAIN_KEYS = ("name", "title", "car_types", "bogie_types", "axle_types", "cars", "bogies", "axles", "wheel", "length")


def train(parameters: ParameterSet, load: float = 0.5, units: int = 1) -> Vehicle:
    """Half a train (one rail) from a parameter set whose masses and springs are those of whole vehicles.

    ``cars`` list their type, ``centre`` [m] and the bogies or axles below them; ``bogies`` and ``axles`` list type
    and centre. Centres are from the unit's front end. A bogie of two cars is shared (Jacobs): each car rests on half of
    its secondary springs. ``load`` is the share of the payload, ``units`` the number of coupled units.

    Parameters
    ----------
    parameters : ParameterSet
        Parameters of a vehicle file.
    load : float
        Share of the payload, 0 to 1.5. [-]
    units : int
        Number of coupled units, at least 1.

    Returns
    -------
    Vehicle
        Half the train.

    Raises
    ------
    SimulationError
        For ``load`` or ``units`` outside these limits, and where cars and bogies do not fit together.
    ConfigError
        With file and entry, where a value cannot be used.
    """
    p = parameters.allow_only(*TRAIN_KEYS)
    if not 0.0 <= load <= 1.5:
        raise SimulationError(f"{p['name']}: load {load!r} is not between 0 (empty) and 1.5 (overloaded).")
    if units < 1:
        raise SimulationError(f"{p['name']}: {units!r} units.")
    length = p.number("length", "m")
    for entry in (e for name in ("cars", "bogies", "axles") for e in p.mappings_at(name)):
        centre = entry.number("centre", "m")
        if not 0.0 <= centre <= length:
            problem = f"{centre:g} m is outside the unit, whose length is {length:g} m"
            raise entry.error("centre", problem, "Correct it, or the length; centres are counted from the front end")
    bodies: list[Body] = []
    suspensions: list[Suspension] = []
    wheels: list[int] = []
    for unit in range(units):
        _add_unit(p, load, unit * length, bodies, suspensions, wheels)
    if not wheels:
        raise p.error(None, "a train without wheels", "List 'cars' and the 'bogies' or 'axles' below them")
    front = min(bodies[w].position for w in wheels)
    bodies = [Body(b.name, b.mass, b.inertia, b.position - front) for b in bodies]
    wheel = p.mapping_at("wheel").allow_only("radius", "contact")
    contact = wheel.build(PowerLaw, wheel.number("contact", "N/m^1.5"))
    conditions = {"load_share": float(load), "n_units": int(units)}
    return p.build(
        Vehicle,
        str(p["name"]),
        tuple(bodies),
        tuple(suspensions),
        tuple(wheels),
        contact,
        radius=wheel.number("radius", "m"),
        length=units * length,
        overhang=float(front),
        conditions=conditions,
    )


def _add_unit(
    p: ParameterSet, load: float, offset: float, bodies: list[Body], suspensions: list[Suspension], wheels: list[int]
) -> None:
    bogies, axles, cars = (p.mappings_at(name) for name in ("bogies", "axles", "cars"))
    carriers = [("bogie", b) for b in bogies] + [("axle", a) for a in axles]
    names = {str(entry.allow_only("label", "type", "centre")["label"]): k for k, (_, entry) in enumerate(carriers)}
    users = {label: sum(label in _carrier_labels(car) for car in cars) for label in names}
    # Bodies in order of position keep the rows of a car together, so that uncoupled cars are separate blocks.
    order = sorted(range(len(carriers)), key=lambda k: carriers[k][1].number("centre", "m"))
    carrier_bodies, carrier_positions = {}, {}
    pending = sorted(cars, key=lambda c: c.number("centre", "m"))
    for entry in pending:
        car_type = _type_values(p, "car_types", entry, CAR_UNITS)
        empty = car_type.number("mass", "kg")
        if not empty > 0.0:
            raise car_type.error("mass", f"{empty:g} kg is no mass of a car", "Write what it weighs empty")
        mass = 0.5 * (empty + load * car_type.number("payload", "kg", default=0.0))
        share = mass / (0.5 * empty)
        car_index = len(bodies)
        centre = offset + entry.number("centre", "m")
        bodies.append(Body(str(entry["type"]), mass, 0.5 * share * car_type.number("inertia", "kg m²"), centre))
        for label in _carrier_labels(entry):
            if label not in names:
                raise SimulationError(f"{p['name']}: a car rests on {label!r}; there are {', '.join(names)}.")
            k = names[label]
            if k not in carrier_bodies:
                carrier_bodies[k] = _add_carrier(p, *carriers[k], offset, bodies, suspensions, wheels)
                carrier_positions[k] = offset + carriers[k][1].number("centre", "m")
            index, stiffness, damping = carrier_bodies[k]
            n = users[label]
            suspensions.append(Suspension(car_index, index, carrier_positions[k] - centre, stiffness / n, damping / n))
    if len(carrier_bodies) < len(order):
        raise SimulationError(f"{p['name']}: a bogie or axle carries no car.")
    wheels.sort(key=lambda w: bodies[w].position)


def _carrier_labels(car: ParameterSet) -> list[str]:
    """Labels of the bogies and axles below a car."""
    return [str(label) for label in car.allow_only("type", "rests_on", "centre").list_at("rests_on").values()]


def _type_values(p: ParameterSet, table: str, entry: ParameterSet, keys: Iterable[str]) -> ParameterSet:
    """The type of a car, bogie or axle: its values in ``table``."""
    return p.mapping_at(table).mapping_at(str(entry["type"])).allow_only(*keys)


def _add_carrier(
    p: ParameterSet,
    carrier_type: str,
    entry: ParameterSet,
    offset: float,
    bodies: list[Body],
    suspensions: list[Suspension],
    wheels: list[int],
) -> tuple[int, float, float]:
    """Add a bogie or axle; returns its body and half of the springs above it."""
    position = offset + entry.number("centre", "m")
    if carrier_type == "axle":
        table = _type_values(p, "axle_types", entry, AXLE_UNITS)
        values = {name: table.number(name, unit) for name, unit in AXLE_UNITS.items()}
        wheels.append(len(bodies))
        bodies.append(Body("wheel", 0.5 * values["wheelset_mass"], None, position))
        return len(bodies) - 1, 0.5 * values["suspension_stiffness"], 0.5 * values["suspension_damping"]
    table = _type_values(p, "bogie_types", entry, (*BOGIE_UNITS, "axles"))
    values = {name: table.number(name, unit) for name, unit in BOGIE_UNITS.items()}
    bogie = len(bodies)
    bodies.append(Body("bogie", 0.5 * values["mass"], 0.5 * values["inertia"], position))
    for side in np.linspace(-0.5, 0.5, table.count("axles", 2)):
        lever = side * values["base"]
        suspensions.append(
            Suspension(bogie, len(bodies), lever, 0.5 * values["primary_stiffness"], 0.5 * values["primary_damping"])
        )
        wheels.append(len(bodies))
        bodies.append(Body("wheel", 0.5 * values["wheelset_mass"], None, position + lever))
    return bogie, 0.5 * values["secondary_stiffness"], 0.5 * values["secondary_damping"]


def couple(name: str, vehicles: Sequence[Vehicle]) -> Vehicle:
    """One train of ``vehicles`` in a row; every wheel has the contact, radius and pressing force of its vehicle.

    Parameters
    ----------
    name : str
        Name of the train.
    vehicles : sequence of Vehicle
        Vehicles, front first; each needs its length and overhang.

    Returns
    -------
    Vehicle
        The train, with the conditions of its first vehicle.

    Raises
    ------
    SimulationError
        For no vehicle, for vehicles that differ in gravity, and where wheels would not follow each other.

    Examples
    --------
    >>> from turnout.simulate.vehicle import car
    >>> two = couple("two cars", [car(length=26.0, overhang=1.9)] * 2)
    >>> [float(p) for p in two.wheel_positions[:5]]
    [0.0, 2.5, 17.7, 20.2, 26.0]
    """
    if not vehicles:
        raise SimulationError(f"{name}: a train of no vehicles.")
    if len({vehicle.gravity for vehicle in vehicles}) > 1:
        raise SimulationError(f"{name}: vehicles of one train need the same gravity.")
    bodies: list[Body] = []
    suspensions: list[Suspension] = []
    wheels: list[int] = []
    links: list[tuple] = []
    end = -vehicles[0].overhang
    for vehicle in vehicles:
        shift, first = end + vehicle.overhang, len(bodies)
        row = int(sum(1 if b.inertia is None else 2 for b in bodies))
        bodies += [replace(b, position=b.position + shift) for b in vehicle.bodies]
        suspensions += [replace(s, upper=s.upper + first, lower=s.lower + first) for s in vehicle.suspensions]
        wheels += [w + first for w in vehicle.wheels]
        links += [(tuple((r + row, f) for r, f in ends), *coefficients) for ends, *coefficients in vehicle.extra_links]
        end += vehicle.length
    lead = vehicles[0]
    return Vehicle(
        name,
        tuple(bodies),
        tuple(suspensions),
        tuple(wheels),
        **{
            quantity: one_or_all([value for v in vehicles for value in v.wheel_values(quantity)])
            for quantity in WHEEL_FIELDS
        },
        gravity=lead.gravity,
        extra_links=tuple(links),
        length=end + lead.overhang,
        overhang=lead.overhang,
        conditions=dict(lead.conditions),
    )
