"""Accepted effects of a track: read from the entries of its file and turned into physics terms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields
from typing import TYPE_CHECKING, Any

from turnout import physics
from turnout.config.events import day_problem
from turnout.config.parameters import Number
from turnout.errors import SimulationError
from turnout.simulate.links import SUPPORT_FIELDS
from turnout.stages.visit_time import years_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import numpy as np

    from turnout.config.parameters import ParameterSet
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.physics.term import Parameter
    from turnout.simulate import TurnoutTrack
    from turnout.simulate.track import Track

SUPPORT_KEYS = SUPPORT_FIELDS  # a file gives the support's position [m] instead of its number
ENTRY_METADATA = ("term", "accepted", "finding", "route")
SINCE = "since"  # key of an entry that is a change of the calibrated model, see ``accepted_changes``
ROUTES = ("main", "diverging")
MAX_SUPPORT_DISTANCE = 0.35  # m: positions closer than this are the same support
SUPPORT_SPACING = 0.6  # m between supports, usual


@dataclass(frozen=True)
class AcceptedEffect:
    """One entry of ``terms`` in a track's file.

    ``family`` is the name of the effect and ``fixed`` holds its fixed fields, positions of supports in m. ``values``
    maps a parameter to (value, standard error or None) in its own unit. ``route`` is the route that has it, "" for all.
    ``until`` is the time [years] of its acceptance, None of an entry that was made by hand.
    """

    family: str
    fixed: Mapping[str, Any]
    values: Mapping[str, tuple[float, float | None]]
    route: str = ""
    until: float | None = None

    @property
    def _effect(self) -> type[physics.PhysicsTerm]:
        return physics.effects_by_name()[self.family]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Fitted parameters of its term, with units, neutral values and bounds."""
        return tuple(p for p in self._effect.parameters if p.name in self.values)

    @property
    def place(self) -> float | None:
        """Mean position [m], of an effect between supports with the usual spacing; None without a position."""
        positions = [float(self.fixed[name]) for name in (*SUPPORT_KEYS, "place", "start", "end") if name in self.fixed]
        if not positions:
            return None
        return sum(positions) / len(positions) + float(self.fixed.get("beyond", 0.0)) * SUPPORT_SPACING

    @property
    def key(self) -> str:
        """Name of the effect with its position, channel and train, such as "hum[acc_1]"."""
        position = f"{self.place:.1f} m" if self.place is not None else ""
        qualifiers = [position, *(str(self.fixed[k]) for k in ("channel_name", "train") if self.fixed.get(k))]
        where = ",".join(p for p in qualifiers if p)
        return f"{self.family}[{where}]" if where else self.family

    @property
    def as_dict(self) -> dict:
        """The entry as plain values: effect, fixed fields (positions in m), parameters in their own units."""
        return {"term": self.family, **self.fixed, **{name: value for name, (value, _) in self.values.items()}}

    def is_on(self, route: str) -> bool:
        """Whether the effect applies to ``route``.

        Parameters
        ----------
        route : str
            Route through the turnout.

        Returns
        -------
        bool
        """
        return self.route in ("", route)

    def is_of(self, family: str, where: Mapping[str, Any]) -> bool:
        """Whether it is the effect ``family`` at the position, sensor or train in ``where``.

        Parameters
        ----------
        family : str
            Name of an effect.
        where : mapping
            Position, sensor or train of an effect.

        Returns
        -------
        bool
        """
        if family != self.family:
            return False
        position = where.get("place")
        if position is not None and self.place is not None and abs(position - self.place) > MAX_SUPPORT_DISTANCE:
            return False
        carriers = {"sensor": self.fixed.get("channel_name"), "train": self.fixed.get("train")}
        return all(where.get(k) in (None, v) for k, v in carriers.items())

    def term(self, track: Track, values: Mapping[str, float] | None = None) -> Any:
        """The physics term on a track of ``turnout.simulate``; None if no part of it lies on that track.

        Parameters
        ----------
        track : Track
            A track; by default that of the case.
        values : mapping of str to float or None
            Values of the parameters by their name.

        Returns
        -------
        Any
        """
        chosen = {name: value for name, (value, _) in self.values.items()} | dict(values or {})
        fixed_values: dict[str, Any] = {}
        if not self._reaches(track):
            return None
        for name, value in self.fixed.items():
            fixed_values[name] = int(track.nearest_support(value)) if name in SUPPORT_KEYS else value
        return self._effect(**fixed_values, **chosen)

    def lies_on(self, track: Track) -> bool:
        """Whether a part of the effect is on a whole track.

        Parameters
        ----------
        track : Track
            The track of a route.

        Returns
        -------
        bool
            True for an effect without a position.
        """
        place = self.fixed.get("place", track.start)
        start, end = self.fixed.get("start", place), self.fixed.get("end", place)
        is_inside = track.start <= place <= track.end and start <= track.end and end >= track.start
        return self._reaches(track) and is_inside

    def _reaches(self, track: Track) -> bool:
        """Whether at least one support of the effect is on the track."""
        low, high = float(track.support[0]) - MAX_SUPPORT_DISTANCE, float(track.support[-1]) + MAX_SUPPORT_DISTANCE
        if "first" in self.fixed and "last" in self.fixed:
            return self.fixed["first"] <= high and self.fixed["last"] >= low
        positions = [self.fixed[name] for name in SUPPORT_KEYS if name in self.fixed]
        return all(abs(float(track.support[track.nearest_support(x)]) - x) <= MAX_SUPPORT_DISTANCE for x in positions)


