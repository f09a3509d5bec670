"""Start time under a name that no format defines: "Recorded on", "Aufnahmezeitpunkt", "Date/Time"."""

import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import datetime, timedelta
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.rate_statements import MIN_EPOCH
from turnout.readers.rate_units import seconds_of, words_of
from turnout.readers.source import RawRecord
from turnout.readers.time_numbers import SINCE, is_declared, is_unset
from turnout.readers.time_texts import NUMBER_TEXT, looks_dated, parse_time, stated_time, time_of_vector

START = re.compile(
    r"start|begin|debut|inici|inizi|zacat|trigg|record|aufnahm|aufzeich|mess|measur|mesur|medic|misur|enregistr|registr|grab"
    r"|pomiar|zaznam|mereni|misuraz|rejestrac|nagran"
    r"|acqui|erfass|optag|maling|timestamp|zeitstempel|horodat|datetime|^date$|^dato$|^datum$|^time$|^zeit$|^fecha$"
)
BEGIN = re.compile(r"start|begin|begyn|debut|inici|inizi|zacat")  # of these alone
# Times of other events, and what is written about the recording.
OTHER = re.compile(
    r"end|stop|fin$|slut|calib|kalib|etalonn|tarat|export|creat|erstell|modif|chang|saved|print|servic|install|version"
    r"|build|compil|revis|due|valid|last|letzt|next|file|datei|software|firmware|config|import|convert|upload"
    r"|^not[ae]s?$|notiz|remar[kq]|comment|komment|bemerk|bemaerk|anmerk|anmark|opmerk|poznam|descri|beschreib"
    r"|tisk|vytis|udskr|gedruckt|imprim|uloz|zapis|gespeich|speicher|guardad|salvat|opgesl|konec|koniec|^fine$|einde"
    r"|maint|wartung|^tamp|stopf|grind|schleif|repair|repar|replac|ersetz|renew|erneuer"
)
T_ZERO = re.compile(r"(?<![^\W_])t_?0(?![^\W_])", re.IGNORECASE)  # the start of a waveform, a time or an offset
OF_MOMENT = frozenset("at on am um le el den utc".split())
OF_BEGIN = frozenset("of the der de la du del og at on".split())
DATE_WORD = re.compile(r"date|datum|dato$|stamp|stempel|horodat|fecha|datenum|epoch")
TIME_WORD = re.compile(
    r"time|zeit|heure|temps|tid|tijd|hora$|ora$|cas$|clock|uhr|klok|godzin|hodin|orari|started|begun|recorded"
)
MAX_UNREAD = 120  # characters of a start that cannot be read
MAX_PRE_TRIGGER = 3600.0  # s
MAX_ZONE_DIFFERENCE = timedelta(hours=26)  # two zones on both sides of the date line


