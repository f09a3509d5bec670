"""The end of a recording in the metadata, which with its start states the duration."""

import re
from dataclasses import replace
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
        time: entry
        for entry in record.entries
        if _is_end_name(entry.name)
        for _, time in times_of_entry(entry)
        if time is not None
    }
    if start is None or len(ends) != 1:
        return record
    ((end, entry),) = ends.items()
    if (end.tzinfo is None) != (start.tzinfo is None):
        return record
    duration = (end - start).total_seconds()
    step = 1e-3 if start.microsecond or end.microsecond else 1.0
    if duration < MIN_STEPS * step:
        return record
    of_duration = Entry(entry.place, f"duration until {entry.name}", f"{duration:.9g} s")
    return replace(record, entries=(*record.entries, of_duration))


@lru_cache(maxsize=4096)
def _is_end_name(name: str) -> bool:
    """Whether a name means the end of a recording, and of nothing else."""
    words = words_of(name)
    return any(map(END_WORD.fullmatch, words)) and all(END_WORD.fullmatch(w) or w in BESIDE_END for w in words)