def accepted_of(entries: Iterable[ParameterSet]) -> tuple[AcceptedEffect, ...]:
    """Accepted effects of ``TurnoutTrack.terms``, without its accepted changes.

    Parameters
    ----------
    entries : iterable of ParameterSet
        Entries of ``terms``.

    Returns
    -------
    tuple of AcceptedEffect

    Raises
    ------
    SimulationError
        An entry has an unknown effect, field or route, or lacks a field.
    """
    return tuple(_effect_of_entry(entry) for entry in entries if SINCE not in entry)


def effects_of(turnout: TurnoutTrack) -> tuple[AcceptedEffect, ...]:
    """Accepted effects of a turnout, each of which lies on a route of its track and has possible values.

    Parameters
    ----------
    turnout : TurnoutTrack
        With the entries of its file.

    Returns
    -------
    tuple of AcceptedEffect

    Raises
    ------
    SimulationError
        As ``accepted_of``; an effect lies on no route that it applies to, so it would be left out; or a value is
        outside its bounds.
    """
    effects = accepted_of(turnout.terms)
    entries = [entry for entry in turnout.terms if SINCE not in entry]
    for entry, effect in zip(entries, effects):
        if problem := _off_track(effect, turnout) or _out_of_bounds(effect):
            raise SimulationError(f"{entry.place.path}, {entry.place.entry}: {problem}")
    return effects


def _off_track(effect: AcceptedEffect, turnout: TurnoutTrack) -> str:
    """Why an effect lies on no route that it applies to, "" if it lies on one."""
    tracks = [turnout.track_of(route) for route in turnout.routes if effect.is_on(route)]
    if any(effect.lies_on(track) for track in tracks):
        return ""
    extent = "".join(f", which goes from {track.start:.1f} to {track.end:.1f} m" for track in tracks[:1])
    return f"{effect.key} is on no route of the track{extent}. Correct its position or route."


def _out_of_bounds(effect: AcceptedEffect) -> str:
    """Which value of an effect is impossible, "" without one."""
    for p in effect.parameters:
        (value, _), (low, high) = effect.values[p.name], p.bounds
        if not low <= value <= high:
            unit = "" if p.unit == "-" else f" {p.unit}"
            return f"{effect.key}: {p.name} is {value:g}{unit}. Write {low:g} to {high:g}{unit}."
    return ""


