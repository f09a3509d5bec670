"""Reader of Universal File Format 58 and 58b: time responses as records, frequency responses with ``read_frf``."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from turnout.errors import ReadError
from turnout.readers.entries import FREE_TEXT, Entry, entries_of_text, step_entry
from turnout.readers.lazy import Column, LazyColumn
from turnout.readers.rate_units import hertz_of, rate_unit
from turnout.readers.record_columns import missing_record
from turnout.readers.source import CONDITIONS, COPY_AGAIN, RawFile, RawRecord, Source, load, number_or_text
from turnout.readers.stated_quantities import DEFINED_NAME
from turnout.readers.stated_scales import entry_statements
from turnout.readers.stated_units import is_meaningless, known_unit
from turnout.readers.time_texts import is_unread_uff_time, parse_time, parse_uff_time
from turnout.readers.timing import check_simultaneous
from turnout.readers.uff_datasets import FileUnits, UffDataset, file_units, read_datasets
from turnout.readers.uff_pairing import DIRECTIONS, PAIRING_REMEDY, ChannelKey, Pairing, channel_name, pair_sets
from turnout.units import UNITS, conversion

PROMISED_RECORDS = re.compile(r"record \d+ of (\d+)$")
TIME_RESPONSE, FREQUENCY_RESPONSE, TIME_AXIS = 1, 4, 17
# Unit of a specific data type (records 9 and 10) without a label, where dataset 164 states SI.
SI_OF_TYPE = {8: "m", 9: "N", 11: "m/s", 12: "m/s²", 13: "N", 15: "Pa"}
QUANTITY_OF_TYPE = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}


@dataclass(frozen=True)
class FrequencyResponses:
    """Frequency response functions of a file.

    ``frequency`` is (n_frequency,) [Hz], ``frf`` is (n_function, n_frequency), complex, in ``units``. ``responses`` and
    ``references`` are the degrees of freedom ("12 +Z").
    """

    frequency: np.ndarray
    frf: np.ndarray
    units: tuple[str, ...]
    responses: tuple[str, ...]
    references: tuple[str, ...]
    names: tuple[str, ...]


def read_raw(source: Source) -> RawFile:
    """Records of all time responses in the file.

    The name of a channel is ID line 1. The response entity, the label of the ordinate and the degree of freedom
    ("12 +Z") are accepted as well. The version or sequence number (record 6, field 3) is the number of the record. If
    it is the same in all sets, the times in ID line 3, the nodes of the impacts or a regular order define the records
    (``pair_sets``). "record k of n" in ID line 5, as this program writes it, states n records.

    Parameters
    ----------
    source : Source
        The Universal File.

    Returns
    -------
    RawFile
        The records; a damaged set makes its record an error.

    Raises
    ------
    ReadError
        If the file holds no time response.
    """
    data = source.memory_map if source.lazy else source.data
    all_sets = read_datasets(data)
    if source.lazy:
        all_sets = tuple(replace(s, data=_lazy_column(np.asarray(s.data), data, source.path)) for s in all_sets)
    sets = [s for s in all_sets if s.dataset_type in ("", "58", "58b")]
    wanted = [s for s in sets if s.damage or _is_time_response(s)]
    if not wanted or not any(s.dataset_type for s in wanted):
        if damaged := [s for s in wanted if s.damage]:
            raise source.error(f"byte {damaged[0].offset}", damaged[0].damage, COPY_AGAIN)
        problem = f"it holds {_contents(all_sets)} and no time response"
        raise source.error("the file", problem, _remedy_without_time(sets), reason="empty")
    return RawFile(tuple(_records(wanted, file_units(data, all_sets), source)), _promised_count(wanted))


# Function types of dataset 58 and other data sets that analysers export.
FUNCTION_NAMES = {
    0: "general function", 2: "auto spectrum", 3: "cross spectrum", 4: "frequency response", 5: "transmissibility",
    6: "coherence", 7: "auto correlation", 8: "cross correlation", 9: "power spectral density",
    10: "energy spectral density", 12: "spectrum", 13: "cumulative frequency distribution", 17: "impulse response",
}  # fmt: skip
DATASET_NAMES = {
    "15": "set of nodes", "2411": "set of nodes", "82": "set of trace lines", "2412": "set of elements",
    "55": "mode shape", "2414": "mode shape", "151": "header", "164": "statement of units",
}  # fmt: skip


def _contents(sets: Sequence[UffDataset]) -> str:
    """What a file holds, in words: "3 x frequency response, 2 x mode shape"."""
    words = [
        FUNCTION_NAMES.get(s.func_type, f"function of type {s.func_type}")
        if s.dataset_type in ("58", "58b")
        else DATASET_NAMES.get(s.dataset_type, f"data set {s.dataset_type}")
        for s in sets
    ]
    return ", ".join(f"{n} x {word}" for word, n in Counter(words).items())


def _remedy_without_time(sets: Sequence[UffDataset]) -> str:
    export = "Export the time responses of force and acceleration of each impact (function type 1) from the analyser"
    if any(s.func_type == FREQUENCY_RESPONSE for s in sets):
        return f"{export}, or get the modes of its frequency responses with turnout.modes_of_frf"
    return export


def _promised_count(sets: Sequence[UffDataset]) -> int | None:
    """Number of records that the sets state for the file, or None."""
    matches = [m for s in sets if s.ids and (m := PROMISED_RECORDS.match(s.ids[4]))]
    return max((int(m[1]) for m in matches), default=None)


def _lazy_column(numbers: np.ndarray, mapped: Any, path: Path) -> Column:
    """A lazy column of the bytes of the file that ``numbers`` is a view of; ``numbers`` itself if it is none."""
    base = np.frombuffer(mapped, np.uint8).__array_interface__["data"][0]
    offset = numbers.__array_interface__["data"][0] - base
    if not 0 <= offset <= len(mapped) - numbers.nbytes or not numbers.flags.c_contiguous or not numbers.size:
        return numbers
    dtype = numbers.dtype
    return LazyColumn(
        lambda start, stop: np.fromfile(path, dtype, stop - start, offset=offset + start * dtype.itemsize),
        numbers.size,
        dtype,
    )


def _is_time_response(dataset: UffDataset) -> bool:
    is_untyped = dataset.func_type == 0 and bool(dataset.labels)
    return dataset.func_type == TIME_RESPONSE or (is_untyped and dataset.labels[0][0] == TIME_AXIS)


def _records(
    sets: Sequence[UffDataset], stated_units: FileUnits | None, source: Source
) -> Iterator[RawRecord | ReadError]:
    """RawRecord or ReadError per record, in order."""
    nameless = [s for s in sets if not s.labels]
    named = [s for s in sets if s.labels]
    pairing = pair_sets(named, nameless, source)
    n = len(pairing.groups)
    for k in range(n):
        yield _record(pairing, k, stated_units, source)
    last = max((s.offset for s in named), default=-1)
    trailing = [s for s in nameless if not s.dataset_type and s.offset > last]
    for dataset in nameless:
        if dataset not in trailing:
            yield source.error(f"record {n + 1}, byte {dataset.offset}", dataset.damage, COPY_AGAIN, reason="truncated")
    if trailing and _promised_count(named) != n:
        problem = f"{trailing[0].damage}, behind its last set"
        yield source.error(f"record {n + 1}, byte {trailing[0].offset}", problem, TRAILING_REMEDY, reason="truncated")


TRAILING_REMEDY = (
    "If the analyser's own file has more sets, copy it again; if it ends so too, delete what follows the last set"
)


def _record(pairing: Pairing, k: int, stated_units: FileUnits | None, source: Source) -> RawRecord | ReadError:
    """One record from the sets of its channels, or its error."""
    group, channels, n = pairing.groups[k], pairing.channels, len(pairing.groups)
    if problem := pairing.problems.get(k):
        return source.error(f"record {k + 1} of {n}", problem, PAIRING_REMEDY)
    if not group:
        return missing_record(k, n, source)
    for key in channels:
        dataset = group.get(key)
        if dataset is None:
            problem = f"channel {channel_name(key)!r} is missing from this record"
            if label := pairing.labels.get(k):
                problem += f", which {channel_name(next(iter(group)))!r} gives {label}"
            return source.error(f"record {k + 1} of {n}", problem, COPY_AGAIN, reason="truncated")
        if dataset.damage:
            place = f"record {k + 1} of {n}, channel {channel_name(key)!r}, byte {dataset.offset}"
            return source.error(place, dataset.damage, COPY_AGAIN, reason="truncated")
    sets = [group[key] for key in channels]
    first = sets[0]
    names, aliases = _distinct_names(channels)
    starts, steps = zip(*map(_axis, sets))
    for dataset, name in zip(sets, names):
        if unit := _unit_of_other_axis(dataset.labels[0][2]):
            place = f"record {k + 1} of {n}, channel {name!r}"
            problem = f"the unit of its abscissa is {unit!r}, and its samples are a time response"
            return source.error(place, problem, "Export time responses, with their times in s, ms or µs", "wrong_rate")
    try:
        check_simultaneous(names, steps, starts, f"record {k + 1} of {n}", source)
    except ReadError as error:
        return error
    started_at = parse_uff_time(first.ids[2]) or parse_time(first.ids[2])
    return RawRecord(
        names=names,
        samples=[s.data for s in sets],
        entries=(*_entries(sets), *_texts(sets), *_quantities(sets, names), *_directions(sets, names)),
        units=tuple(_unit(s.labels[1], stated_units) for s in sets),
        started_at=started_at,
        unread_start=first.ids[2] if started_at is None and is_unread_uff_time(first.ids[2]) else "",
        conditions=_conditions(first.ids[3]),
        time=None if first.x is None else first.x * _seconds_per_x(first),
        is_time_in_seconds=True,
        aliases=aliases,
        undecided={i: of_ids[0] for i, s in enumerate(sets) if (of_ids := entry_statements(_entries([s]), [""]))},
        unit_conflicts={i: text for i, s in enumerate(sets) if (text := _unit_conflict(s.labels[1], stated_units))},
    )


def _axis(dataset: UffDataset) -> tuple[float, float]:
    """(start, mean step) of a set's abscissa [s]."""
    if dataset.x is None or len(dataset.x) < 2:
        return dataset.start, dataset.step
    return float(dataset.x[0]), float(dataset.x[-1] - dataset.x[0]) / (len(dataset.x) - 1)


