"""Records from named variables, as npz, MATLAB and HDF5 files of this program and of other sources hold them.

What is recognised (names in any case, except ``t``):

* sampling rate or step: every name that ``rate_words`` recognises, also in nested groups, and a vector ``time``, ``t``;
* ``channels`` (or ``channel_names``, ``names``, ``labels``) and ``units``, one per channel;
* ``started_at`` (or ``start_time`` ...): ISO 8601 text, seconds since 1970 UTC, or a MATLAB datenum, one per file or
  per record;
* ``n_records``: the number of records that the file states; conditions under their names (``rail_temperature`` ...);
* samples, the first of these that fits:

  1. ``record_000``, ``record_001`` ... : one matrix or one group of variables each;
  2. a structure or group that holds the other variables, or several, each a record;
  3. one array: (record, channel, sample), (channel, sample) or (sample, channel). The channel axis is the one with
     the number of channels, the longer axis is that of the samples;
  4. vectors of equal length, each a channel with the name of its variable.

The names that loggers use in European languages are listed here in lower case, without accents, with "_" for blanks.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.entries import MAX_ENTRIES, Entry, entries_of
from turnout.readers.lazy import ARRAYS, Array, Column
from turnout.readers.rate_words import is_rate_name
from turnout.readers.scale_words import is_scale_name
from turnout.readers.source import CONDITIONS, RawFile, RawRecord, Source
from turnout.readers.start_times import start_fields
from turnout.readers.stated_scales import entry_statements, scale_problem, scale_statements, without_drawings
from turnout.readers.timing import seconds_since_first

RECORD_NAME = re.compile(r"^(?:record|rec|segment|impact|hit)[_ ]?(\d+)$", re.IGNORECASE)


def numbered_names(names: Iterable[str]) -> list[tuple[int, str]]:
    """Names of records, "record", "impact" ... with a number.

    Parameters
    ----------
    names : iterable of str
        Names of variables or groups.

    Returns
    -------
    list of tuple of (int, str)
        (number, name) of those that name a record, in the given order.

    Examples
    --------
    >>> numbered_names(["rate", "hit_02", "Record 10"])
    [(2, 'hit_02'), (10, 'Record 10')]
    """
    return [(int(m[1]), name) for name in names if (m := RECORD_NAME.match(name))]


def records_in_order(
    numbered: Iterable[tuple[int, str]], variables: Mapping[str, Any], source: Source
) -> Iterator[Any]:
    """Values of the records in the order of their numbers, None for a missing number.

    If the gaps outnumber the records, no record counts as missing: a clock or a counter numbered them.

    Parameters
    ----------
    numbered : iterable of tuple of (int, str)
        (number, name) of each record.
    variables : mapping of str to any
        Name -> value, the other variables included.
    source : Source
        The raw file.

    Yields
    ------
    any
        The value of each record in turn, None for a missing number.

    Raises
    ------
    ReadError
        If two names have the same number.
    """
    names: dict[int, list[str]] = {}
    for number, name in sorted(numbered):
        names.setdefault(number, []).append(name)
    first, last = min(names), max(names)
    is_dense = last - first + 1 <= 2 * len(names)
    for i, number in enumerate(range(first, last + 1) if is_dense else names):
        candidates = names.get(number, [])
        if len(candidates) > 1:
            problem = f"{' and '.join(map(repr, candidates))} are both number {number}"
            yield source.error(f"record {i + 1}", problem, "Number the records each by a number of its own")
        else:
            yield variables[candidates[0]] if candidates else None


def natural_sort_key(name: str) -> list[int | str]:
    """Key that sorts "record_2" before "record_10".

    Parameters
    ----------
    name : str
        Name with numbers in it.

    Returns
    -------
    list of int or str
        Its texts and numbers in turn.
    """
    return [int(piece) if piece.isdigit() else piece for piece in re.split(r"(\d+)", name)]


class Alphabetical(dict):
    """Variables of a file that sorts them alphabetically: their order carries no information."""


def match_units(names: Sequence[str], units: list[str], labels: Sequence[str], ordered: bool) -> list[str] | None:
    """Unit of each of ``names``: by the ``labels`` that belong to the units, else by order.

    Parameters
    ----------
    names : sequence of str
        Names of the channels.
    units : list of str
        Units that the file lists.
    labels : sequence of str
        Names that the file lists for these units; case does not matter.
    ordered : bool
        Whether the order of ``names`` is that of the file.

    Returns
    -------
    list of str or None
        One unit per name, "" if unknown; None if the units differ and nothing assigns them.

    Examples
    --------
    >>> match_units(["rail", "sleeper"], ["g", "m/s²"], ["Sleeper", "rail"], ordered=False)
    ['m/s²', 'g']
    >>> match_units(["rail", "sleeper"], ["g", "m/s²"], [], ordered=True)
    ['g', 'm/s²']
    >>> match_units(["rail", "sleeper"], ["g", "m/s²"], [], ordered=False)
    """
    plain_names, labels = [name.casefold() for name in names], [label.casefold() for label in labels]
    if len(labels) == len(set(labels)) == len(units) and set(plain_names) <= set(labels):
        return [units[labels.index(name)] for name in plain_names]
    if len(units) == 1:
        return units * len(names)
    if len(units) != len(names):
        return [""] * len(names)
    return units if ordered or len(set(units)) == 1 else None


START_NAMES = (
    "started_at", "start_time", "starttime", "wf_start_time", "startzeit", "startzeitpunkt", "messbeginn", "messstart",
    "beginn_der_messung", "heure_de_debut", "debut_de_mesure", "debut_de_la_mesure", "starttijd", "begintijd",
    "begin_meting", "zacatek_mereni", "cas_zacatku", "starttid", "starttidspunkt",
)  # fmt: skip
# The day of a start whose time of day is in a line of its own.
START_DATE_NAMES = ("start_date", "startdatum", "date_de_debut", "begindatum", "datum_zacatku", "startdato")
# Unlike n_samples, which counts per record, these may count the rows of the whole file.
SAMPLE_COUNT_NAMES = (
    "number_of_samples", "anzahl_messwerte", "anzahl_der_messwerte", "anzahl_werte", "anzahl_abtastwerte",
    "anzahl_samples", "anzahl_datenpunkte", "nombre_d_echantillons", "nombre_de_points", "aantal_samples",
    "aantal_meetwaarden", "aantal_meetpunten", "pocet_vzorku", "antal_samples", "antal_malepunkter",
    "antal_datapunkter",
)  # fmt: skip


TIME_NAMES = ("time", "t", "time_s")
CHANNEL_NAMES = ("channels", "channel_names", "names", "labels")
UNIT_NAMES = ("units", "unit", "channel_units")
ATTRIBUTES_MARK = " (attributes)"  # behind the name of a variable: the name of its attributes
STATED_SCALES = "(scales)"  # pairs (channel, statement about its scale) that a reader adds to the variables
RECORD_COUNT_NAMES = ("n_records", "n_record")
CONDITION_NAMES = {spelling: name for name in CONDITIONS for spelling in (name, name.replace("_", " "))}


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
        self.lower = {(k if k == "t" else k.lower()): v for k, v in variables.items() if k != "T"}
        self.variables, self.parent, self.source, self.place = variables, parent, source, place

    @cached_property
    def scale_facts(self) -> dict[str, Any]:
        """Variables of this group and its parent groups whose names speak of a scale; those of the group count."""
        own = {
            name: value
            for name, value in self.lower.items()
            if is_scale_name(name) and not _is_nested_text(value)  # nested
        }
        return {**(self.parent.scale_facts if self.parent else {}), **own}

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
            if (value := self.lower.get(name)) is not None:
                if isinstance(value, ReadError):
                    raise value
                return value
        return self.parent.get(names) if self.parent else None

    def record_value(self, names: Sequence[str], k: int, n: int) -> Any:
        """As ``get``, but entry ``k`` if there is one entry per record.

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
            As ``get``, but entry ``k`` if there is one entry per record.

        Raises
        ------
        ReadError
            If the variable is damaged.
        """
        value = self.get(names)
        if isinstance(value, np.ndarray) and value.ndim == 0:
            value = value[()]
        if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.ndim):
            value = np.ravel(np.asarray(value))
            value = value[k if value.size == n else 0] if value.size else None
        return value.item() if isinstance(value, np.generic) and value.dtype.kind != "M" else value

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
            As ``number``, but a whole number above 0.

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
        own = {
            name: value
            for name, value in self.variables.items()
            if not isinstance(value, Mapping) or 2 * _longest(value) < longest or not _holds_samples(value)
            if not isinstance(value, Attributes) or not _is_slow(self.variables.get(value.owner), value.owner, samples)
        }
        return (*entries_of(own, self.place), *(self.parent.entries if self.parent else ()))

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
            own = level.entries[: len(level.entries) - n_outer]
            nested += [e for e in own if ATTRIBUTES_MARK not in e.place and e.place.casefold() not in inner]
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
        present: set[str] = set()
        level: Metadata | None = self
        while level:
            present |= CONDITION_NAMES.keys() & level.lower.keys()
            level = level.parent
        names = sorted({CONDITION_NAMES[name] for name in present}, key=CONDITIONS.index)
        values = {name: single_value(self.get((name, name.replace("_", " "))), k, n) for name in names}
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
    return None if isinstance(value, (Mapping, *ARRAYS)) else value


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
    return [
        v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v).strip() for v in np.ravel(np.asarray(value))
    ]


def channel_names(facts: Metadata) -> list[str]:
    """Names of the channels in the metadata; a number there counts the channels, as in "Channels: 2".

    Parameters
    ----------
    facts : Metadata
        Metadata of the record.

    Returns
    -------
    list of str
        Empty without names.

    Raises
    ------
    ReadError
        If the variable is damaged.
    """
    value = facts.get(CHANNEL_NAMES)
    value = value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value
    is_number = isinstance(value, (int, float, np.number))
    is_count = is_number or (isinstance(value, str) and value.strip().isdecimal() and int(value) > 1)
    return [] if is_count else list_of_texts(value)


def raw_file(variables: Mapping, source: Source, parent: Metadata | None = None) -> RawFile:
    """Interpret named variables as records.

    Parameters
    ----------
    variables : mapping
        Name -> array, text, number, ReadError of a damaged value, or mapping of these.
    source : Source
        The raw file.
    parent : Metadata or None
        Metadata of the group that holds these variables.

    Returns
    -------
    RawFile
        All records, and the number of records that the file states.

    Raises
    ------
    ReadError
        If the variables do not say which arrays are the samples.
    """
    variables = _with_fields(variables)
    facts = Metadata(variables, source, parent)
    expected = facts.count(RECORD_COUNT_NAMES)
    numbered = numbered_names(variables)
    groups = [name for name, value in variables.items() if isinstance(value, Mapping) and _holds_samples(value)]
    if numbered:
        entries = [(value, f"record {i + 1}") for i, value in enumerate(records_in_order(numbered, variables, source))]
    elif groups and not vectors(variables) and not matrices(variables):
        if len(groups) == 1:
            return raw_file(variables[groups[0]], source, facts)
        entries = [(variables[name], f"group {name!r}") for name in sorted(groups, key=natural_sort_key)]
    else:
        group_records = tuple(_group_records(variables, facts, source))
        if not group_records and not expected and variables:
            raise source.error("the file", _problem_without_samples(variables), SAMPLES_REMEDY, reason="empty")
        return RawFile(group_records, expected)
    records = [
        _numbered_record(value, k, len(entries), where, facts, source) for k, (value, where) in enumerate(entries)
    ]
    of_records = {name for _, name in numbered}
    lost = tuple(v for name, v in variables.items() if isinstance(v, ReadError) and name not in of_records)
    return RawFile(tuple(records), expected, lost)


SAMPLES_REMEDY = (
    "Export each channel as a vector of real numbers, or all as one matrix; if the file should hold them, copy it again"
)
MAX_LISTED = 6  # variables that a message names


def _problem_without_samples(variables: Mapping[str, Any]) -> str:
    """What a file without samples holds."""
    listed = [
        f"{name!r} ({value.dtype} of shape {value.shape})" if isinstance(value, ARRAYS) else repr(name)
        for name, value in variables.items()
        if not isinstance(value, Attributes)
    ]
    more = f" and {len(listed) - MAX_LISTED} more" if len(listed) > MAX_LISTED else ""
    return f"it holds no record: no variable is an array of samples; there are {', '.join(listed[:MAX_LISTED])}{more}"


def _with_fields(variables: Mapping[str, Any]) -> Mapping[str, Any]:
    """The variables, with a group of its fields for each structured array."""
    if not any(_is_structured(value) for value in variables.values()):
        return variables
    return {n: {f: v[f] for f in v.dtype.names} if _is_structured(v) else v for n, v in variables.items()}


def _is_structured(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.names is not None and value.ndim == 1


class Attributes(dict):
    """Attributes of the variable ``owner``: metadata, never a group of samples.

    Parameters
    ----------
    owner : str
        Name of the variable.
    values : mapping of str to any
        Name -> value.
    """

    def __init__(self, owner: str, values: Mapping[str, Any]):
        super().__init__(values)
        self.owner = owner


def _is_slow(value: Any, name: str, samples: set[str]) -> bool:
    """Whether a variable is an array beside the samples, for example one that is sampled at a lower rate."""
    return isinstance(value, ARRAYS) and value.size > 1 and name not in samples and name.lower() not in TIME_NAMES


def _longest(value: Mapping) -> int:
    """Size of the largest array in a group or one of its groups."""
    sizes = (_longest(v) if isinstance(v, Mapping) else v.size if isinstance(v, ARRAYS) else 0 for v in value.values())
    return max(sizes, default=0)


def _holds_samples(value: Mapping) -> bool:
    """Whether a group or one of its groups holds samples, or a variable that cannot be read."""
    if isinstance(value, Attributes):
        return False
    return bool(vectors(value) or matrices(value)) or any(
        isinstance(v, ReadError) or (isinstance(v, Mapping) and _holds_samples(v)) for v in value.values()
    )


def _numbered_record(value: Any, k: int, n: int, where: str, facts: Metadata, source: Source) -> RawRecord | ReadError:
    """One numbered record, or its error."""
    try:
        if value is None:
            problem = "this record is missing between its neighbours"
            raise source.error(where, problem, reason="truncated")
        if isinstance(value, ReadError):
            raise value
        if not isinstance(value, Mapping):
            return _record(value, facts, k, n, where, source)
        if damaged := [v for v in value.values() if isinstance(v, ReadError)]:
            raise damaged[0]
        (record,) = _group_records(value, Metadata(value, source, facts), source, k, n)
        return record
    except ReadError as error:
        return error
    except ValueError as error:  # more than one record inside a numbered one
        return source.error(where, f"it is no single record ({error})", "Check how the file was exported")


def _group_records(
    variables: Mapping[str, Any], facts: Metadata, source: Source, k: int = 0, n: int = 1
) -> list[RawRecord]:
    """The records of a group whose variables are samples."""
    if damaged := [v for v in variables.values() if isinstance(v, ReadError)]:
        raise damaged[0]
    blocks_by_name = matrices(variables)
    if len(blocks_by_name) > 1:
        candidates = ", ".join(repr(name) for name in blocks_by_name)
        raise source.error(
            "the file", f"several arrays could be the samples: {candidates}", "Export one array or one per record"
        )
    for name, array in blocks_by_name.items():
        blocks = array if array.ndim == 3 else [array]
        if array.ndim == 3 and len(names := channel_names(facts)) and array.shape[1] != len(names):
            raise source.error(f"variable {name!r}", f"{array.shape} samples do not match {len(names)} channels")
        if array.ndim == 3 and array.shape[0] > array.shape[2]:  # MATLAB: (sample, channel, record)
            blocks = array.transpose(2, 1, 0)
        count = (k, n) if array.ndim == 2 else (0, len(blocks))
        return [_record(b, facts, count[0] + i, count[1], f"variable {name!r}", source) for i, b in enumerate(blocks)]
    channels = vectors(variables)
    if not channels:
        return []
    units = _units_of(channels, facts, not isinstance(variables, Alphabetical), f"record {k + 1}", source)
    return [_raw_record(tuple(channels), list(channels.values()), units, facts, k, n)]


def _units_of(channels: Mapping[str, Array], facts: Metadata, ordered: bool, where: str, source: Source) -> list[str]:
    """The unit of each variable that is a channel, "" if the file does not state it."""
    entry = facts.get(UNIT_NAMES)
    if isinstance(entry, Mapping):
        return [entry.get(name, "") for name in channels]
    units = match_units(list(channels), list_of_texts(entry), channel_names(facts), ordered)
    if units is None:
        problem = f"nothing says which of the units {', '.join(map(repr, list_of_texts(entry)))} are whose"
        remedy = "Write each dataset's unit beside it, or a list 'channels' of their names beside that of the units"
        raise source.error(where, problem, remedy, reason="unit_unknown")
    return units


def matrices(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Arrays that can be samples in two or three dimensions.

    Parameters
    ----------
    variables : mapping of str to any
        Name -> value of any type.

    Returns
    -------
    dict of str to any
        Those that are numeric arrays with at least two numbers along one axis.
    """
    arrays = {name: v for name, v in variables.items() if isinstance(v, ARRAYS) and v.dtype.kind in "fiu"}
    return {name: v for name, v in arrays.items() if v.ndim in (2, 3) and min(v.shape) >= 1 and max(v.shape) > 1}


