"""Start times of records from their entries: in one of them, or with day and time of day in two, "Date" and "Time"."""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from functools import lru_cache

import numpy as np

from turnout.errors import ReadError
from turnout.readers.entries import Entry
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord
from turnout.readers.start_columns import start_in_cells
from turnout.readers.stated_starts import (
    DATE_WORD,
    MAX_UNREAD,
    OTHER,
    START,
    TIME_WORD,
    is_of_begin,
    is_start_name,
    with_stated_start,
)
from turnout.readers.stated_zones import ABBREVIATION, zone_in_name, zone_of
from turnout.readers.time_numbers import is_unset
from turnout.readers.time_texts import DATE_PARTS, is_day, parse_time, time_of_vector

CLOCK_ALONE = re.compile(
    r"(\d{1,2}:\d{2})(:\d{2}(?:[.,]\d{1,12})?)?((?: ?[AaPp]\.?[Mm]\.?)?(?:Z| ?UTC| ?[+-]\d{2}:?\d{2})?)"
    rf"(?: \(?(?:{ABBREVIATION.pattern})\)?)?"
)
DATE_ALONE_WORD = re.compile(r"^data$")  # a date only if the value is one
# A time of day with other marks, under a name that speaks of one: "14.05.30", "14h05m30s".
OTHER_CLOCK = re.compile(r"([01]?\d|2[0-3])(?:[h.]([0-5]\d)[m.]([0-5]\d(?:[.,]\d{1,12})?)s?|\s?h\s?([0-5]\d))")
BARE_WORDS = frozenset(("date", "dato", "datum", "fecha", "time", "zeit"))


def with_stated_starts(records: Sequence[RawRecord | ReadError]) -> tuple[RawRecord | ReadError, ...]:
    """The records with the starts that their metadata state, if no format defines one.

    A start of a clock that was never set, such as 1904-01-01, counts only where no other is stated.
    An entry that all records have is about the file: one of the record itself counts more. If the format gives one of
    the records a start, those without stay so, because a start of the file would precede it.

    Parameters
    ----------
    records : sequence of RawRecord or ReadError
        The records as their reader returns them.

    Returns
    -------
    tuple of (RawRecord or ReadError)
        The same number of records.
    """
    intact = [r for r in records if isinstance(r, RawRecord)]
    if any(r.started_at for r in intact) and not any(map(_has_set_start, intact)):
        without_epochs = with_stated_starts(
            [replace(r, started_at=None) if isinstance(r, RawRecord) else r for r in records]
        )
        return (
            without_epochs
            if any(isinstance(r, RawRecord) and _has_set_start(r) for r in without_epochs)
            else tuple(records)
        )
    if len(intact) > 1 and any(r.started_at for r in intact):
        return tuple(records)
    counts = Counter(key for r in intact for key in {_key(e) for e in r.entries if may_state_start(e.name)})
    return tuple(
        _with_start(r, _entries_of_start(r, counts, len(intact))) if isinstance(r, RawRecord) else r for r in records
    )


def with_starts_of_records(records: Sequence[RawRecord | ReadError]) -> tuple[RawRecord | ReadError, ...]:
    """The records, each with its own one of the starts that an entry lists for all records of the file.

    Parameters
    ----------
    records : sequence of RawRecord or ReadError
        The records as their reader returns them.

    Returns
    -------
    tuple of (RawRecord or ReadError)
        Unchanged for a single record, and where no entry under the name of a start lists as many times as records.
    """
    n = len(records)
    of_intact = [{_key(e) for e in r.entries if is_start_name(e.name)} for r in records if isinstance(r, RawRecord)]
    shared = set.intersection(*of_intact) if n > 1 and of_intact else set()
    if not shared:
        return tuple(records)
    return tuple(
        replace(r, entries=tuple(_of_record(e, k, n) if _key(e) in shared else e for e in r.entries))
        if isinstance(r, RawRecord)
        else r
        for k, r in enumerate(records)
    )


def _of_record(entry: Entry, k: int, n: int) -> Entry:
    """An entry with the value of record ``k`` of ``n`` if it lists one for each; a date vector is a single one."""
    value = entry.value.ravel().tolist() if isinstance(entry.value, np.ndarray) else entry.value
    is_list = isinstance(value, (list, tuple)) and len(value) == n and time_of_vector(value) is None
    return replace(entry, value=value[k]) if is_list else entry


def _has_set_start(record: RawRecord) -> bool:
    """Whether a record has a start of a clock that was set."""
    return record.started_at is not None and not is_unset(record.started_at)


def _key(entry: Entry) -> tuple[str, str, str]:
    return entry.place, entry.name, str(entry.value)


