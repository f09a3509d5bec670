"""Metadata of named variables: entries of a group and of its parents."""

import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.entries import Entry, UnreadObject, entries_of
from turnout.readers.lazy import ARRAYS
from turnout.readers.metadata_names import (
    ATTRIBUTES_MARK,
    UNIT_NAMES,
)
from turnout.readers.sample_variables import (
    Attributes,
    holds_samples,
    is_slow,
    matrices,
    plain_name,
    size_of_longest,
    underscored_name,
    vectors,
)
from turnout.readers.scale_vocabulary import is_scale_name
from turnout.readers.source import CONDITIONS, Source
from turnout.readers.stated_scales import entry_statements
from turnout.readers.texts import decode_text
from turnout.readers.time_texts import time_of_vector

WORD_START = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")  # in "ChannelNames"


class Alphabetical(dict):
    """Variables of a file that sorts them alphabetically: their order carries no information."""


class Metadata:
    """Metadata of the samples of a group of variables; missing entries are taken from the ``parent`` group.

    Parameters
    ----------
    variables : mapping
        Names and values of the group; upper and lower case count as equal, except for "t".
    source : Source
        The raw file.
    parent : Metadata or None
        Metadata of the group above.
    place : str
        Name of the group, for messages.
    """

    def __init__(self, variables: Mapping, source: Source, parent: "Metadata | None" = None, place: str = ""):
        self.lower = {plain_name(k): v for k, v in variables.items()}
        of_parts = {underscored_name(plain_name(WORD_START.sub("_", k))): v for k, v in reversed([*variables.items()])}
        of_names = {underscored_name(k): v for k, v in reversed(self.lower.items())}
        self.underscored = {**of_parts, **of_names, **self.lower}
        self.variables, self.parent, self.source, self.place = variables, parent, source, place

    @cached_property
    def scale_facts(self) -> dict[str, Any]:
        """Variables of this group and its parent groups whose names speak of a scale; those of the group count."""
        of_group = {
            name: value
            for name, value in self.lower.items()
            if is_scale_name(name) and not _is_nested_text(value)  # nested
        }
        return {**(self.parent.scale_facts if self.parent else {}), **of_group}

    def get(self, names: Sequence[str]) -> Any:
        """The first variable of ``names``, here or in a parent group; ReadError if it is damaged.

        Parameters
        ----------
        names : sequence of str
            Spellings of one entry, in lower case.

        Returns
        -------
        any
            Value of the first spelling that exists, here or in a parent group; None without one.

        Raises
        ------
        ReadError
            If the variable is damaged.
        """
        for name in names:
            if (value := self.underscored.get(name)) is not None:
                if isinstance(value, ReadError):
                    raise value
                return value
        return self.parent.get(names) if self.parent else None

    def record_value(self, names: Sequence[str], k: int, n: int) -> Any:
        """As ``get``, but entry ``k`` if there is one entry per record; a date vector is one entry.

        Parameters
        ----------
        names : sequence of str
            Spellings of one entry, in lower case.
        k : int
            Number of the record, from 0.
        n : int
            Number of records.

        Returns
        -------
        any

        Raises
        ------
        ReadError
            If the variable is damaged.
        """
        value = self.get(names)
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        rows = value if isinstance(value, np.ndarray) and value.ndim == 2 and len(value) == n else [value] * n
        if time := time_of_vector(rows[k]):
            return time
        if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim):
            value = np.ravel(np.asarray(value))
            value = value[k if value.size == n else 0] if value.size else None
        return value.item() if isinstance(value, np.generic) and value.dtype.kind != "M" else value

    def label_of(self, names: Sequence[str]) -> str:
        """Name of the first variable of ``names``, with the unit that its attributes or a variable beside it state.

        Parameters
        ----------
        names : sequence of str
            Spellings of one entry, in lower case.

        Returns
        -------
        str
            "start_time [s since 1904-01-01]"; "" without such a variable.
        """
        for name in (n for n in names if self.underscored.get(n) is not None):
            of_name = self.underscored.get(underscored_name(name + ATTRIBUTES_MARK))
            attributes = {k.lower(): v for k, v in dict(of_name or {}).items()}
            beside = [self.underscored.get(f"{name}_{word}") for word in UNIT_NAMES[:2]]
            unit = next((v for v in (*map(attributes.get, UNIT_NAMES), *beside) if isinstance(v, str)), "")
            return f"{name} [{unit}]" if unit.strip() else name
        return self.parent.label_of(names) if self.parent else ""

    def number(self, names: Sequence[str], k: int = 0, n: int = 1) -> float | None:
        """As ``record_value``, but a float; ReadError if it is no number.

        Parameters
        ----------
        names : sequence of str
            Spellings of one entry, in lower case.
        k : int
            Number of the record, from 0.
        n : int
            Number of records.

        Returns
        -------
        float or None
            As ``record_value``, but a float.

        Raises
        ------
        ReadError
            If it is no number.
        """
        value = self.record_value(names, k, n)
        try:
            return None if value is None else float(value)
        except (TypeError, ValueError) as error:
            raise self.source.error(f"variable {names[0]!r}", f"{value!r} is no number") from error

    def count(self, names: Sequence[str], k: int = 0, n: int = 1) -> int | None:
        """As ``number``, but a whole number above 0.

        Parameters
        ----------
        names : sequence of str
            Spellings of one entry, in lower case.
        k : int
            Number of the record, from 0.
        n : int
            Number of records.

        Returns
        -------
        int or None

        Raises
        ------
        ReadError
            If it is no such number.
        """
        value = self.number(names, k, n)
        if value is None or (1 <= value < 2**53 and value == int(value)):
            return None if value is None else int(value)
        raise self.source.error(f"variable {names[0]!r}", f"{value!r} is no whole number above 0")

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All metadata of the group and of its parents, with their places; records beside this one take no part."""
        samples = {*vectors(self.variables), *matrices(self.variables)}
        longest = max((self.variables[name].size for name in samples), default=0)
        of_group = {
            name: value
            for name, value in self.variables.items()
            if not isinstance(value, Mapping) or 2 * size_of_longest(value) < longest or not holds_samples(value)
            if not isinstance(value, Attributes) or not is_slow(self.variables.get(value.owner), value.owner, samples)
        }
        return (*entries_of(of_group, self.place), *(self.parent.entries if self.parent else ()))

    def nested_scales(self, names: Sequence[str]) -> dict[int, str]:
        """Problems about scales that nested metadata state; attributes of single variables take no part.

        An entry of a parent group does not count if this group has one in the same place.

        Parameters
        ----------
        names : sequence of str
            Names of the channels.

        Returns
        -------
        dict of int to str
            Index of the channel -> problem.
        """
        level: Metadata | None = self
        nested: list[Entry] = []
        while level:
            inner = {entry.place.casefold() for entry in nested}
            n_outer = len(level.parent.entries) if level.parent else 0
            of_level = level.entries[: len(level.entries) - n_outer]
            nested += [e for e in of_level if ATTRIBUTES_MARK not in e.place and e.place.casefold() not in inner]
            level = level.parent
        direct = set(self.scale_facts)  # judged by the group itself
        return entry_statements((e for e in nested if e.place.casefold() not in direct), names)

    def conditions(self, k: int, n: int) -> dict[str, Any]:
        """Conditions that are stored with the samples.

        Parameters
        ----------
        k : int
            Number of the record, from 0.
        n : int
            Number of records.

        Returns
        -------
        dict of str to any
            Name -> value of the conditions that are stored with the samples of record ``k``.
        """
        values = {name: single_value(self.get((name,)), k, n) for name in CONDITIONS}
        return {name: value for name, value in values.items() if value is not None}


def single_value(value: Any, k: int, n: int) -> Any:
    """The value of record ``k`` of an entry that a typed format may store as an array or a list.

    Parameters
    ----------
    value : any
        The entry as a library returns it.
    k : int
        Number of the record, from 0.
    n : int
        Number of records.

    Returns
    -------
    any
        A number, a text or None; of several different values that are not one per record the array or the list itself;
        None for a group and an array that stays in the file.

    Examples
    --------
    >>> [single_value(v, 1, 2) for v in (12.5, [12.5], [12.5, 13.0], [1, 2, 3], {"side": "left"})]
    [12.5, 12.5, 13.0, [1, 2, 3], None]
    """
    if isinstance(value, np.generic):
        return value.item() if value.dtype.kind != "M" else value
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return single_value(value[()], k, n)
    if isinstance(value, (list, tuple, np.ndarray)):
        values = value.ravel() if isinstance(value, np.ndarray) else value
        if len(values) == n or (len(values) and all(np.array_equal(v, values[0]) for v in values[1:])):
            return single_value(values[k if len(values) == n else 0], k, 1)
        return value if len(values) else None
    return None if isinstance(value, (Mapping, UnreadObject, *ARRAYS)) else value


def _is_nested_text(value: Any) -> bool:
    """Whether a value is the text of a JSON mapping, whose entries are judged each by itself."""
    is_text = isinstance(value, str) or (isinstance(value, np.ndarray) and value.size == 1 and value.dtype.kind == "U")
    return is_text and str(np.ravel(value)[0]).lstrip().startswith("{")


def list_of_texts(value: Any) -> list[str]:
    """A list of texts from the form in which a library returns it.

    Parameters
    ----------
    value : any
        Text, bytes, a list or an array of these, or None.

    Returns
    -------
    list of str
        The texts without blanks around them; empty for None.
    """
    if value is None:
        return []
    if isinstance(value, (str, bytes)):
        value = [value]
    return [decode_text(v) if isinstance(v, bytes) else str(v).strip() for v in np.ravel(np.asarray(value))]