def _unit_of_other_axis(label: str) -> str:
    """The unit of an abscissa if it is one of another quantity than time, else ""."""
    unit = rate_unit(label)
    is_of_other = not unit.is_step if unit is not None else not is_meaningless(label) and known_unit(label) is not None
    return label if is_of_other else ""


def _distinct_names(channels: Sequence[ChannelKey]) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """(names, aliases): the names are of the first type that differs for all channels."""
    dofs = [_dof_name(("", *key[2:4])) for key in channels]
    name_lists = [[key[0] for key in channels], [key[1] for key in channels], [key[4] for key in channels], dofs]
    distinct_lists = [names for names in name_lists if len(set(names)) == len(names) and not {"", "NONE"} & set(names)]
    names = distinct_lists[0] if distinct_lists else [channel_name(key) for key in channels]
    aliases = tuple(tuple(a for a in (key[0], key[1], key[4], dof) if a) for key, dof in zip(channels, dofs))
    return tuple(names), aliases


def _unit(axis: tuple[int, str, str], stated_units: FileUnits | None) -> str:
    """Unit of an ordinate: its label, else that of its data type in the units of dataset 164."""
    data_type, _, label = axis
    if not _is_blank(label):
        return label
    si = SI_OF_TYPE.get(data_type, "")
    if not si or stated_units is None:
        return ""
    scale = {"N": stated_units.force, "Pa": stated_units.force / stated_units.length**2}.get(si, stated_units.length)
    candidates = UNITS[conversion(si).dimension]
    return next((u for u, (s, _) in candidates.items() if abs(s / scale - 1.0) < FACTOR_PRECISION), f"{scale:.9g} {si}")


