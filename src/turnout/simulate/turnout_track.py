"""A turnout as the simulation knows it: the track, and what a wheel rolls on along each of its routes."""

from dataclasses import dataclass, field, replace

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.rail import Rail
from turnout.simulate.roughness import roughness
from turnout.simulate.track import PER_SUPPORT, RailStretch, Track
from turnout.simulate.wheel_path import Corrugation, Cosine, Dip, Kink, Sections


@dataclass(frozen=True)
class TurnoutTrack:
    """``track`` with its ``routes``: name -> surfaces, each the parts of a wheel's path along it.

    ``roughness_level`` [dB above the limit curve of ISO 3095], None for a smooth rail. ``locations`` are named
    (place [m], route); ``numbers`` the parameters with unit, source and prior as read. ``tracks`` holds the track
    of a route that has rails of its own, as behind a crossing. ``terms`` are the entries of effects that recordings
    showed to be missing from the base track, as read; ``turnout.chains.accepted_terms`` makes terms of them.
    """

    track: Track
    routes: dict = field(default_factory=lambda: {"main": ((),)})
    roughness_level: float | None = None
    locations: dict = field(default_factory=dict)
    numbers: tuple = ()
    tracks: dict = field(default_factory=dict)
    terms: tuple = ()

    @property
    def name(self):
        """Name of the track."""
        return self.track.name

    def track_of(self, route):
        """The track under ``route``."""
        return self.tracks.get(route, self.track)

    def parts_at(self, place):
        """Whether the routes have supports of their own at ``place`` [m], as behind a crossing."""
        return len({track.section[track.nearest_support(place)] for track in self.tracks.values()}) > 1

    def surfaces(self, route):
        """Surfaces of ``route``; an unknown one is a SimulationError."""
        if route not in self.routes:
            raise SimulationError(f"{self.name}: no route {route!r}; there are {', '.join(self.routes)}.")
        return self.routes[route]

    def rolling(self, start, end, seed, level=None):
        """The roughness part between two places, () for a smooth rail."""
        level = self.roughness_level if level is None else level
        return () if level is None else (roughness(start, end, seed, level),)

    def with_track(self, **changes):
        """The same turnout with some fields of its track changed."""
        tracks = {name: replace(track, **changes) for name, track in self.tracks.items()}
        return replace(self, track=replace(self.track, **changes), tracks=tracks)


def stretch_of_track(track, place, half_length=30.0):
    """The track within ``half_length`` [m] of ``place``, for a hammer test that needs no more."""
    keep = np.abs(track.support - place) <= half_length
    if keep.sum() < 3:
        raise SimulationError(f"{track.name}: no three supports within {half_length} m of {place} m.")
    values = {name: getattr(track, name)[keep] for name in PER_SUPPORT}
    section = tuple(s for s, k in zip(track.section, keep) if k)
    return replace(track, support=track.support[keep], section=section, **values)


RAIL_KEYS = (
    "youngs_modulus",
    "second_moment",
    "area",
    "mass",
    "shear_modulus",
    "shear_coefficient",
    "density",
    "damping",
    "beam",
    "name",
)
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
    """``TurnoutTrack`` from a parameter set read by ``turnout.config.parameter_set.read_parameters``.

    ``sections`` change values of ``support`` between ``from`` and ``to`` [m], later ones over earlier ones;
    ``scatter`` gives relative standard deviations that are drawn, log-normally, with ``seed``.
    """
    p = parameters.only(*TRACK_KEYS)
    routes = {name: _route(route) for name, route in (p.get("routes") or {}).items()} or {"main": ((),)}
    tracks = {name: _track(p, name, seed) for name in routes}
    first = next(iter(routes))
    locations = {
        name: (value.number("place", "m"), value.get("route", first))
        for name, value in (p.get("locations") or {}).items()
    }
    rough = p.get("roughness")
    level = rough.number("level", "dB", default=0.0) if rough else None
    return TurnoutTrack(
        tracks[first], routes, level, locations, tuple(p.numbers()), tracks, tuple(p.get("terms") or ())
    )


