"""Start time under a name that no format defines: "Recorded on", "Aufnahmezeitpunkt", "Date/Time"."""

import re
from dataclasses import replace
from datetime import datetime, timedelta
from functools import lru_cache

from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord
from turnout.readers.time_texts import looks_dated, parse_time

START = re.compile(
    r"start|begin|debut|inici|inizi|zacat|trigg|record|aufnahm|aufzeich|mess|mesur|medic|misur|enregistr|registr|grab"
    r"|acqui|erfass|optag|maling|timestamp|zeitstempel|horodat|datetime|^date$|^dato$|^datum$|^time$|^zeit$|^fecha$"
)
# Times of other events.
OTHER = re.compile(
    r"end|stop|fin$|slut|calib|kalib|etalonn|tarat|export|creat|erstell|modif|chang|saved|print|servic|install|version"
    r"|due|valid|last|letzt|next|file|datei|software|firmware|config|import|convert|upload"
)
MAX_ZONE_DIFFERENCE = timedelta(hours=26)  # two zones on both sides of the date line


@lru_cache(maxsize=4096)
def is_start_name(name: str) -> bool:
    """Whether a name may mean the start of a recording.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool
        False for the time of another event.

    Examples
    --------
    >>> [is_start_name(n) for n in ("Recorded on", "Date/Time", "Calibration date", "End time", "Operator")]
    [True, True, False, False, False]
    """
    words = words_of(name)
    return any(START.search(word) for word in words) and not any(OTHER.search(word) for word in words)


def with_stated_start(record: RawRecord) -> RawRecord:
    """The only record of a file with the start time of its metadata if its format states none.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        With a start time if all entries under such a name agree; a text that is no time is its unread start, and one
        that contradicts the start time of the format.
    """
    texts = [e.value.strip() for e in record.entries if isinstance(e.value, str) and is_start_name(e.name)]
    texts = list(dict.fromkeys(text for text in texts if looks_dated(text)))
    if not texts or record.unread_start:
        return record
    if record.started_at is not None:
        other_texts = [text for text in texts if is_other_start(parse_time(text), record.started_at)]
        return replace(record, unread_start=other_texts[0][:60]) if other_texts else record
    times = {_naive(stamp) for text in texts if (stamp := parse_time(text))}
    if len(times) != 1:
        return replace(record, unread_start=" or ".join(texts)[:60])
    return replace(record, started_at=next(stamp for text in texts if (stamp := parse_time(text))))


def _naive(stamp: datetime) -> datetime:
    return stamp.replace(tzinfo=None)


def is_other_start(stamp: datetime | None, started_at: datetime) -> bool:
    """Whether a stamp is of another day than the start, in any time zones.

    Parameters
    ----------
    stamp : datetime or None
        Another time stamp of the file.
    started_at : datetime
        Start of the record.

    Returns
    -------
    bool
        False without a stamp.
    """
    return stamp is not None and abs(_naive(stamp) - _naive(started_at)) > MAX_ZONE_DIFFERENCE
