"""Time zone that the metadata of a file state beside a start time without one: "UTC", "+02:00", "Europe/Zurich"."""

import re
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from functools import lru_cache
from zoneinfo import ZoneInfo

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord

ZONE_NAME = re.compile(r"timezone|zeitzone|tidszone|tijdzone|fuseauhoraire|fusoorario|zonahoraria|tz|(?:utc|gmt)offset")
NO_ZONE = frozenset(("", "-", "none", "n/a", "?", "unknown", "null", "local", "naive"))
OFFSET = re.compile(r"(?:UTC|GMT)? ?([+-])(\d{1,2})(?::?(\d{2}))?")
SAME_ABBREVIATIONS = {"MEZ": "CET", "MESZ": "CEST", "HNEC": "CET", "HAEC": "CEST"}
LARGEST_OFFSET = 14  # h
QUARTER = 15  # min: offsets of zones are its multiples


def with_stated_zone(record: RawRecord) -> RawRecord:
    """The record with the time zone of its metadata if its start has none.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.

    Returns
    -------
    RawRecord
        With a start in that zone; a zone that cannot be read is its ``unread_zone``.
    """
    if record.started_at is None or record.started_at.tzinfo is not None:
        return record
    texts = list(dict.fromkeys(_zone_texts(record.entries)))
    zones = {zone for text in texts if (zone := zone_of(text))}
    if not texts:
        return record
    if len(zones) != 1 or len(texts) > 1:
        return replace(record, unread_zone=" or ".join(texts)[:60])
    return replace(record, started_at=record.started_at.replace(tzinfo=zones.pop()))


def _zone_texts(entries: tuple[Entry, ...]) -> Iterator[str]:
    for entry in entries:
        if not isinstance(entry.value, (str, int, float, np.number)) or not _is_zone_name(entry.name):
            continue
        text = " ".join(str(entry.value).split())
        if text.casefold() not in NO_ZONE:
            yield text


@lru_cache(maxsize=4096)
def _is_zone_name(name: str) -> bool:
    return bool(ZONE_NAME.fullmatch("".join(words_of(name))))


def zone_of(text: str) -> tzinfo | None:
    """Time zone of a text or a number.

    Parameters
    ----------
    text : str
        Name of the data base of time zones, UTC, or the offset from UTC; a bare number counts hours, or minutes or
        seconds if it is too large for hours.

    Returns
    -------
    tzinfo or None
        None for an abbreviation such as CET, which does not tell whether summer time is meant.

    Examples
    --------
    >>> [str(zone_of(text)) for text in ("UTC+2", "Europe/Zurich", "CET", "120")]
    ['UTC+02:00', 'Europe/Zurich', 'None', 'UTC+02:00']
    """
    if text.upper() in ("UTC", "Z", "GMT", "ETC/UTC"):
        return UTC
    if match := OFFSET.fullmatch(text.upper().replace("−", "-")):
        minutes = 60 * int(match[2]) + int(match[3] or 0)
        is_of_hours = match[3] is not None or int(match[2]) <= LARGEST_OFFSET
        return _zone(-minutes if match[1] == "-" else minutes) if is_of_hours else _zone_of_number(float(text))
    try:
        return _zone_of_number(float(text))
    except ValueError:
        pass
    try:
        return ZoneInfo(text) if "/" in text else None
    except (ValueError, OSError):
        return None


def _zone_of_number(number: float) -> tzinfo | None:
    """Zone of an offset in hours, minutes or seconds, by its size: no zone is a quarter of an hour from UTC."""
    for n_minute in (60.0, 1.0, 1 / 60.0):
        if abs(number * n_minute) <= 60 * LARGEST_OFFSET:
            return _zone(number * n_minute)
    return None


def _zone(minutes: float) -> tzinfo | None:
    is_usual = minutes % QUARTER == 0 and abs(minutes) <= 60 * LARGEST_OFFSET
    return timezone(timedelta(minutes=minutes)) if is_usual else None


def is_zone_of(text: str, stamp: datetime, time_zone: str) -> bool:
    """Whether an abbreviation is that of a time in the zone of the layout.

    Parameters
    ----------
    text : str
        Abbreviation such as "CEST".
    stamp : datetime
        Time without a zone.
    time_zone : str
        IANA name of the layout's zone.

    Returns
    -------
    bool
        True for "CEST" and "MESZ" in summer, "CET" and "MEZ" in winter, for Europe/Zurich.

    Examples
    --------
    >>> is_zone_of("MESZ", datetime(2026, 5, 13), "Europe/Zurich"), is_zone_of("MEZ", datetime(2026, 5, 13), "UTC")
    (True, False)
    """
    name = stamp.replace(tzinfo=ZoneInfo(time_zone)).tzname()
    return SAME_ABBREVIATIONS.get(text.upper(), text.upper()) == name


def zone_problem(record: RawRecord, time_zone: str) -> str:
    """What a remark says about a zone of the file that cannot be read, "" if it is that of the layout.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.
    time_zone : str
        IANA name of the layout's zone.

    Returns
    -------
    str
        One sentence without its full stop.
    """
    if not record.unread_zone or not record.started_at or is_zone_of(record.unread_zone, record.started_at, time_zone):
        return ""
    return f"its time zone {record.unread_zone!r} cannot be read: that of the layout is used, {time_zone}"
