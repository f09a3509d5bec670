"""Effects that recordings showed to be missing from a track: as entries of its file, and as terms of physics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

from turnout import physics
from turnout.config.parameters import Number
from turnout.errors import SimulationError
from turnout.simulate.links import COUNTED

SUPPORTS = COUNTED  # in a file the support's place [m] stands for its number
# Effects that belong to a wheelset: it leaves with its train, the track's file is no place for it.
OF_A_WHEELSET = ("wheel_flat", "out_of_round")
KINDS: dict[str, Any] = {term.name: term for term in physics.TERMS}
NOT_FIELDS = ("term", "accepted", "finding", "route")
ROUTES = ("main", "diverging")
NEAR = 0.35  # two places closer than this [m] are one support


@dataclass(frozen=True)
class Accepted:
    """One entry of ``terms``: ``family`` of the effect, ``fixed`` fields (places of supports in m), ``values``
    parameter -> (value, standard error or None) in the parameter's own unit, ``route`` whose track has it, "" for
    all."""

    family: str
    fixed: Mapping[str, Any]
    values: Mapping[str, tuple[float, float | None]]
    route: str = ""

    @property
    def parameters(self):
        """The parameters of its term that were fitted, with units, neutral values and bounds."""
        return tuple(p for p in KINDS[self.family].parameters if p.name in self.values)

    @property
    def place(self) -> float | None:
        """Where it is [m], None where it has no place."""
        found = [float(self.fixed[name]) for name in (*SUPPORTS, "place", "start", "end") if name in self.fixed]
        return sum(found) / len(found) if found else None

    @property
    def key(self) -> str:
        """Family and what it is fixed to, in one word."""
        place = f"{self.place:.1f} m" if self.place is not None else ""
        parts = [place, *(str(self.fixed[k]) for k in ("channel_name", "train") if self.fixed.get(k))]
        where = ",".join(p for p in parts if p)
        return f"{self.family}[{where}]" if where else self.family

    @property
    def told(self) -> dict:
        """The entry in plain numbers: family, fixed fields with places in m, parameters in their own units."""
        return {"term": self.family, **self.fixed, **{name: value for name, (value, _) in self.values.items()}}

    def is_on(self, route) -> bool:
        """Whether the track under ``route`` has it."""
        return self.route in ("", route)

    def is_of(self, family, where) -> bool:
        """Whether it is the effect ``family`` at the place, sensor or train in ``where``."""
        if family != self.family:
            return False
        place = where.get("place")
        if place is not None and self.place is not None and abs(place - self.place) > NEAR:
            return False
        said = {"sensor": self.fixed.get("channel_name"), "train": self.fixed.get("train")}
        return all(where.get(k) in (None, v) for k, v in said.items())

    def term(self, track, values: Mapping[str, float] | None = None):
        """The term on a track of ``turnout.simulate``, of a range what lies on that track; None where nothing does."""
        chosen = {name: value for name, (value, _) in self.values.items()} | dict(values or {})
        given: dict[str, Any] = {}
        if not self._reaches(track):
            return None
        for name, value in self.fixed.items():
            given[name] = int(track.nearest_support(value)) if name in SUPPORTS else value
        return KINDS[self.family](**given, **chosen)

    def _reaches(self, track):
        """Whether any support of the effect is on the track."""
        low, high = float(track.support[0]) - NEAR, float(track.support[-1]) + NEAR
        if "first" in self.fixed and "last" in self.fixed:
            return self.fixed["first"] <= high and self.fixed["last"] >= low
        places = [self.fixed[name] for name in SUPPORTS if name in self.fixed]
        return all(abs(float(track.support[track.nearest_support(x)]) - x) <= NEAR for x in places)


def accepted_of(entries) -> tuple[Accepted, ...]:
    """Entries of ``TurnoutTrack.terms``; SimulationError where one names no effect or a field it has not."""
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
    """Value of a field that is not fitted: a place in m, with its unit or without; anything else as it stands."""
    found = entry[name]
    if name in (*SUPPORTS, "place", "start", "end"):
        plain = isinstance(found, int | float) and not isinstance(found, bool)
        return found if plain else entry.number(name, "m")
    return found.value if isinstance(found, Number) else found


def terms_on(turnout, track, conditions: Mapping | None = None, route: str = "main") -> tuple:
    """Accepted terms of a ``TurnoutTrack`` on its track under ``route``, or a stretch of it, under a recording's
    conditions."""
    made = (entry.term(track) for entry in accepted_of(turnout.terms) if entry.is_on(route))
    return tuple(term.under(conditions or {}) for term in made if term is not None)


def described(term, candidate, standard_errors, track) -> dict:
    """A fitted term as plain data: family, fixed fields with places in m, fitted parameters with errors and units."""
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
