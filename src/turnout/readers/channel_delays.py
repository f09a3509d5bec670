"""Delays of single channels that a file states beside their samples."""

import re
from collections.abc import Sequence
from functools import lru_cache

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import numbered_channels, owners_of, spaced_words, without_channels
from turnout.readers.rate_units import SAMPLES, rate_unit, words_of
from turnout.readers.source import RawRecord
from turnout.readers.stated_numbers import finite_numbers, number_and_unit
from turnout.readers.stated_units import known_unit

DELAY = re.compile(r"delay|latenc|skew$|^lag$|verzog|retard|forsink|fordroj|vertraging|^timeshift$")
# Times at which the samples of a channel begin.
BEGIN = re.compile(r"\b(?:start offset|t ?0|t start|pre ?trig(?:ger)?)\b")
PRE_TRIGGER = re.compile(r"\bpre ?trig")  # a setting of the channel that triggers: of the others it says nothing
SHIFT = re.compile(rf"{BEGIN.pattern}|\btime (?:shift|offset)\b")
# Delays before a recording begins, and what is beside a delay.
OTHER_DELAY = re.compile(
    r"trig|start|hold|wait|settl|warm|auslos|unit|einheit|type|mode|name|enabl|max|toler|alarm|level"
)
MAX_LISTED = 4  # channels in one message
MAX_LAG = 0.5  # of a sampling step that the first samples may be apart: converters that take turns are
MAX_SHARE = 0.01  # of a sampling step that delays may differ: 1.8° of phase at half the sampling rate
DELAY_REMEDY = "Let the export shift the samples; if they are in time already, name the entry in 'checked_entries'"


def delay_problem(record: RawRecord, rows: Sequence[int], rate: float) -> str:
    """What the metadata of a record state about delays that differ between its channels.

    A number without a known unit counts as seconds. No unit in use is longer, so a difference far below a sampling
    step in seconds is negligible in any of them.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    rows : sequence of int
        Numbers of the channels that the layout wants, from 0.
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    str
        The problem, for a message; "" if all these channels have the same delay, or none is stated.
    """
    delays: dict[str, dict[int, float]] = {}
    labels: dict[str, str] = {}
    for entry in (e for e in record.entries if is_delay_name(e.name)):
        numbers = _seconds(entry, rate)
        owners = owners_of(entry, record.entries, record.names)
        name = without_channels(entry.name, [record.names[i] for i in owners])
        if not owners and (owners := numbered_channels(entry.name, record.entries, len(record.names))):
            name = re.sub(r"\d+", "", name)
        labels.setdefault(name, entry.name)
        if len(numbers) == len(record.names) > 1:
            delays[name] = dict(enumerate(numbers))
        elif owners and len(numbers) == 1:
            delays.setdefault(name, {}).update(dict.fromkeys(owners, numbers[0]))
    for name, of_channels in delays.items():
        values = [of_channels.get(i, 0.0) for i in rows if i in of_channels or not PRE_TRIGGER.search(name)]
        if values and (max(values) - min(values)) * rate > (MAX_LAG if BEGIN.search(name) else MAX_SHARE):
            listed = ", ".join(f"{record.names[i]!r} {value:g} s" for i, value in [*zip(rows, values)][:MAX_LISTED])
            problem = f"its metadata state different delays ({labels[name]}: {listed})"
            return f"{problem}, and nothing says that they are corrected"
    return ""


@lru_cache(maxsize=4096)
def is_delay_name(name: str) -> bool:
    """Whether an entry of this name may state by how much a channel is late.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_delay_name(name) for name in ("Delay [µs]", "rail_start_offset", "t0", "trigger delay", "offset")]
    [True, True, True, False, False]
    """
    texts = spaced_words(name), " ".join(words_of(name))
    if remainders := [remainder for text in texts if (remainder := SHIFT.sub("", text)) != text]:
        return not OTHER_DELAY.search(remainders[0])
    return any(map(DELAY.search, words_of(name))) and not any(map(OTHER_DELAY.search, words_of(name)))


def _seconds(entry: Entry, rate: float) -> list[float]:
    """The numbers of an entry in seconds, of texts those at their beginning; none where one has another unit."""
    in_brackets = re.findall(r"[\[(]([^\])]*)[\])]", entry.name)
    last_word = next(iter(words_of(entry.name)[-1:]), "")
    unit = in_brackets[0] if in_brackets else last_word if len(last_word) > 1 else ""
    value = re.split(r"[;\t]|,\s+", entry.value) if isinstance(entry.value, str) else entry.value
    if isinstance(value, list) and all(isinstance(cell, str) for cell in value):
        *cells, last = value
        if cells and number_and_unit(last) is None:  # "Delay;0;2;ms"
            unit = last
        else:
            cells.append(last)
        pairs = [number_and_unit(cell) for cell in cells]
    else:
        numbers = finite_numbers(value)
        pairs = [] if numbers is None else [(float(x), "") for x in numbers]
    seconds = [None if pair is None else _in_seconds(pair[0], pair[1] or unit, rate) for pair in pairs]
    return [x for x in seconds if x is not None]


def _in_seconds(number: float, unit: str, rate: float) -> float | None:
    """A number in seconds, without a known unit the number itself; None for another quantity, or part of a date."""
    word = next(iter(unit.strip("[]() ").split()), "")
    if (time_unit := rate_unit(word)) and time_unit.is_step:
        return number * float(time_unit.scale)
    if SAMPLES.fullmatch(word):
        return number / rate
    return None if known_unit(word) or re.match(r"°|[-:/.]\d", word) else number
