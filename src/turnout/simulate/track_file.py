"""Read the track of a turnout from its file, with checks of keys, units and routes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.simulate.blade import Blade
from turnout.simulate.rail import Rail
from turnout.simulate.track import RailStretch, Track
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.wheel_path import BladeTop, Corrugation, Cosine, Dip, Kink, Sections, StockFall

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping

    from turnout.config.parameters import ParameterSet
    from turnout.simulate.wheel_path import PathPart, Surfaces

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
REQUIRED_VALUES = ("pad_stiffness", "pad_damping")
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
    "blade",
)


def turnout_track(parameters: ParameterSet, seed: int = 0) -> TurnoutTrack:
    """``TurnoutTrack`` from a parameter set read by ``turnout.config.parameter_files.read_parameters``.

    ``sections`` change values of ``support`` between ``from`` and ``to`` [m], later ones over earlier ones;
    ``scatter`` gives relative standard deviations that are drawn, log-normally, with ``seed``.

    Parameters
    ----------
    parameters : ParameterSet
        Parameters of the whole file.
    seed : int
        Seed of the scatter along the track.

    Returns
    -------
    TurnoutTrack
        The turnout with a track for each route.

    Raises
    ------
    ConfigError
        With file and entry, where a key is unknown or missing or a value cannot be used.
    """
    p = parameters.allow_only(*TRACK_KEYS)
    routes = _routes(p)
    tracks = {name: _track(p, name, tuple(routes), seed) for name in routes}
    first = next(iter(routes))
    terms = tuple(p.mappings_at("terms"))
    for entry in terms:
        _route_of(entry, routes)
    rough = p.optional_mapping_at("roughness").allow_only("level")
    level = rough.number("level", "dB") if rough else None
    locations, numbers, spreads = (
        _locations(p, routes),
        tuple(p.numbers()),
        dict(_spreads(p.optional_mapping_at("routes"))),
    )
    return TurnoutTrack(tracks[first], routes, level, locations, numbers, tracks, terms, spreads)


def _routes(p: ParameterSet) -> dict[str, Surfaces]:
    routes = p.optional_mapping_at("routes")
    return {name: _surfaces(routes, name) for name in routes} or {"main": ((),)}


def _surfaces(routes: ParameterSet, name: str) -> Surfaces:
    """Surfaces of a route: its ``common`` parts on each of its ``surfaces``, or one surface."""
    if isinstance(routes[name], list):
        return (tuple(_path_part(entry) for entry in routes.mappings_at(name)),)
    route = routes.mapping_at(name).allow_only("common", "surfaces")
    common = tuple(_path_part(entry) for entry in route.mappings_at("common"))
    surfaces = route.list_at("surfaces")
    if not surfaces:
        raise route.error(None, "a route without a surface", "List its surfaces, or the parts of its only one")
    return tuple((*common, *(_path_part(entry) for entry in surfaces.mappings_at(k))) for k in surfaces)


def _spreads(routes: ParameterSet) -> Iterator[tuple[PathPart, dict[str, float]]]:
    """(part, field -> relative standard deviation) of every part that has a prior; for a list its largest."""
    for entry in entries_of_routes(routes):
        spread: dict[str, float] = {}
        for key, number in entry.numbers():
            name = key.removeprefix(f"{entry.place.entry}.").split("[")[0]
            if number.prior:
                spread[name] = max(number.prior, spread.get(name, 0.0))
        if spread:
            yield _path_part(entry), spread


def entries_of_routes(routes: ParameterSet) -> Iterator[ParameterSet]:
    """The entry of every part of every route.

    Parameters
    ----------
    routes : ParameterSet
        Mapping ``routes`` of a track file.

    Yields
    ------
    ParameterSet
        Entry with the kind and the values of a part.
    """
    for name in routes:
        if isinstance(routes[name], list):
            yield from routes.mappings_at(name)
            continue
        route = routes.mapping_at(name)
        surfaces = route.list_at("surfaces")
        yield from route.mappings_at("common")
        for k in surfaces:
            yield from surfaces.mappings_at(k)


def _locations(p: ParameterSet, routes: Mapping[str, Surfaces]) -> dict[str, tuple[float, str]]:
    """Name -> (position [m], route); the first route where none is named."""
    section = p.optional_mapping_at("locations")
    entries = {name: section.mapping_at(name).allow_only("place", "route") for name in section}
    return {name: (e.number("place", "m"), _route_of(e, routes)) for name, e in entries.items()}


def _route_of(entry: ParameterSet, routes: Collection[str], otherwise: str | None = None) -> str:
    """Route that an entry names; if it names none ``otherwise`` or the first route."""
    route = entry.get("route", otherwise or next(iter(routes)))
    if route not in list(routes):
        remedy = f"Write one of {', '.join(routes)}, or leave it out"
        raise entry.error("route", f"{route!r} is no route of this track", remedy)
    return route


def _track(p: ParameterSet, route: str, routes: tuple[str, ...], seed: int) -> Track:
    support = _supports(p)
    values, section = _support_values(p, support, route, routes)
    _draw_scatter(p, values, seed)
    elements = p.count("elements_per_bay", 4)
    end = p.optional_mapping_at("absorbing_end").allow_only("length", "rate")
    for name, unit in (("length", "m"), ("rate", "1/s")) if end else ():
        if (value := end.number(name, unit)) < 0.0:
            raise end.error(name, f"{value:g} {unit} is below 0", "Correct it, or leave out the absorbing end")
    return p.build(
        Track,
        _rail(p.mapping_at("rail")),
        support,
        **values,
        layers=p.count("layers", 2),
        elements_per_bay=elements,
        pad_width=p.number("pad_width", "m", default=0.0),
        stretches=tuple(_stretches(p, support, elements, route, routes)),
        end_length=end.number("length", "m") if end else 0.0,
        end_damping=end.number("rate", "1/s") if end else 0.0,
        section=tuple(section),
        blade=_blade(p),
        name=str(p["name"]),
    )


BLADE_UNITS = {"toe": "m", "heel": "m", "end": "m", "chair_stiffness": "N/m", "chair_damping": "N s/m"}


def _blade(p: ParameterSet) -> Blade | None:
    """The blade of a switch, None without one."""
    entry = p.optional_mapping_at("blade").allow_only(*BLADE_UNITS, "rail", "planed")
    if not entry:
        return None
    values = {name: entry.number(name, unit) for name, unit in BLADE_UNITS.items()}
    planed = entry.optional_mapping_at("planed").allow_only("length", "share")
    if planed:
        values |= {"planed_length": planed.number("length", "m"), "planed_share": planed.number("share", "-")}
    return entry.build(Blade, rail=_rail(entry.mapping_at("rail")), **values)


def _supports(p: ParameterSet) -> np.ndarray:
    start, end = _ends(p.mapping_at("extent").allow_only("from", "to"))
    spacing = p.number("spacing", "m")
    if not 0.0 < spacing <= 0.5 * (end - start):
        problem = f"{spacing:g} m does not divide a track of {end - start:g} m into bays"
        raise p.error("spacing", problem, "Write the distance of two supports")
    return start + spacing * np.arange(round((end - start) / spacing) + 1)


def _ends(entry: ParameterSet) -> tuple[float, float]:
    """``from`` and ``to`` of an entry [m]."""
    start, end = entry.number("from", "m"), entry.number("to", "m")
    if start >= end:
        raise entry.error(
            None, f"from {start:g} m to {end:g} m is no stretch of track", "Write the smaller place first"
        )
    return start, end


def _draw_scatter(p: ParameterSet, values: dict[str, np.ndarray], seed: int) -> None:
    scatter = p.optional_mapping_at("scatter").allow_only(*SUPPORT_UNITS)
    rng = np.random.default_rng(seed)
    for name in scatter:
        if name not in values:
            raise scatter.error(name, "scatter of a value that is not given", f"Give {name!r} in 'support'")
        sigma = np.sqrt(np.log1p(scatter.number(name, "-") ** 2))
        values[name] = values[name] * np.exp(sigma * rng.normal(size=values[name].size) - 0.5 * sigma**2)


def _stretches(
    p: ParameterSet, support: np.ndarray, elements: int, route: str, routes: tuple[str, ...]
) -> Iterator[RailStretch]:
    """Stretches of other rail on ``route``; one without the middle of an element has no effect and is rejected."""
    nodes = np.interp(np.arange(elements * (support.size - 1) + 1) / elements, np.arange(support.size), support)
    middle = 0.5 * (nodes[:-1] + nodes[1:])
    for entry in p.mappings_at("stretches"):
        start, end = _ends(entry.allow_only("from", "to", "rail", "route"))
        if start < support[-1] and end > support[0] and not np.any((middle >= start) & (middle < end)):
            problem = f"from {start:g} m to {end:g} m lies the middle of no element"
            raise entry.error(None, problem, f"Make it as long as an element, {nodes[1] - nodes[0]:g} m")
        if _route_of(entry, routes, route) == route:
            yield entry.build(RailStretch, start, end, _rail(entry.mapping_at("rail")))


def _rail(p: ParameterSet) -> Rail:
    p.allow_only(*RAIL_UNITS, "damping", "beam", "mass_matrix", "name")
    values = {name: p.number(name, unit) for name, unit in RAIL_UNITS.items()}
    bending = values["youngs_modulus"] * values["second_moment"]
    shear = values["shear_coefficient"] * values["shear_modulus"] * values["area"]
    rotary = values["density"] * values["second_moment"]
    damping = p.number("damping", "N s/m²", default=0.0)
    kinds = p.get("beam", "timoshenko"), p.get("mass_matrix", "consistent")
    return p.build(Rail, bending, values["mass"], shear, rotary, damping, *kinds)


def _support_values(
    p: ParameterSet, support: np.ndarray, route: str, routes: tuple[str, ...]
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Values of every support on ``route`` by name, (n,) each, and the label of its section."""
    base = p.mapping_at("support").allow_only(*SUPPORT_UNITS)
    names = [name for name in SUPPORT_UNITS if name in base or name in REQUIRED_VALUES]
    values = {name: np.full(support.size, base.number(name, SUPPORT_UNITS[name])) for name in names}
    section = ["" for _ in support]
    for entry in p.mappings_at("sections"):
        start, end = _ends(entry.allow_only("label", "panel", "from", "to", "route", *SUPPORT_UNITS))
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
    "blade_top": (BladeTop, {"start": "m", "length": "m", "depth": "m", "power": "-"}),
    "stock_fall": (StockFall, {"start": "m", "length": "m", "depth": "m", "power": "-"}),
    "corrugation": (Corrugation, {"start": "m", "end": "m", "amplitude": "m", "wavelength": "m"}),
}
OPTIONAL_KEYS = ("share", "power")


def _path_part(p: ParameterSet) -> PathPart:
    """One part of the path of a wheel."""
    part_type = p["kind"]
    if part_type == "sections":
        listed = [p.allow_only("kind", "places", "dips").list_at(name) for name in ("places", "dips")]
        return p.build(Sections, *(tuple(values.number(k, "m") for k in values) for values in listed))
    if part_type not in list(PATHS):
        raise p.error("kind", f"no path of kind {part_type!r}", f"Write one of sections, {', '.join(PATHS)}")
    part_class, units = PATHS[part_type]
    p.allow_only("kind", *units)
    return p.build(
        part_class,
        **{name: p.number(name, unit) for name, unit in units.items() if name in p or name not in OPTIONAL_KEYS},
    )
