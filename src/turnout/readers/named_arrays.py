"""Records from named variables, as npz, MATLAB and HDF5 files of this program and of other sources hold them.

What is recognised (names in any case, except ``t``):

* sampling rate or step: every name that ``rate_vocabulary`` recognises, also in nested groups, and a vector ``time``
  or ``t``;
* ``channels`` (or ``channel_names``, ``names``, ``labels``) and ``units``, one per channel;
* ``started_at`` (or ``start_time`` ...): ISO 8601 text, or a number that ``time_numbers`` recognises, one per file or
  per record;
* ``n_records``: the number of records that the file states; conditions under their names (``rail_temperature`` ...);
* samples, the first of these that fits:

  1. ``record_000``, ``record_001`` ... : one matrix or one group of variables each;
  2. a structure or group that holds the other variables, or several, each a record, or each a channel
     (``turnout.readers.channel_groups``);
  3. one array: (record, channel, sample), (channel, sample) or (sample, channel). The channel axis is the one with
     the number of channels, the longest axis is that of the samples; ``dims`` may state the axes (``array_axes``);
  4. a matrix for each channel, with a row for each record (``turnout.readers.channel_matrices``);
  5. vectors of equal length, each a channel with the name of its variable.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from turnout.counts import first_texts
from turnout.errors import ReadError
from turnout.readers.array_axes import axes_problem, with_records_first
from turnout.readers.array_metadata import Alphabetical, Metadata, list_of_texts
from turnout.readers.array_names import (
    channel_names,
    match_units,
    natural_sort_key,
    numbered_names,
    records_in_order,
    split_texts,
)
from turnout.readers.channel_groups import STATED_SCALES, with_channel_groups
from turnout.readers.channel_maps import kind_of
from turnout.readers.channel_matrices import with_records_of_channels
from turnout.readers.clock_texts import with_durations
from turnout.readers.column_forms import HEAD_SIZE, rises_evenly
from turnout.readers.entries import MAX_ENTRIES, UnreadObject
from turnout.readers.entry_owners import named_channels
from turnout.readers.lazy import ARRAYS, Array, Column
from turnout.readers.metadata_names import (
    RECORD_COUNT_NAMES,
    START_NAMES,
    TIME_NAMES,
    UNIT_NAMES,
)
from turnout.readers.metadata_subjects import STRONG, subject_of
from turnout.readers.record_columns import are_texts, numbers_of_texts
from turnout.readers.recording_versions import check_groups
from turnout.readers.sample_variables import Attributes, holds_samples, matrices, vectors
from turnout.readers.signal_structures import with_signal_structures
from turnout.readers.source import RawFile, RawRecord, Source
from turnout.readers.start_columns import start_in_columns
from turnout.readers.start_times import start_fields
from turnout.readers.stated_scales import scale_problem, scale_statements, without_drawings
from turnout.readers.time_texts import stated_time
from turnout.readers.timing import seconds_since_first
from turnout.readers.word_columns import check_valid, entries_of_words


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
    variables = with_channel_groups(with_signal_structures(_with_fields(variables), source))
    variables = with_records_of_channels(_with_vectors(_with_durations(variables, source)))
    facts = Metadata(variables, source, parent)
    expected = facts.count(RECORD_COUNT_NAMES)
    numbered = numbered_names(variables)
    groups = [name for name, value in variables.items() if isinstance(value, Mapping) and holds_samples(value)]
    _check_groups({name: variables[name] for name in groups}, source)
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


def _check_groups(groups: Mapping[str, Mapping[str, Any]], source: Source) -> None:
    names_by_channels: dict[frozenset[str], list[str]] = {}
    for name, group in groups.items():
        names_by_channels.setdefault(frozenset(vectors(group) | matrices(group)), []).append(name)
    for channels, names in names_by_channels.items():
        check_groups(names, sorted(channels), source)


SAMPLES_REMEDY = (
    "Export each channel as a vector of real numbers, or all as one matrix; if the file should hold them, copy it again"
)
MAX_LISTED = 6  # variables that a message names


def _problem_without_samples(variables: Mapping[str, Any]) -> str:
    """What a file without samples holds."""
    listed = [
        f"{name!r} ({value.dtype} of shape {value.shape})"
        if isinstance(value, ARRAYS)
        else f"{name!r} ({value})"
        if isinstance(value, UnreadObject)
        else repr(name)
        for name, value in variables.items()
        if not isinstance(value, Attributes)
    ]
    return f"it holds no record: no variable is an array of samples; there are {first_texts(listed, MAX_LISTED)}"


def _with_fields(variables: Mapping[str, Any]) -> Mapping[str, Any]:
    """The variables, with a group of its fields for each structured array."""
    if not any(_is_structured(value) for value in variables.values()):
        return variables
    return {n: {f: v[f] for f in v.dtype.names} if _is_structured(v) else v for n, v in variables.items()}


def _with_durations(variables: Mapping[str, Any], source: Source) -> Mapping[str, Any]:
    """The variables, with durations in place of texts that are the time of day of each sample."""
    changed = {
        name: with_durations(value, "variable", name, source)
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.size > MAX_ENTRIES and not _is_of_records(value, variables)
    }
    if all(variables[name] is value for name, value in changed.items()):
        return variables
    merged = {**variables, **changed}
    return Alphabetical(merged) if isinstance(variables, Alphabetical) else merged


def _is_of_records(array: np.ndarray, variables: Mapping[str, Any]) -> bool:
    """Whether a vector has one value for each record of an array (records, channels, samples)."""
    shapes = [v.shape for v in variables.values() if isinstance(v, ARRAYS) and v.ndim == 3]
    return any(shape[0] == array.size and array.size not in shape[1:] for shape in shapes)


def _with_vectors(variables: Mapping[str, Any]) -> Mapping[str, Any]:
    """The variables, with vectors for columns (n, 1) and rows (1, n); one alone stays a matrix of one channel."""
    flat = {name: v for name, v in matrices(variables).items() if v.ndim == 2 and min(v.shape) == 1}
    if len(flat) < 2 and not vectors(variables):
        return variables
    flat = {name: next(iter(v if v.shape[0] == 1 else v.T)) for name, v in flat.items()}
    changed = {name: flat.get(name, value) for name, value in variables.items()}
    return Alphabetical(changed) if isinstance(variables, Alphabetical) else changed


def _is_structured(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.names is not None and value.ndim == 1


VECTOR_REMEDY = "Save each channel as a vector, or as a structure with a vector 'data' beside its unit"


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
        value = with_channel_groups(value)
        if damaged := [v for v in value.values() if isinstance(v, ReadError)]:
            raise damaged[0]
        records = _group_records(value, Metadata(value, source, facts), source, k, n)
        if len(records) != 1:
            problem = (
                f"it holds {len(records)} records, in groups below it" if records else "it holds no vector of samples"
            )
            raise source.error(
                where, f"{problem}; in it are {', '.join(map(repr, list(value)[:MAX_LISTED]))}", VECTOR_REMEDY
            )
        return records[0]
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
        where = f"variable {name!r}"
        is_of_records = array.ndim == 3
        blocks = (
            with_records_first(array, len(channel_names(facts)), facts, where, source) if is_of_records else [array]
        )
        count = (k, n) if array.ndim == 2 else (0, len(blocks))
        problem = axes_problem(array, facts) if is_of_records else ""
        axes = {name: problem} if problem else {}
        records = [_record(b, facts, count[0] + i, count[1], where, source) for i, b in enumerate(blocks)]
        return [replace(record, undecided_axes=axes) for record in records]
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


def _record(block: Any, facts: Metadata, k: int, n: int, where: str, source: Source) -> RawRecord:
    """The record of a matrix (channel, sample) or (sample, channel)."""
    block = np.atleast_2d(block) if isinstance(block, np.ndarray) else block
    names, units = _names_and_units(facts, block.shape)
    if block.ndim != 2 or block.dtype.kind not in "fiu":
        raise source.error(where, f"{block.dtype} of shape {block.shape} is no matrix of samples")
    rows = len(names) or min(block.shape)
    if rows not in block.shape or (block.shape[0] == block.shape[1] and block.shape[0] > 1):
        raise source.error(where, f"{block.shape} samples do not match {rows} channels", "Correct the list of channels")
    block = block if block.shape[0] == rows else block.T
    names = names or [str(i) for i in range(rows)]
    units = units if len(units) == rows else [units[0] if len(units) == 1 else ""] * rows
    record = _raw_record(names, list(block), units, facts, k, n)
    counters = _vectors_of_whole_numbers(facts.variables, block.shape[1])
    record = replace(record, counters={**record.counters, **counters})
    axes = {} if record.time is not None else _axes(facts.variables, block.shape[1])
    if not axes:
        return record
    name, axis = next(iter(axes.items()))  # each variable of samples beside a matrix is no channel of it
    return replace(record, time=np.asarray(axis, dtype=float), time_label=name)


def _names_and_units(facts: Metadata, shape: tuple[int, ...]) -> tuple[list[str], list[str]]:
    """Names and units of the channels of a matrix, which the only group beside it with as many names may list, too."""
    described = [facts]
    if not channel_names(facts):
        groups = [Metadata(v, facts.source) for v in facts.variables.values() if isinstance(v, Mapping)]
        nested = [group for group in groups if len(channel_names(group)) in shape]
        described = nested if len(nested) == 1 else described
    return channel_names(described[0]), split_texts(list_of_texts(described[0].get(UNIT_NAMES)))


def _vectors_of_whole_numbers(variables: Mapping[str, Any], n_sample: int) -> dict[str, np.ndarray]:
    """The vectors beside a matrix with a whole number for each sample."""
    return {
        name: value
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.shape == (n_sample,)
        if (value == np.rint(value)).all()
    }


def _axes(variables: Mapping[str, Any], n_sample: int) -> dict[str, np.ndarray]:
    """The vectors of as many numbers as samples that rise evenly: times, unless a name speaks of something else."""
    return {
        name: value
        for name, value in variables.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiu" and value.shape == (n_sample,)
        if subject_of(name) != STRONG and rises_evenly(value[:HEAD_SIZE])
    }


def _raw_record(
    names: Sequence[str], samples: list[Column], units: Sequence[str], facts: Metadata, k: int, n: int
) -> RawRecord:
    time = facts.get(TIME_NAMES)
    is_time = isinstance(time, np.ndarray) and time.dtype.kind in "fiu" and time.size == len(samples[0])
    time = np.asarray(time, dtype=float) if is_time else None
    clocks = {
        name: value
        for name, value in facts.variables.items()
        if isinstance(value, np.ndarray) and value.dtype.kind in "mM" and value.shape == (len(samples[0]),)
    }
    words = {
        name: value
        for name, value in facts.variables.items()
        if isinstance(value, np.ndarray) and value.shape == (len(samples[0]),) and are_texts(value)
    }
    check_valid(words, facts.source)
    return RawRecord(
        names=tuple(names),
        samples=samples,
        clocks=tuple((f"variable {name!r}", seconds_since_first(value)) for name, value in clocks.items()),
        entries=(*facts.entries, *entries_of_words(words)) if words else facts.entries,
        units=tuple(units),
        **start_fields(facts.record_value(START_NAMES, k, n), declared=facts.label_of(START_NAMES)),
        axis_starts=(
            *(stated_time(value[0]) for value in clocks.values() if value.dtype.kind == "M"),
            start_in_columns(clocks),
        ),
        conditions=facts.conditions(k, n),
        time=time,
        time_label=facts.label_of(TIME_NAMES),
        undecided=_undecided_scales(names, facts),
        not_numbers=_not_numbers(facts.variables),
        counters={name: numbers_of_texts(value) for name, value in words.items()},
    )


def _not_numbers(variables: Mapping[str, Any]) -> dict[str, str | UnreadObject]:
    """What the variables hold that could be channels and are no real numbers, or too few."""
    arrays = {n: v for n, v in variables.items() if isinstance(v, ARRAYS) and v.size > MAX_ENTRIES}
    of_numbers = {n: v for n, v in arrays.items() if v.dtype.kind in "fiumM"}
    longest = max((v.size for v in of_numbers.values()), default=0)
    contents = {n: f"{kind_of(v.dtype)}, no real numbers" for n, v in arrays.items() if n not in of_numbers}
    shorter = {n: v.size for n, v in of_numbers.items() if v.ndim == 1 and v.size < longest}
    contents |= {n: f"{size} samples, and another channel {longest}" for n, size in shorter.items()}
    return contents | {n: v for n, v in variables.items() if isinstance(v, UnreadObject)}


def _undecided_scales(names: Sequence[str], facts: Metadata) -> dict[int, str]:
    """Statements about the scale of channels, by index: of the group, its parents and the channels themselves."""
    scale_facts = without_drawings(facts.scale_facts)
    owners = {name: named for name in scale_facts if (named := named_channels(name, names))}
    texts = scale_statements({n: v for n, v in scale_facts.items() if n not in owners}, len(names))
    if owners:  # "rail_scale" is that of one channel
        of_channels = [{n: scale_facts[n] for n, named in owners.items() if i in named} for i in range(len(names))]
        pairs = zip(texts, (scale_statements(of_channel)[0] for of_channel in of_channels))
        texts = tuple(", ".join(filter(None, pair)) for pair in pairs)
    problems = facts.nested_scales(names) | {i: scale_problem(text) for i, text in enumerate(texts) if text}
    by_name = dict(facts.get((STATED_SCALES,)) or ())
    return problems | {i: by_name[name] for i, name in enumerate(names) if name in by_name}
