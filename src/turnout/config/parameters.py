"""Parameter files of the simulation: YAML files in which every number has a unit and a source."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NoReturn, TypeVar

from turnout.config.document import Branch, Place
from turnout.config.schema import suggestion
from turnout.errors import ConfigError, SimulationError

T = TypeVar("T")
Key = str | int  # of a mapping, or of a list that is counted from 0
Entry = Any  # Number, ParameterSet, Entries, or any other value of YAML: the caller asks for what it expects
KEYS = {"value", "unit", "source", "prior", "note"}


@dataclass(frozen=True)
class Number:
    """A number in its SI unit with its source. ``prior`` is its relative standard deviation, None if measured."""

    value: float
    unit: str
    source: str
    prior: float | None = None

    def __float__(self) -> float:
        return self.value


class ParameterSet(Branch):
    """A mapping of a parameter file, whose keys know their lines, so that errors can name them.

    ``place`` has the path of the mapping within the file as its ``entry``.

    Parameters
    ----------
    place : Place
        Where the mapping starts; its ``entry`` is the path within the file.
    values : mapping or None
        Content: Number, ParameterSet, Entries or any other value of YAML.
    key_places : mapping or None
        Key -> where it stands.

    Examples
    --------
    >>> node = ParameterSet(Place("car.yaml", entry="bogie"), {"mass": Number(1500.0, "kg", "data sheet")})
    >>> node.number("mass", "kg"), node.number("length", "m", default=2.5)
    (1500.0, 2.5)
    """

    def __init__(self, place: Place, values: Mapping | None = None, key_places: Mapping | None = None) -> None:
        super().__init__(place)
        self.update(values or {})
        self.key_places.update(key_places or {})

    def error(self, key: Key | None, problem: str, remedy: str, below: Key = "") -> ConfigError:
        """An error at an entry of this mapping.

        Parameters
        ----------
        key : str, int or None
            Name of the entry; None: the mapping itself.
        problem : str
            What is wrong there.
        remedy : str
            What to write instead.
        below : str or int
            Key that gives the line of an error that names the whole mapping.

        Returns
        -------
        ConfigError
            The error; it is returned, not raised.
        """
        place = self.place if key is None else self.place.below(key, self.place_of(key))
        if below and (written := self.place_of(below)).path == place.path:
            place = replace(place, line=written.line)
        return place.error(problem, remedy)

    def __missing__(self, key: Key) -> NoReturn:
        raise self.error(None, f"the key {key!r} is missing", f"Give {key!r} there")

    def number(self, key: Key, unit: str, default: float | None = None) -> float:
        """Value of a number in its SI unit.

        Parameters
        ----------
        key : str or int
            Name of the entry, or its number in a list, from 0.
        unit : str
            SI unit.
        default : float or None
            Value of an absent entry; None: it must be there.

        Returns
        -------
        float
            In ``unit``.

        Raises
        ------
        ConfigError
            If the entry is missing, has no unit, or another one.
        """
        if key not in self and default is not None:
            return default
        entry = self[key]
        if not isinstance(entry, Number):
            raise self.error(key, f"{_describe_value(entry)} has no unit and source", "Write value, unit and source")
        if entry.unit != unit:
            raise self.error(key, f"the unit {entry.unit!r} is not one of {unit!r}", "Correct the unit")
        return entry.value

    def count(self, key: Key, default: int, minimum: int = 1) -> int:
        """A whole number without unit.

        Parameters
        ----------
        key : str or int
            Name of the entry, or its number in a list, from 0.
        default : int
            Value of an absent entry.
        minimum : int
            Smallest number that is allowed.

        Returns
        -------
        int
            The number.

        Raises
        ------
        ConfigError
            If it is no whole number of at least ``minimum``.
        """
        value = self.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool) or value < minimum:
            remedy = f"Write a whole number of at least {minimum}, without unit and source"
            raise self.error(key, f"{_describe_value(value)} is no such number", remedy)
        return value

    def mapping_at(self, key: Key) -> ParameterSet:
        """The mapping at ``key``.

        Parameters
        ----------
        key : str or int
            Name of the entry, or its number in a list, from 0.

        Returns
        -------
        ParameterSet
            The mapping.

        Raises
        ------
        ConfigError
            If the entry is missing or no mapping.
        """
        entry = self[key]
        if not isinstance(entry, ParameterSet):
            raise self.error(
                key, f"{_describe_value(entry)} instead of names with values", "Write 'name: value' lines below it"
            )
        return entry

    def optional_mapping_at(self, key: Key) -> ParameterSet:
        """The mapping at ``key``, an empty one if it is absent.

        Parameters
        ----------
        key : str or int
            Name of the entry, or its number in a list, from 0.

        Returns
        -------
        ParameterSet
            The mapping.

        Raises
        ------
        ConfigError
            If the entry is no mapping.
        """
        return ParameterSet(self.place) if self.get(key) is None else self.mapping_at(key)

    def list_at(self, key: Key) -> ParameterSet:
        """The list at ``key`` as a ParameterSet with the keys 0, 1, 2 ...; an empty one if it is absent.

        Parameters
        ----------
        key : str or int
            Name of the entry, or its number in a list, from 0.

        Returns
        -------
        ParameterSet
            The entries with their places.

        Raises
        ------
        ConfigError
            If the entry is no list.
        """
        entries = Entries() if self.get(key) is None else self[key]
        if not isinstance(entries, list):
            raise self.error(
                key, f"{_describe_value(entries)} instead of a list", "Write each entry with a dash before it"
            )
        places = dict(enumerate(entries.places)) if isinstance(entries, Entries) else {}
        return ParameterSet(self.place.below(key, self.place_of(key)), dict(enumerate(entries)), places)

    def mappings_at(self, key: Key) -> list[ParameterSet]:
        """The mappings listed at ``key``.

        Parameters
        ----------
        key : str or int
            Name of the entry, or its number in a list, from 0.

        Returns
        -------
        list of ParameterSet
            The mappings in their order; none if the entry is absent.

        Raises
        ------
        ConfigError
            If the entry is no list of mappings.
        """
        entries = self.list_at(key)
        return [entries.mapping_at(k) for k in entries]

    def build(self, factory: Callable[..., T], *values: Any, **named: Any) -> T:
        """Call a factory; its SimulationError becomes a ``ConfigError`` that names this place.

        Parameters
        ----------
        factory : callable
            Class or function of the simulation.
        *values : any
            Its arguments by position.
        **named : any
            Its arguments by name.

        Returns
        -------
        any
            Result of the factory.

        Raises
        ------
        ConfigError
            If the factory rejects a value.
        """
        try:
            return factory(*values, **named)
        except SimulationError as error:
            raise self.error(None, str(error).rstrip("."), "Correct the value") from None

    def allow_only(self, *allowed: str) -> ParameterSet:
        """Check that there is no unknown key.

        Parameters
        ----------
        *allowed : str
            Names of the keys.

        Returns
        -------
        ParameterSet
            The mapping itself.

        Raises
        ------
        ConfigError
            For a key that is not in ``allowed``.
        """
        for key in self:
            if key not in allowed:
                raise self.error(None, f"unknown key {key!r}", suggestion(str(key), allowed), key)
        return self

    def numbers(self) -> Iterator[tuple[str, Number]]:
        """(place, Number) of every number in this mapping and below."""
        for key, value in self.items():
            yield from _numbers(value, f"{self.place.entry}.{key}".lstrip("."))


class Entries(list):
    """A list of a parameter file; ``places`` are those of its entries.

    Parameters
    ----------
    values : iterable
        Entries: Number, ParameterSet, Entries or any other value of YAML.
    places : iterable of Place
        Where each entry stands.
    """

    def __init__(self, values: Iterable = (), places: Iterable[Place] = ()) -> None:
        super().__init__(values)
        self.places = tuple(places)


def _describe_value(value: Entry) -> str:
    """An entry as errors describe it."""
    if isinstance(value, Number):
        return f"{value.value:g} {value.unit}"
    return "a mapping" if isinstance(value, ParameterSet) else repr(value)


def _numbers(value: Entry, place: str) -> Iterator[tuple[str, Number]]:
    if isinstance(value, Number):
        yield place, value
    elif isinstance(value, ParameterSet):
        yield from value.numbers()
    elif isinstance(value, list):
        for k, item in enumerate(value):
            yield from _numbers(item, f"{place}[{k}]")