@lru_cache(maxsize=4096)
def may_state_start(name: str) -> bool:
    """Whether a name may mean the start of a recording, or its day or time of day.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool
        False for the time of another event.
    """
    words = words_of(name)
    is_part = any(DATE_WORD.search(w) or TIME_WORD.search(w) or DATE_ALONE_WORD.search(w) for w in words)
    return is_start_name(name) or (is_part and not any(OTHER.search(word) for word in words))


def _entries_of_start(record: RawRecord, counts: Counter, n: int) -> tuple[Entry, ...]:
    """Entries that may state the start: those of the record alone if they do, else those of the file."""
    entries = tuple(e for e in (*record.entries, *_joined_parts(record.entries)) if may_state_start(e.name))
    of_record = tuple(e for e in entries if counts[_key(e)] < n)
    stated = _with_start(replace(record, started_at=None, unread_start=""), of_record)
    return of_record if stated.started_at or stated.unread_start else entries


def _joined_parts(entries: Sequence[Entry]) -> list[Entry]:
    """The start as a date vector if six entries state its parts as numbers, from ``year`` to ``second``."""
    parts = {e.name.casefold(): e.value for e in entries if isinstance(e.value, (int, float, np.number))}
    vector = [float(parts[part]) for part in DATE_PARTS if part in parts]
    return [Entry("entries", "start", vector)] if time_of_vector(vector) else []


def _with_start(record: RawRecord, entries: tuple[Entry, ...]) -> RawRecord:
    """The record with the start that these entries state."""
    if not entries and not record.unread_start:
        return record
    is_part = is_day(record.unread_start) or CLOCK_ALONE.fullmatch(record.unread_start)
    if record.unread_start and not is_part:
        return record
    whole = with_stated_start(replace(record, unread_start="", entries=entries))
    if not (whole.started_at or whole.unread_start):
        whole = _with_joined_start(whole)
    unread_start = whole.unread_start if whole.started_at or whole.unread_start else record.unread_start
    return replace(whole, entries=record.entries, unread_start=unread_start)


def _with_joined_start(record: RawRecord) -> RawRecord:
    """The record with the start of two entries, one of the day and one of the time of day.

    The time of day may also be that of the first sample in a column of such times.
    """
    days = _texts(record.entries, is_day)
    clocks = _texts(record.entries, lambda text: bool(CLOCK_ALONE.fullmatch(text)))
    clocks = clocks or {text: "time" for _, text in record.axis_starts if days and CLOCK_ALONE.fullmatch(text)}
    if not clocks:
        stated = [day for day, name in days.items() if is_of_begin(name)]
        return replace(record, unread_start=stated[0]) if stated else record
    if not days:
        return record
    if len(days) > 1 or len(clocks) > 1:
        return replace(record, unread_start=" or ".join((*days, *clocks))[:MAX_UNREAD])
    (day, _), (clock, name) = *days.items(), *clocks.items()
    start, text = _start_of_pair(day, clock)
    if start and start.tzinfo is None and (zone := zone_in_name(name)):
        zone_of_name = zone_of(zone)
        return replace(record, started_at=start.replace(tzinfo=zone_of_name), unread_zone="" if zone_of_name else zone)
    return replace(record, started_at=start, unread_start="" if start else text)


def _texts(entries: Sequence[Entry], is_wanted: Callable[[str], bool]) -> dict[str, str]:
    """Text -> name of the entries whose text is wanted; those of a start count more than a bare "Date"."""
    wanted = [(text, e.name) for e in entries if is_wanted(text := _plain_part(e))]
    explicit = [(text, name) for text, name in wanted if _is_explicit(name)]
    return dict(explicit or wanted)


def _plain_part(entry: Entry) -> str:
    """The value of an entry; a time of day with colons, a date without blanks."""
    text = re.sub(r"(?<=\d\.)\s(?=\d)", "", str(entry.value).strip())
    words = words_of(entry.name)
    is_of_day = any(DATE_WORD.search(word) or DATE_ALONE_WORD.search(word) for word in words)
    clock = OTHER_CLOCK.fullmatch(text) if any(map(TIME_WORD.search, words)) and not is_of_day else None
    return f"{clock[1]}:{clock[2] or clock[4]}:{clock[3] or '00'}" if clock else text


def _is_explicit(name: str) -> bool:
    return any(START.search(word) and word not in BARE_WORDS for word in words_of(name))


def _start_of_pair(day: str, clock: str) -> tuple[datetime | None, str]:
    """Start of a day and a time of day, or the text of one that cannot be read."""
    match = CLOCK_ALONE.fullmatch(clock)
    with_seconds = clock if match is None or match[2] else f"{match[1]}:00{match[3]}"
    start = parse_time(f"{day} {with_seconds}")
    if start:
        return start, ""
    start, text = start_in_cells([day, with_seconds], ["day", "clock"])
    return start, text or f"{day} {clock}"
