"""Delays of single channels that a file states beside their samples."""

import re
from collections.abc import Sequence
from functools import lru_cache

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import owners_of
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord
from turnout.readers.stated_numbers import finite_numbers, number_and_unit

DELAY = re.compile(r"delay|latenc|skew$|^lag$|verzog|retard|forsink|fordroj|vertrag|^timeshift$")
# Delays before a recording begins, and what is beside a delay.
OTHER_DELAY = re.compile(r"trig|start|hold|wait|settl|warm|auslos|unit|einheit|type|mode|name|enabl|max|toler|alarm")
MAX_LISTED = 4  # channels in one message
DELAY_REMEDY = "Let the export shift the samples; if they are in time already, name the entry in 'checked_entries'"


def delay_problem(record: RawRecord, rows: Sequence[int]) -> str:
    """What the metadata of a record state about delays that differ between its channels.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    rows : sequence of int
        Numbers of the channels that the layout wants, from 0.

    Returns
    -------
    str
        The problem, for a message; "" if all these channels have the same delay, or none is stated.
    """
    delays: dict[str, dict[int, float]] = {}
    for entry in (e for e in record.entries if _is_delay_name(e.name)):
        numbers = _numbers(entry)
        owners = owners_of(entry, record.entries, record.names)
        if len(numbers) == len(record.names) > 1:
            delays[entry.name] = dict(enumerate(numbers))
        elif owners and len(numbers) == 1:
            delays.setdefault(entry.name, {}).update(dict.fromkeys(owners, numbers[0]))
    for name, of_channels in delays.items():
        values = {record.names[i]: of_channels.get(i, 0.0) for i in rows}
        if len(set(values.values())) > 1:
            listed = ", ".join(f"{channel!r} {value:g}" for channel, value in [*values.items()][:MAX_LISTED])
            return f"its metadata state different delays ({name}: {listed}), and nothing says that they are corrected"
    return ""


@lru_cache(maxsize=4096)
def _is_delay_name(name: str) -> bool:
    words = words_of(name)
    is_shift = {"time", "shift"} <= set(words) or {"time", "offset"} <= set(words)
    is_delay = is_shift or any(DELAY.search(word) for word in words)
    return is_delay and not any(OTHER_DELAY.search(word) for word in words)


def _numbers(entry: Entry) -> list[float]:
    """The numbers of an entry: of a list, or the one at the beginning of a text."""
    if isinstance(entry.value, str):
        number = number_and_unit(entry.value)
        return [] if number is None else [number[0]]
    numbers = finite_numbers(entry.value)
    return [] if numbers is None else [float(x) for x in numbers]
