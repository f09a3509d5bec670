"""Starts that a file states for each of its channels, in the entries of the channels or in one line of a head."""

from collections.abc import Iterator
from datetime import datetime

from turnout.readers.entry_owners import owners_of
from turnout.readers.source import RawRecord
from turnout.readers.stated_starts import is_start_name, times_of_entry
from turnout.readers.time_numbers import is_unset
from turnout.readers.time_texts import parse_time

MAX_DIFFERENCE = 1e-3  # s: converters that take turns begin closer together


def different_starts(record: RawRecord) -> str:
    """Why the channels of a record did not begin together, by their own starts, for a message.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.

    Returns
    -------
    str
        Without its full stop; "" if the starts agree, or if fewer than two channels have one of their own.
    """
    for starts in (_of_channels(record), *_of_lines(record)):
        times = [time.replace(tzinfo=None) for time in starts if not is_unset(time)]
        if times and (difference := (max(times) - min(times)).total_seconds()) >= MAX_DIFFERENCE:
            return f"the starts that it states for its channels differ by {difference:.6g} s"
    return ""


def _of_channels(record: RawRecord) -> list[datetime]:
    """Starts of entries that belong to one channel each."""
    starts: dict[int, datetime] = {}
    for entry in record.entries:
        if is_start_name(entry.name) and (times := [time for _, time in times_of_entry(entry) if time]):
            owners = owners_of(entry, record.entries, record.names)
            if len(owners) == 1:
                starts.setdefault(next(iter(owners)), times[0])
    return list(starts.values())


def _of_lines(record: RawRecord) -> Iterator[list[datetime]]:
    """Starts that one entry lists, or one line: behind the first, each further one is the name of an entry there."""
    lines: dict[str, list[datetime]] = {}
    for entry in record.entries:
        if is_start_name(entry.name):
            times = [time for _, time in times_of_entry(entry) if time]
            if len(times) == len(record.names):
                yield times
            lines.setdefault(entry.place, times)
        elif entry.place in lines and (named := parse_time(entry.name)):
            behind = parse_time(entry.value) if isinstance(entry.value, str) else None
            lines[entry.place] += [named, behind] if behind else [named]
    yield from (times for place, times in lines.items() if place.startswith("line "))
