"""Accepted effects of a track: read from the entries of its file and turned into physics terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

from turnout import physics
from turnout.config.parameters import Number
from turnout.errors import SimulationError
from turnout.simulate.links import COUNTED

SUPPORTS = COUNTED  # a file gives the support's position [m] instead of its number
# Effects of a wheelset do not belong in a track's file: the wheelset leaves with its train.
OF_A_WHEELSET = ("wheel_flat", "out_of_round")
KINDS: dict[str, Any] = {term.name: term for term in physics.TERMS}
NOT_FIELDS = ("term", "accepted", "finding", "route")
ROUTES = ("main", "diverging")
NEAR = 0.35  # m: positions closer than this are the same support


@dataclass(frozen=True)
class Accepted:
    """One entry of ``terms`` in a track's file.

    ``family`` is the name of the effect and ``fixed`` holds its fixed fields, positions of supports in m. ``values``
    maps a parameter to (value, standard error or None) in its own unit. ``route`` is the route that has it, "" for all.
    """

    family: str
    fixed: Mapping[str, Any]
    values: Mapping[str, tuple[float, float | None]]
    route: str = ""

    @property
    def parameters(self):
        """Fitted parameters of its term, with units, neutral values and bounds."""
        return tuple(p for p in KINDS[self.family].parameters if p.name in self.values)

    @property
    def place(self) -> float | None:
        """Mean position [m], None for an effect without a position."""
        found = [float(self.fixed[name]) for name in (*SUPPORTS, "place", "start", "end") if name in self.fixed]
        return sum(found) / len(found) if found else None

    @property
    def key(self) -> str:
        """Name of the effect with its position, channel and train, such as "hum[acc_1]"."""
        place = f"{self.place:.1f} m" if self.place is not None else ""
        parts = [place, *(str(self.fixed[k]) for k in ("channel_name", "train") if self.fixed.get(k))]
        where = ",".join(p for p in parts if p)
        return f"{self.family}[{where}]" if where else self.family

    @property
    def told(self) -> dict:
        """The entry as plain values: effect, fixed fields (positions in m), parameters in their own units."""
        return {"term": self.family, **self.fixed, **{name: value for name, (value, _) in self.values.items()}}

    def is_on(self, route) -> bool:
        """Whether the effect applies to ``route``."""
        return self.route in ("", route)

    def is_of(self, family, where) -> bool:
        """Whether it is the effect ``family`` at the position, sensor or train in ``where``."""
        if family != self.family:
            return False
        place = where.get("place")
        if place is not None and self.place is not None and abs(place - self.place) > NEAR:
            return False
        said = {"sensor": self.fixed.get("channel_name"), "train": self.fixed.get("train")}
        return all(where.get(k) in (None, v) for k, v in said.items())

    def term(self, track, values: Mapping[str, float] | None = None):
        """The physics term on a track of ``turnout.simulate``; None if no part of it lies on that track."""
        chosen = {name: value for name, (value, _) in self.values.items()} | dict(values or {})
        given: dict[str, Any] = {}
        if not self._reaches(track):
            return None
        for name, value in self.fixed.items():
            given[name] = int(track.nearest_support(value)) if name in SUPPORTS else value
        return KINDS[self.family](**given, **chosen)

    def _reaches(self, track):
        """Whether at least one support of the effect is on the track."""
        low, high = float(track.support[0]) - NEAR, float(track.support[-1]) + NEAR
        if "first" in self.fixed and "last" in self.fixed:
            return self.fixed["first"] <= high and self.fixed["last"] >= low
        places = [self.fixed[name] for name in SUPPORTS if name in self.fixed]
        return all(abs(float(track.support[track.nearest_support(x)]) - x) <= NEAR for x in places)


def accepted_of(entries) -> tuple[Accepted, ...]:
    """Accepted effects of ``TurnoutTrack.terms``; SimulationError for an unknown effect or field."""
    return tuple(_accepted(entry) for entry in entries)


def _accepted(entry) -> Accepted:
    family, where = str(entry["term"]), f"{entry.path}, {entry.place}"
    if family not in KINDS:
        raise SimulationError(f"{where}: no effect {family!r}; there are {', '.join(sorted(KINDS))}.")
    known = {p.name: p for p in KINDS[family].parameters}
    names = {f.name for f in fields(KINDS[family])}
    fixed: dict[str, Any] = {}
    values: dict[str, tuple[float, float | None]] = {}
    for name in entry:
        if name in NOT_FIELDS:
            continue
        if name not in names:
            raise SimulationError(f"{where}: {family} has no {name!r}; it has {', '.join(sorted(names))}.")
        found = entry[name]
        if name in known:
            value = entry.number(name, known[name].unit)
            values[name] = value, found.prior * abs(value) if found.prior is not None else None
        else:
            fixed[name] = _fixed(entry, name)
    route = str(entry["route"]) if "route" in entry else ""
    if route not in ("", *ROUTES):
        raise SimulationError(f"{where}: no route {route!r}; there are {', '.join(ROUTES)}.")
    missing = names - set(fixed) - set(values) - {f.name for f in fields(KINDS[family]) if f.default is not MISSING}
    if missing:
        raise SimulationError(f"{where}: {family} needs {', '.join(sorted(missing))}.")
    if fixed.get("first", 0.0) > fixed.get("last", 0.0):
        raise SimulationError(f"{where}: {family} from {fixed['first']} m back to {fixed['last']} m.")
    return Accepted(family, fixed, values, route)


def _fixed(entry, name):
    """Value of a field that is not fitted: a position in m, or any other value unchanged."""
    found = entry[name]
    if name in (*SUPPORTS, "place", "start", "end"):
        plain = isinstance(found, int | float) and not isinstance(found, bool)
        return found if plain else entry.number(name, "m")
    return found.value if isinstance(found, Number) else found


def terms_on(turnout, track, conditions: Mapping | None = None, route: str = "main") -> tuple:
    """Accepted terms of ``turnout``, a TurnoutTrack, on ``track``, under the conditions of a recording.

    ``track`` is the track of ``route`` or a stretch of it.
    """
    made = (entry.term(track) for entry in accepted_of(turnout.terms) if entry.is_on(route))
    return tuple(term.under(conditions or {}) for term in made if term is not None)


def described(term, candidate, standard_errors, track) -> dict:
    """A fitted term as plain data: effect, fixed fields (positions in m), parameters with errors and units."""
    fitted = {p.name: p for p in candidate.parameters}
    errors = dict(zip(fitted, standard_errors))
    fixed: dict[str, Any] = {}
    for f in fields(term):
        value = getattr(term, f.name)
        if f.name in fitted or (f.default is not MISSING and value == f.default):
            continue
        fixed[f.name] = round(float(track.support[value]), 3) if f.name in SUPPORTS else value
    parameters = {
        name: {"value": float(f"{getattr(term, name):.6g}"), "se": float(f"{errors[name]:.3g}"), "unit": p.unit}
        for name, p in fitted.items()
    }
    return {"term": candidate.family, "fixed": fixed, "parameters": parameters}