def _effect_of_entry(entry: ParameterSet) -> AcceptedEffect:
    family, where = str(entry["term"]), f"{entry.place.path}, {entry.place.entry}"
    effects = physics.effects_by_name()
    if family not in effects:
        raise SimulationError(f"{where}: no effect {family!r}; there are {', '.join(sorted(effects))}.")
    parameters = {p.name: p for p in effects[family].parameters}
    effect_fields: tuple[Field, ...] = fields(effects[family])  # type: ignore[arg-type]  # every effect is a dataclass
    names = {f.name for f in effect_fields}
    fixed: dict[str, Any] = {}
    values: dict[str, tuple[float, float | None]] = {}
    for name in entry:
        if name in ENTRY_METADATA:
            continue
        if name not in names:
            raise SimulationError(f"{where}: {family} has no {name!r}; it has {', '.join(sorted(names))}.")
        entry_value = entry[name]
        if name in parameters:
            value = entry.number(name, parameters[name].unit)
            values[name] = value, entry_value.prior * abs(value) if entry_value.prior is not None else None
        else:
            fixed[name] = _fixed_value(entry, name)
    route = str(entry["route"]) if "route" in entry else ""
    if route not in ("", *ROUTES):
        raise SimulationError(f"{where}: no route {route!r}; there are {', '.join(ROUTES)}.")
    missing = names - set(fixed) - set(values) - {f.name for f in effect_fields if f.default is not MISSING}
    if missing:
        raise SimulationError(f"{where}: {family} needs {', '.join(sorted(missing))}.")
    if fixed.get("first", 0.0) > fixed.get("last", 0.0):
        raise SimulationError(f"{where}: {family} from {fixed['first']} m back to {fixed['last']} m.")
    return AcceptedEffect(family, fixed, values, route, _time_of_acceptance(entry, where))


def _time_of_acceptance(entry: ParameterSet, where: str) -> float | None:
    if "accepted" not in entry:
        return None
    text = str(entry["accepted"])
    if problem := day_problem(text):
        raise SimulationError(f"{where}: accepted is {text!r}{problem[0]}. {problem[1]}.")
    return years_of(text)


def _fixed_value(entry: ParameterSet, name: str) -> Any:
    """Value of a field that is not fitted: a position in m, or any other value unchanged."""
    entry_value = entry[name]
    if name in (*SUPPORT_KEYS, "place", "start", "end"):
        is_plain_number = isinstance(entry_value, int | float) and not isinstance(entry_value, bool)
        return entry_value if is_plain_number else entry.number(name, "m")
    return entry_value.value if isinstance(entry_value, Number) else entry_value


def terms_on(turnout: TurnoutTrack, track: Track, conditions: Mapping | None = None, route: str = "main") -> tuple:
    """Accepted terms of a turnout on a track, under the conditions of a recording.

    Parameters
    ----------
    turnout : TurnoutTrack
        With the entries of its file.
    track : Track
        The track of ``route``, or a stretch of it.
    conditions : mapping or None
        Of the recording.
    route : str
        Name of the route.

    Returns
    -------
    tuple of PhysicsTerm
    """
    terms = (entry.term(track) for entry in effects_of(turnout) if entry.is_on(route))
    return tuple(term.under_conditions(conditions or {}) for term in terms if term is not None)


def describe_term(term: Any, candidate: Candidate, standard_errors: Sequence[float] | np.ndarray, track: Track) -> dict:
    """A fitted term as plain data: effect, fixed fields (positions in m), parameters with errors and units.

    Parameters
    ----------
    term : PhysicsTerm
        The fitted term.
    candidate : Candidate
        The effect it tests.
    standard_errors : (n,) array of float
        Of the fitted parameters.
    track : Track
        The main track.

    Returns
    -------
    dict
        ``term``, ``fixed`` and ``parameters``; the ``position`` [m] of an effect between two supports, and
        ``rival_axles`` where other axles may have the effect instead.
    """
    fitted = {p.name: p for p in candidate.parameters}
    errors = dict(zip(fitted, standard_errors))
    fixed: dict[str, Any] = {}
    for f in fields(term):
        value = getattr(term, f.name)
        if f.name in fitted or (f.default is not MISSING and value == f.default):
            continue
        fixed[f.name] = round(float(track.support[value]), 3) if f.name in SUPPORT_KEYS else value
    parameters = {
        name: {"value": float(f"{getattr(term, name):.6g}"), "se": float(f"{errors[name]:.3g}"), "unit": p.unit}
        for name, p in fitted.items()
    }
    rivals = {"rival_axles": list(candidate.site.rival_axles)} if candidate.site.rival_axles else {}
    between = {"position": candidate.site.where["place"]} if getattr(term, "beyond", 0.0) else {}
    return {"term": candidate.family, "fixed": fixed, "parameters": parameters, **between, **rivals}