def _track(p, route, seed):
    extent = p["extent"]
    start, end, spacing = extent.number("from", "m"), extent.number("to", "m"), p.number("spacing", "m")
    support = start + spacing * np.arange(round((end - start) / spacing) + 1)
    values, section = _support_values(p, support, route)
    rng = np.random.default_rng(seed)
    for name, relative in (p.get("scatter") or {}).items():
        sigma = np.sqrt(np.log1p(relative.value**2))
        values[name] = values[name] * np.exp(sigma * rng.normal(size=support.size) - 0.5 * sigma**2)
    absorbing = p.get("absorbing_end")
    stretches = [
        RailStretch(s.number("from", "m"), s.number("to", "m"), _rail(s["rail"]))
        for s in p.get("stretches") or ()
        if s.get("route", route) == route
    ]
    return Track(
        _rail(p["rail"]),
        support,
        **values,
        layers=p.get("layers", 2),
        elements_per_bay=p.get("elements_per_bay", 4),
        pad_width=p.number("pad_width", "m") if "pad_width" in p else 0.0,
        stretches=tuple(stretches),
        end_length=absorbing.number("length", "m") if absorbing else 0.0,
        end_damping=absorbing.number("rate", "1/s") if absorbing else 0.0,
        section=tuple(section),
        name=str(p["name"]),
    )


def _rail(p):
    p.only(*RAIL_KEYS)
    e, i = p.number("youngs_modulus", "Pa"), p.number("second_moment", "m⁴")
    shear = p.number("shear_coefficient", "-") * p.number("shear_modulus", "Pa") * p.number("area", "m²")
    rotary = p.number("density", "kg/m³") * i
    damping = p["damping"].value if "damping" in p else 0.0
    return Rail(e * i, p.number("mass", "kg/m"), shear, rotary, damping, p.get("beam", "timoshenko"))


def _support_values(p, support, route):
    base = p["support"].only(*SUPPORT_UNITS)
    values = {
        name: np.full(support.size, base.number(name, unit)) for name, unit in SUPPORT_UNITS.items() if name in base
    }
    section = ["" for _ in support]
    for entry in p.get("sections") or ():
        entry.only("label", "panel", "from", "to", "route", *SUPPORT_UNITS)
        if entry.get("route", route) != route:
            continue
        inside = (support >= entry.number("from", "m")) & (support < entry.number("to", "m"))
        for j in np.flatnonzero(inside):
            section[j] = str(entry["label"])
        for name, unit in SUPPORT_UNITS.items():
            if name in entry:
                values.setdefault(name, np.zeros(support.size))[inside] = entry.number(name, unit)
    return values, section


PARTS = {
    "dip": (Dip, {"place": "m", "depth": "m", "length": "m"}),
    "cosine": (Cosine, {"place": "m", "depth": "m", "length": "m"}),
    "kink": (Kink, {"place": "m", "depth": "m", "length": "m", "share": "-"}),
    "corrugation": (Corrugation, {"start": "m", "end": "m", "amplitude": "m", "wavelength": "m"}),
}


def _route(route):
    """Surfaces of a route: its ``common`` parts on each of its ``surfaces``, or on one."""
    if isinstance(route, list):
        return (tuple(_part(part) for part in route),)
    common = tuple(_part(part) for part in route.get("common") or ())
    return tuple((*common, *(_part(part) for part in surface)) for surface in route["surfaces"])


def _part(p):
    kind = p["kind"]
    if kind == "sections":
        return Sections(tuple(v.value for v in p["places"]), tuple(v.value for v in p["dips"]))
    if kind not in PARTS:
        raise SimulationError(f"{p.path}, {p.place}: no path of kind {kind!r}; there are sections, {', '.join(PARTS)}.")
    made, units = PARTS[kind]
    return made(**{name: p.number(name, unit) for name, unit in units.items() if name in p})