def vectors(variables: Mapping[str, Any]) -> dict[str, Any]:
    """Vectors that can be channels; those much shorter than the longest are metadata, not samples.

    Parameters
    ----------
    variables : mapping of str to any
        Name -> value of any type.

    Returns
    -------
    dict of str to any
        Numeric vectors that are longer than half of the longest and have no name of metadata.
    """
    reserved_names = {
        *TIME_NAMES,
        *CHANNEL_NAMES,
        *UNIT_NAMES,
        *START_NAMES,
        *RECORD_COUNT_NAMES,
        *CONDITIONS,
    }
    candidates = {
        name: v
        for name, v in variables.items()
        if isinstance(v, ARRAYS) and v.ndim == 1 and v.dtype.kind in "fiu" and v.size > 1
        if name.lower() not in reserved_names and not (is_rate_name(name) and v.size <= MAX_ENTRIES)
    }
    longest = max((v.size for v in candidates.values()), default=0)
    return {name: v for name, v in candidates.items() if 2 * v.size > longest}


def _record(block: Any, facts: Metadata, k: int, n: int, where: str, source: Source) -> RawRecord:
    """The record of a matrix (channel, sample) or (sample, channel)."""
    block = np.atleast_2d(block) if isinstance(block, np.ndarray) else block
    names, units = channel_names(facts), list_of_texts(facts.get(UNIT_NAMES))
    if block.ndim != 2 or block.dtype.kind not in "fiu":
        raise source.error(where, f"{block.dtype} of shape {block.shape} is no matrix of samples")
    rows = len(names) or min(block.shape)
    if rows not in block.shape or (block.shape[0] == block.shape[1] and block.shape[0] > 1):
        raise source.error(where, f"{block.shape} samples do not match {rows} channels", "Correct the list of channels")
    block = block if block.shape[0] == rows else block.T
    names = names or [str(i) for i in range(rows)]
    units = units if len(units) == rows else [units[0] if len(units) == 1 else ""] * rows
    return _raw_record(names, list(block), units, facts, k, n)