def _unit_conflict(axis: tuple[int, str, str], stated_units: FileUnits | None) -> str:
    """The label of an axis and the unit of dataset 164 if they contradict each other, else ""."""
    data_type, title, label = axis
    of_file = "" if _is_blank(label) else _unit((data_type, title, ""), stated_units)
    written, stated = known_unit(label), known_unit(of_file)
    if not written or not stated or written.dimension != stated.dimension:
        return ""
    is_same = abs(written.scale / stated.scale - 1.0) < FACTOR_PRECISION
    choices = f"'unit: {label}!' if the label is right, 'unit: {of_file}!' if the data set is"
    return "" if is_same else f"its label says {label!r}, data set 164 of the file {of_file!r} ({choices})"


def _is_blank(label: str) -> bool:
    return label.upper() in ("", "NONE", "UNKNOWN")


FACTOR_PRECISION = 1e-5  # relative: factors of dataset 164 are printed with few digits


def _entries(sets: Sequence[UffDataset]) -> Iterator[Entry]:
    """The step of the abscissa of each set, and the texts of its ID lines."""
    for dataset in sets:
        if dataset.x is None:
            step = 0.0 if np.isnan(dataset.step) or not dataset.step_text else dataset.step_text
            yield step_entry("abscissa spacing (record 7)", step, dataset.labels[0][2])
        for i, text in enumerate(dataset.ids, 1):
            if i != 3 and text not in ("", "NONE"):
                yield from entries_of_text(text, f"ID line {i}")


def _texts(sets: Sequence[UffDataset]) -> Iterator[Entry]:
    """The texts of the ID lines as a whole, each once."""
    for i, text in dict.fromkeys((i, text) for dataset in sets for i, text in enumerate(dataset.ids, 1)):
        if i != 3 and text not in ("", "NONE"):
            yield Entry(f"ID line {i}", FREE_TEXT, text)


