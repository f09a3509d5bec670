"""Trains of several vehicles behind each other."""

from dataclasses import replace

from turnout.simulate.vehicle import EACH, Body, Suspension, Vehicle, one_or_all


def coupled(name, vehicles):
    """One train of ``vehicles`` behind each other; every wheel keeps its contact, radius and pressing force.

    >>> from turnout.simulate.vehicle import car
    >>> two = coupled("two cars", [car(length=26.0, overhang=1.9)] * 2)
    >>> [float(p) for p in two.wheel_places[:5]]
    [0.0, 2.5, 17.7, 20.2, 26.0]
    """
    bodies: list[Body] = []
    suspensions: list[Suspension] = []
    wheels: list[int] = []
    links: list[tuple] = []
    end = -vehicles[0].overhang
    for vehicle in vehicles:
        shift, first = end + vehicle.overhang, len(bodies)
        row = int(sum(1 if b.inertia is None else 2 for b in bodies))
        bodies += [replace(b, place=b.place + shift) for b in vehicle.bodies]
        suspensions += [replace(s, upper=s.upper + first, lower=s.lower + first) for s in vehicle.suspensions]
        wheels += [w + first for w in vehicle.wheels]
        links += [(tuple((r + row, f) for r, f in ends), *rest) for ends, *rest in vehicle.extra_links]
        end += vehicle.length
    lead = vehicles[0]
    return Vehicle(
        name,
        tuple(bodies),
        tuple(suspensions),
        tuple(wheels),
        **{what: one_or_all([value for v in vehicles for value in v.each(what)]) for what in EACH},
        extra_links=tuple(links),
        length=end + lead.overhang,
        overhang=lead.overhang,
        conditions=dict(lead.conditions),
    )
