"""Read the track of a turnout from its file, with checks of keys, units and routes."""

import numpy as np

from turnout.simulate.rail import Rail
from turnout.simulate.track import RailStretch, Track
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.wheel_path import Corrugation, Cosine, Dip, Kink, Sections

SUPPORT_UNITS = {
    "pad_stiffness": "N/m",
    "pad_damping": "N s/m",
    "sleeper_mass": "kg",
    "ballast_stiffness": "N/m",
    "ballast_damping": "N s/m",
    "ballast_mass": "kg",
    "subgrade_stiffness": "N/m",
    "subgrade_damping": "N s/m",
    "bay_shear_stiffness": "N/m",
    "bay_shear_damping": "N s/m",
}
NEEDED = ("pad_stiffness", "pad_damping")
RAIL_UNITS = {
    "youngs_modulus": "Pa",
    "second_moment": "m⁴",
    "area": "m²",
    "mass": "kg/m",
    "shear_modulus": "Pa",
    "shear_coefficient": "-",
    "density": "kg/m³",
}
TRACK_KEYS = (
    "name",
    "title",
    "layers",
    "elements_per_bay",
    "extent",
    "spacing",
    "pad_width",
    "absorbing_end",
    "rail",
    "support",
    "sections",
    "stretches",
    "scatter",
    "roughness",
    "routes",
    "locations",
    "terms",
)


def turnout_track(parameters, seed=0):
    """``TurnoutTrack`` from a parameter set read by ``turnout.config.parameters.read_parameters``.

    ``sections`` change values of ``support`` between ``from`` and ``to`` [m], later ones over earlier ones;
    ``scatter`` gives relative standard deviations that are drawn, log-normally, with ``seed``.

    Errors: ConfigError with file and entry where a key is unknown or missing, or a value cannot be used.
    """
    p = parameters.only(*TRACK_KEYS)
    routes = _routes(p)
    tracks = {name: _track(p, name, tuple(routes), seed) for name in routes}
    first = next(iter(routes))
    terms = tuple(p.parts("terms"))
    for entry in terms:
        _route_of(entry, routes)
    rough = p.maybe("roughness").only("level")
    level = rough.number("level", "dB") if rough else None
    places, numbers, spreads = _locations(p, routes), tuple(p.numbers()), dict(_spreads(p.maybe("routes")))
    return TurnoutTrack(tracks[first], routes, level, places, numbers, tracks, terms, spreads)


def _routes(p):
    routes = p.maybe("routes")
    return {name: _surfaces(routes, name) for name in routes} or {"main": ((),)}


def _surfaces(routes, name):
    """Surfaces of a route: its ``common`` parts on each of its ``surfaces``, or one surface."""
    if isinstance(routes[name], list):
        return (tuple(_path(part) for part in routes.parts(name)),)
    route = routes.part(name).only("common", "surfaces")
    common = tuple(_path(part) for part in route.parts("common"))
    surfaces = route.listed("surfaces")
    if not surfaces:
        raise route.error(None, "a route without a surface", "List its surfaces, or the parts of its only one")
    return tuple((*common, *(_path(part) for part in surfaces.parts(k))) for k in surfaces)


def _spreads(routes):
    """(part, field -> relative standard deviation) of every part that has a prior; for a list its largest."""
    for entry in entries_of_routes(routes):
        spread: dict[str, float] = {}
        for place, number in entry.numbers():
            name = place.removeprefix(f"{entry.place}.").split("[")[0]
            if number.prior:
                spread[name] = max(number.prior, spread.get(name, 0.0))
        if spread:
            yield _path(entry), spread


def entries_of_routes(routes):
    """The entry of every part of every route."""
    for name in routes:
        if isinstance(routes[name], list):
            yield from routes.parts(name)
            continue
        route = routes.part(name)
        surfaces = route.listed("surfaces")
        yield from route.parts("common")
        for k in surfaces:
            yield from surfaces.parts(k)


def _locations(p, routes):
    """Name -> (position [m], route); the first route where none is named."""
    found = p.maybe("locations")
    entries = {name: found.part(name).only("place", "route") for name in found}
    return {name: (e.number("place", "m"), _route_of(e, routes)) for name, e in entries.items()}


def _route_of(entry, routes, otherwise=None):
    """Route that an entry names; if it names none ``otherwise`` or the first route."""
    route = entry.get("route", otherwise or next(iter(routes)))
    if route not in list(routes):
        remedy = f"Write one of {', '.join(routes)}, or leave it out"
        raise entry.error("route", f"{route!r} is no route of this track", remedy)
    return route


def _track(p, route, routes, seed):
    support = _supports(p)
    values, section = _support_values(p, support, route, routes)
    _draw_scatter(p, values, seed)
    elements = p.count("elements_per_bay", 4)
    end = p.maybe("absorbing_end").only("length", "rate")
    return p.make(
        Track,
        _rail(p.part("rail")),
        support,
        **values,
        layers=p.count("layers", 2),
        elements_per_bay=elements,
        pad_width=p.number("pad_width", "m", default=0.0),
        stretches=tuple(_stretches(p, support, elements, route, routes)),
        end_length=end.number("length", "m") if end else 0.0,
        end_damping=end.number("rate", "1/s") if end else 0.0,
        section=tuple(section),
        name=str(p["name"]),
    )