def _quantities(sets: Sequence[UffDataset], names: Sequence[str]) -> Iterator[Entry]:
    """The quantity of each ordinate by its data type (record 9); a label of its unit counts more than the type."""
    for dataset, name in zip(sets, names):
        quantity = QUANTITY_OF_TYPE.get(dataset.labels[1][0])
        if quantity and _is_blank(dataset.labels[1][2]):
            yield Entry(f"data type of the ordinate {name!r}", DEFINED_NAME, quantity)


def _directions(sets: Sequence[UffDataset], names: Sequence[str]) -> Iterator[Entry]:
    """The direction of each response that is measured against an axis (record 6)."""
    for dataset, name in zip(sets, names):
        if dataset.response[2] < 0:
            yield Entry(
                f"record 6 of {name!r}", "response direction", _dof_name(("", *dataset.response[1:])), is_defined=True
            )


def _seconds_per_x(dataset: UffDataset) -> float:
    """Seconds per unit of the abscissa, by its label."""
    unit = rate_unit(dataset.labels[0][2])
    return float(unit.scale) if unit is not None and unit.is_step else 1.0


def _conditions(text: str) -> dict[str, float | str]:
    """Conditions in ID line 4, as in "rail_temperature=12.3; track=main"; other text is ignored."""
    pairs = dict(item.strip().split("=", 1) for item in text.split(";") if item.count("=") == 1)
    return {name: number_or_text(value) for name, value in pairs.items() if name in CONDITIONS}


def read_frf(path: PathLike | str, root: PathLike | str = ".") -> FrequencyResponses:
    """Frequency response functions (function type 4) of a Universal File, plain or gzipped.

    Parameters
    ----------
    path : path-like
        Relative to ``root``, or absolute inside it.
    root : path-like
        Folder outside which no file is opened.

    Returns
    -------
    FrequencyResponses
        The functions with their frequencies; their unit is the label of the ordinate over that of its denominator if
        the file has both.

    Raises
    ------
    ReadError
        If there is no frequency response, one is damaged, or their frequencies differ.
    """
    source = load(path, root)
    data = source.unpacked_data()
    all_sets = read_datasets(data)
    stated_units = file_units(data, all_sets)
    functions = [s for s in all_sets if s.dataset_type in ("58", "58b")]
    sets = [s for s in functions if s.damage or s.func_type == FREQUENCY_RESPONSE]
    for dataset in sets:
        if dataset.damage:
            raise source.error(f"byte {dataset.offset}", dataset.damage, COPY_AGAIN, reason="truncated")
    if not sets:
        raise source.error("the file", "it holds no frequency response (function type 4)", "Export frequency responses")
    axes = [_frequency_axis(s, source) for s in sets]
    if any(len(axis) != len(axes[0]) or not np.allclose(axis, axes[0], rtol=1e-6) for axis in axes):
        raise source.error(
            "the file", "its frequency responses have different frequencies", "Export them to one file each"
        )
    return FrequencyResponses(
        frequency=axes[0],
        frf=np.vstack([s.data for s in sets]),
        units=tuple(_frf_unit(s, stated_units) for s in sets),
        responses=tuple(_dof_name(s.response) for s in sets),
        references=tuple(_dof_name(s.reference) for s in sets),
        names=tuple(s.ids[0] for s in sets),
    )


def _frequency_axis(dataset: UffDataset, source: Source) -> np.ndarray:
    """Frequencies of a set [Hz] by the label of its abscissa; without one they are in Hz."""
    label = dataset.labels[0][2]
    scale = 1.0 if is_meaningless(label) or _is_blank(label) else hertz_of(label)
    if scale is None:
        problem = f"the unit of its abscissa is {label!r}, which is none of a frequency"
        remedy = "Export frequency responses with their frequencies in Hz, kHz, rad/s or rpm"
        raise source.error(f"byte {dataset.offset}", problem, remedy, reason="wrong_rate")
    axis = dataset.x if dataset.x is not None else dataset.start + dataset.step * np.arange(len(dataset.data))
    return scale * axis


def _frf_unit(dataset: UffDataset, stated_units: FileUnits | None) -> str:
    """Unit of a frequency response; where its labels and dataset 164 contradict each other, what they say."""
    if conflicts := [text for axis in dataset.labels[1:3] if (text := _unit_conflict(axis, stated_units))]:
        return f"not known: {conflicts[0].partition(' (')[0]}"
    numerator, denominator = (_unit(axis, stated_units) for axis in dataset.labels[1:3])
    return numerator if not denominator or "/N" in numerator else f"({numerator})/({denominator})"


def _dof_name(dof: tuple[str, int, int]) -> str:
    name, node, direction = dof
    name = "" if name == "NONE" else name
    return f"{name} {node} {DIRECTIONS.get(direction, direction)}".strip()