def _raw_record(
    names: Sequence[str], samples: list[Column], units: Sequence[str], facts: Metadata, k: int, n: int
) -> RawRecord:
    time = facts.get(TIME_NAMES)
    time = np.asarray(time, dtype=float) if isinstance(time, np.ndarray) and time.size == len(samples[0]) else None
    clocks = {
        name: value
        for name, value in facts.variables.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "mM" and value.shape == (len(samples[0]),)
    }
    return RawRecord(
        names=tuple(names),
        samples=samples,
        clocks=tuple((f"variable {name!r}", seconds_since_first(value)) for name, value in clocks.items()),
        entries=facts.entries,
        units=tuple(units),
        **start_fields(facts.record_value(START_NAMES, k, n)),
        conditions=facts.conditions(k, n),
        time=time,
        undecided=_undecided_scales(names, facts),
    )


def _undecided_scales(names: Sequence[str], facts: Metadata) -> dict[int, str]:
    """Statements about the scale of channels, by index: of the group, its parents and the channels themselves."""
    texts = scale_statements(without_drawings(facts.scale_facts), len(names))
    problems = facts.nested_scales(names) | {i: scale_problem(text) for i, text in enumerate(texts) if text}
    by_name = dict(facts.get((STATED_SCALES,)) or ())
    return problems | {i: by_name[name] for i, name in enumerate(names) if name in by_name}