def _words_of_start(name: str) -> tuple[str, ...]:
    """The words of a name, in which t0 is the start."""
    return words_of(T_ZERO.sub(" start ", name))


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
    >>> [is_start_name(n) for n in ("Recorded on", "Date/Time", "t0", "Calibration date", "End time", "Operator")]
    [True, True, True, False, False, False]
    """
    words = _words_of_start(name)
    return any(START.search(word) for word in words) and not any(OTHER.search(word) for word in words)


def is_of_begin(name: str) -> bool:
    """Whether a name speaks of a beginning and of no other event or quantity.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_of_begin(n) for n in ("Start", "Messbeginn", "Startdatum", "Start position", "Messdatum")]
    [True, True, True, False, False]
    """
    words = _words_of_start(name)
    further_words = [
        word for word in words if not (START.search(word) or DATE_WORD.search(word) or TIME_WORD.search(word))
    ]
    return any(map(BEGIN.search, words)) and not (set(further_words) - OF_BEGIN) and is_start_name(name)


def has_date_word(name: str) -> bool:
    """Whether a name speaks of a date or of a way to count dates; "time" alone may be a duration.

    Parameters
    ----------
    name : str
        Name of an entry or a column.

    Returns
    -------
    bool
        True for "Startdatum" and "recorded (unix)".
    """
    return any(DATE_WORD.search(word) for word in words_of(name)) or is_declared(name)


def with_declared_origins(record: RawRecord) -> RawRecord:
    """The record with the unit of each time that counts from an origin behind the name of its entry.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        An entry ``start`` with the unit "days since 2000-01-01" is called ``start [days since 2000-01-01]``.
    """
    origins = {
        entry.name: entry.value
        for entry in record.entries
        if isinstance(entry.value, str) and SINCE.search(entry.value) and not SINCE.search(entry.name)
    }
    counted = {entry.name for entry in record.entries if not isinstance(entry.value, str) and entry.name in origins}
    if not counted:
        return record
    explained = {origins[name] for name in counted}
    entries = [entry for entry in record.entries if not (isinstance(entry.value, str) and entry.value in explained)]
    return replace(
        record,
        entries=tuple(
            replace(entry, name=f"{entry.name} [{origins[entry.name]}]") if entry.name in counted else entry
            for entry in entries
        ),
    )


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
    if record.unread_start:
        return record
    stated = dict(item for entry in record.entries if is_start_name(entry.name) for item in times_of_entry(entry))
    if of_set_clocks := {text: time for text, time in stated.items() if not is_unset(time)}:
        stated = of_set_clocks
    times = [time for time in stated.values() if time]
    if not stated:
        return record
    if record.started_at is not None:
        contradicting = [text for text, time in stated.items() if is_other_start(time, record.started_at)]
        return replace(record, unread_start=contradicting[0][:60]) if contradicting else record
    if len({_naive(time) for time in times}) != 1:
        return replace(record, unread_start=" or ".join(stated)[:MAX_UNREAD])
    return replace(record, started_at=times[0] + _pre_trigger(record))


def _pre_trigger(record: RawRecord) -> timedelta:
    """Time from the trigger to the first sample if the stated start is that of the trigger, at 0 of the time column."""
    names = [entry.name for entry in record.entries if is_start_name(entry.name) and any(times_of_entry(entry))]
    is_of_trigger = all(any(word.startswith("trigg") for word in words_of(name)) for name in names)
    first = 0.0 if record.time is None or not record.is_time_in_seconds else float(record.time[0])
    return timedelta(seconds=first if is_of_trigger and -MAX_PRE_TRIGGER < first < 0.0 else 0.0)


def times_of_entry(entry: Entry) -> Iterator[tuple[str, datetime | None]]:
    """Text and time of an entry under the name of a start, if its value looks like a time.

    Parameters
    ----------
    entry : Entry
        Entry of the metadata.

    Yields
    ------
    tuple of (str, datetime or None)
        None for a time that cannot be read.
    """
    value, declared = entry.value, entry.name
    value = value.ravel().tolist() if isinstance(value, np.ndarray) and value.dtype.kind in "OU" else value
    if isinstance(value, (datetime, np.datetime64)):
        yield str(value), parse_time(value)
    elif time := time_of_vector(value):
        yield str(value), time
    elif isinstance(value, list) and value and all(isinstance(text, str) and looks_dated(text) for text in value):
        yield from ((text, parse_time(text)) for text in value)
    elif isinstance(value, str) and not NUMBER_TEXT.fullmatch(value.strip()):
        if looks_dated(value.strip()):
            yield value.strip(), parse_time(value.strip())
    elif isinstance(value, (str, int, float, np.number)) and (
        has_date_word(declared) or _is_long(value, declared) or _is_begin(value, declared)
    ):
        time, problem = stated_time(value, declared)
        if time or problem:
            yield problem or str(value), time


def _is_long(value: Any, declared: str) -> bool:
    """Whether a number under the name of a time, or of a moment, is too large for a duration."""
    is_named = any(TIME_WORD.search(word) for word in words_of(declared)) or _is_of_moment(declared)
    return is_named and float(value) >= MIN_EPOCH


def _is_of_moment(name: str) -> bool:
    """Whether a name speaks of the moment of a recording: "acquired_at", "start_ms", "mess_ns", and no "record_id"."""
    words = words_of(name)
    of_time = [word for word in words if word in OF_MOMENT or seconds_of(word)]
    return bool(of_time) and all(word in of_time or START.search(word) for word in words)


def _is_begin(value: Any, declared: str) -> bool:
    """Whether a number under the name of a beginning is no number of a sample: it has decimals, or is too large."""
    return is_of_begin(declared) and (float(value) % 1 != 0 or float(value) >= MIN_EPOCH)


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