def _supports(p):
    start, end = _ends(p.part("extent").only("from", "to"))
    spacing = p.number("spacing", "m")
    if not 0.0 < spacing <= 0.5 * (end - start):
        found = f"{spacing:g} m does not divide a track of {end - start:g} m into bays"
        raise p.error("spacing", found, "Write the distance of two supports")
    return start + spacing * np.arange(round((end - start) / spacing) + 1)


def _ends(entry):
    """``from`` and ``to`` of an entry [m]."""
    start, end = entry.number("from", "m"), entry.number("to", "m")
    if start >= end:
        raise entry.error(
            None, f"from {start:g} m to {end:g} m is no stretch of track", "Write the smaller place first"
        )
    return start, end


def _draw_scatter(p, values, seed):
    scatter = p.maybe("scatter").only(*SUPPORT_UNITS)
    rng = np.random.default_rng(seed)
    for name in scatter:
        if name not in values:
            raise scatter.error(name, "scatter of a value that is not given", f"Give {name!r} in 'support'")
        sigma = np.sqrt(np.log1p(scatter.number(name, "-") ** 2))
        values[name] = values[name] * np.exp(sigma * rng.normal(size=values[name].size) - 0.5 * sigma**2)


def _stretches(p, support, elements, route, routes):
    """Stretches of other rail on ``route``; one without the middle of an element has no effect and is rejected."""
    nodes = np.interp(np.arange(elements * (support.size - 1) + 1) / elements, np.arange(support.size), support)
    middle = 0.5 * (nodes[:-1] + nodes[1:])
    for entry in p.parts("stretches"):
        start, end = _ends(entry.only("from", "to", "rail", "route"))
        if start < support[-1] and end > support[0] and not np.any((middle >= start) & (middle < end)):
            found = f"from {start:g} m to {end:g} m lies the middle of no element"
            raise entry.error(None, found, f"Make it as long as an element, {nodes[1] - nodes[0]:g} m")
        if _route_of(entry, routes, route) == route:
            yield RailStretch(start, end, _rail(entry.part("rail")))


def _rail(p):
    p.only(*RAIL_UNITS, "damping", "beam", "name")
    values = {name: p.number(name, unit) for name, unit in RAIL_UNITS.items()}
    bending = values["youngs_modulus"] * values["second_moment"]
    shear = values["shear_coefficient"] * values["shear_modulus"] * values["area"]
    rotary = values["density"] * values["second_moment"]
    damping = p.number("damping", "N s/m²", default=0.0)
    return p.make(Rail, bending, values["mass"], shear, rotary, damping, p.get("beam", "timoshenko"))


def _support_values(p, support, route, routes):
    """Values of every support on ``route`` by name, (n,) each, and the label of its section."""
    base = p.part("support").only(*SUPPORT_UNITS)
    given = [name for name in SUPPORT_UNITS if name in base or name in NEEDED]
    values = {name: np.full(support.size, base.number(name, SUPPORT_UNITS[name])) for name in given}
    section = ["" for _ in support]
    for entry in p.parts("sections"):
        start, end = _ends(entry.only("label", "panel", "from", "to", "route", *SUPPORT_UNITS))
        if _route_of(entry, routes, route) != route:
            continue
        inside = (support >= start) & (support < end)
        for j in np.flatnonzero(inside):
            section[j] = str(entry["label"])
        for name, unit in SUPPORT_UNITS.items():
            if name in entry:
                values.setdefault(name, np.zeros(support.size))[inside] = entry.number(name, unit)
    return values, section


PATHS = {
    "dip": (Dip, {"place": "m", "depth": "m", "length": "m"}),
    "cosine": (Cosine, {"place": "m", "depth": "m", "length": "m"}),
    "kink": (Kink, {"place": "m", "depth": "m", "length": "m", "share": "-", "power": "-"}),
    "corrugation": (Corrugation, {"start": "m", "end": "m", "amplitude": "m", "wavelength": "m"}),
}
OPTIONAL = ("share", "power")


def _path(p):
    """One part of the path of a wheel."""
    kind = p["kind"]
    if kind == "sections":
        listed = [p.only("kind", "places", "dips").listed(name) for name in ("places", "dips")]
        return p.make(Sections, *(tuple(values.number(k, "m") for k in values) for values in listed))
    if kind not in list(PATHS):
        raise p.error("kind", f"no path of kind {kind!r}", f"Write one of sections, {', '.join(PATHS)}")
    made, units = PATHS[kind]
    p.only("kind", *units)
    return p.make(
        made, **{name: p.number(name, unit) for name, unit in units.items() if name in p or name not in OPTIONAL}
    )
