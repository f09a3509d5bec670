"""The end of a recording in the metadata, which with its start states the duration."""

import re
from dataclasses import replace
from datetime import datetime
from functools import lru_cache

from turnout.readers.entries import Entry
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord
from turnout.readers.stated_starts import times_of_entry

END_WORD = re.compile(r"end(?:e|ed|zeit|zeitpunkt)?|stop(?:ped|zeit)?|finish(?:ed)?|messende|slut(?:tid)?|fin")
BESIDE_END = frozenset(
    "time date at of the recording record measurement acquisition timestamp stamp zeit datum der des messung aufnahme "
    "de la mesure heure utc".split()
)
MIN_STEPS = 50  # of the clock in a duration, so that it is known to 2 %
CLOCK = re.compile(r"\d:\d\d(?P<seconds>:\d\d(?:[.,](?P<decimals>\d+))?)?")
MIN_STEP = 1e-3  # s: computers keep time no better, whatever digits they write


def with_stated_duration(record: RawRecord) -> RawRecord:
    """The only record of a file with an entry for the duration from its start to the end that its metadata state.

    Parameters
    ----------
    record : RawRecord
        The record with its start.

    Returns
    -------
    RawRecord
        The same record if no end is stated, several are, or the clock is too coarse for the duration.
    """
    start = record.started_at
    ends = {
        time: (text, entry)
        for entry in record.entries
        if _is_end_name(entry.name)
        for text, time in times_of_entry(entry)
        if time is not None
    }
    if start is None or len(ends) != 1:
        return record
    ((end, (text, entry)),) = ends.items()
    if (end.tzinfo is None) != (start.tzinfo is None):
        return record
    duration = (end - start).total_seconds()
    if duration < MIN_STEPS * _clock_step(text, start, end):
        return record
    of_duration = Entry(entry.place, f"duration until {entry.name}", f"{duration:.9g} s")
    return replace(record, entries=(*record.entries, of_duration))


def _clock_step(text: str, start: datetime, end: datetime) -> float:
    """Step [s] of the coarser of two times; ``text`` is that of the end.

    A start or an end that was rounded to a full second has no fraction.
    """
    clock = CLOCK.search(text)
    if clock is not None and clock["seconds"] is None:
        return 60.0
    if not start.microsecond or not end.microsecond:
        return 1.0
    decimals = clock["decimals"] if clock is not None else None
    return max(MIN_STEP, 10.0 ** -len(decimals)) if decimals else MIN_STEP


@lru_cache(maxsize=4096)
def _is_end_name(name: str) -> bool:
    """Whether a name means the end of a recording, and of nothing else."""
    words = words_of(name)
    return any(map(END_WORD.fullmatch, words)) and all(END_WORD.fullmatch(w) or w in BESIDE_END for w in words)
