"""Time zone of a start time without one: in its name, "Start (UTC)", or in an entry "time zone" of the metadata."""

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
from turnout.readers.stated_starts import is_start_name, times_of_entry
from turnout.readers.time_texts import parse_time

ZONE_NAME = re.compile(
    r"timezone|zeitzone|tidszone|tijdzone|fuseauhoraire|fusoorario|zonahoraria|fusohorario|strefaczasowa|casovepasmo"
    r"|casovapasmo|aikavyohyke|idozona|saatdilimi|tz|(?:utc|gmt)offset"
)
NO_ZONE = frozenset(("", "-", "none", "n/a", "?", "unknown", "null", "local", "naive"))
OFFSET = re.compile(r"(?:UTC|GMT)? ?([+-])(\d{1,2})(?::?(\d{2}))?")
SAME_ABBREVIATIONS = {"MEZ": "CET", "MESZ": "CEST", "HNEC": "CET", "HAEC": "CEST", "SEČ": "CET", "SELČ": "CEST"}
# Abbreviations that a name may hold; which offset they mean depends on the day and on the country.
ABBREVIATION = re.compile(r"\b(?:CES?T|MES?Z|WES?T|EES?T|BST|HNEC|HAEC|SEL?Č)\b")
# Of zones outside Europe, which count in the name of a start or a clock; without brackets only those that are no words.
FOREIGN = r"[ECMP][SD]T|AK[SD]T|A[DS]T|HST|N[SD]T|NZ[SD]T|A[EC][SD]T|AWST|JST|KST|MSK|HKT|SGT|PHT|PKT|SAST|BRT|UT"
FOREIGN_ALONE = re.compile(rf"\b(?:{FOREIGN})\b")
FOREIGN_IN_BRACKETS = re.compile(rf"{FOREIGN}|[GI]ST|[ECW]AT|[AT]RT|ICT|IDT|WIB")
# Words of zones as Windows and Java print them -> their abbreviations in winter and in summer.
ZONES_IN_WORDS = {
    **dict.fromkeys(("w. europe", "central europe", "central european", "romance"), ("CET", "CEST")),
    **dict.fromkeys(("e. europe", "eastern european", "fle", "gtb"), ("EET", "EEST")),
    **dict.fromkeys(("gmt", "british", "greenwich"), ("GMT", "BST")),
    "western european": ("WET", "WEST"),
    "eastern": ("EST", "EDT"),
    "central": ("CST", "CDT"),
    "mountain": ("MST", "MDT"),
    "pacific": ("PST", "PDT"),
}
ZONE_IN_WORDS = re.compile(r"(?!local )((?:[a-z]+\.? ){1,3})(standard|daylight|summer) time", re.IGNORECASE)
# A zone without the word; a bare offset may be a duration or a ratio as well.
ZONE_ALONE = re.compile(r"(?:UTC|GMT)(?: ?[+-]\d{1,2}(?::\d{2})?)?")
# Names of which every word is one of these, and one of TIME, state the zone of the start: "Time base", "Zeitreferenz".
TIME = re.compile(
    r"times?|timestamps?|zeit(?:en|stempel|referenz|basis|bezug|format|system)?|uhrzeit|heures?|horodatages?|tid|tijd"
    r"|hora|cas|czas|ora"
)
BESIDE_TIME = re.compile(
    r"start|record(?:ed|ing)?|all|the|of|is|are|in|reference|ref|standard|base|basis|system|format|local|logger|der|die|des"
)
CLOCK_WORD = re.compile(r"clock|uhr|horloge|klok|ur|reloj|orologio")
# Names of the source of a clock and of places: an abbreviation under them is no zone of the start.
NO_CLOCK = re.compile(
    r"sync\w*|ntp|ptp|gps|gnss|source|quelle|display|anzeige|track|gleis|line|strecke|depot|station|train|zug"
)
# Words for the two states of a clock that is put forward in summer, without accents.
SUMMER = re.compile(
    r"\b(?:dst|daylight (?:saving|time)s?|summer ?time|sommerzeit|sommertid|zomertijd|letni cas|czas letni|ora legale"
    r"|heure d ete|hor(?:a|ario) de verano)\b"
)
WINTER = re.compile(
    r"\b(?:winter ?time|winterzeit|normalzeit|vintertid|wintertijd|zimni cas|czas zimowy|ora solare|heure d hiver"
    r"|hor(?:a|ario) de invierno)\b"
)
DENIALS = frozenset("off no false none not non nein nej nee ne nie aus 0 disabled inactive".split())
STAMP_AND_ZONE = re.compile(
    r"(.*\d(?: ?[AaPp]\.?[Mm]\.?)?)(?: ?[\[(]| )"
    r"((?![AP]M\b)[A-Z]{1,5}(?: ?[+-]\d{1,2}(?::?\d{2})?|\d[A-Z]{3})?|[A-Z]\w+/[\w/]+|(?:[A-Z]\w*\.? ){1,3}\w+ Time)"
    r"[\])]?"
)
ZONE_BEFORE_YEAR = re.compile(r"(.*\d:\d{2}) ([A-Z]{2,5}) (\d{4})")  # as the program "date" prints it
UTC_OFFSET = re.compile(r"(?:UTC|GMT) ?[+-]\d{1,2}(?::?\d{2})?(?!\d)", re.IGNORECASE)
IN_BRACKETS = re.compile(r"[\[(]([^\[\]()]+)[\])]")
OR = " or "  # between zones that a file states
MAX_SHOWN = 120  # characters of them
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
    record = _with_zone_of_stamp(record)
    if record.started_at is None or record.started_at.tzinfo is not None or record.unread_zone:
        return record
    in_names = [text for name in _names_of_start(record) if (text := zone_in_name(name))]
    texts = list(dict.fromkeys(in_names or _zone_texts(record.entries)))
    if not texts:
        texts = list(dict.fromkeys(_zones_of_other_names(record.entries)))
        texts += dict.fromkeys(_season_texts(record.entries))
        return replace(record, unread_zone=OR.join(texts)[:MAX_SHOWN]) if texts else record
    zones = {zone for text in texts if (zone := zone_of(text))}
    if len(zones) == 1 and len(texts) == 1:
        return replace(record, started_at=record.started_at.replace(tzinfo=zones.pop()))
    texts += dict.fromkeys(_season_texts(record.entries))
    return replace(record, unread_zone=OR.join(texts)[:MAX_SHOWN]) if texts else record


def _with_zone_of_stamp(record: RawRecord) -> RawRecord:
    """The record with the start that was not read because a zone stands behind it, as "CEST" or "Europe/Berlin"."""
    stamp, text = stamp_and_zone(record.unread_start) if record.started_at is None else (None, "")
    zone = zone_of(text)
    if stamp is None or (zone is None and not ABBREVIATION.fullmatch(text)):
        return record
    return replace(record, started_at=stamp.replace(tzinfo=zone), unread_start="", unread_zone="" if zone else text)


@lru_cache(maxsize=4096)
def stamp_and_zone(text: str) -> tuple[datetime | None, str]:
    """Time stamp without a zone and the name of the zone that stands behind it.

    Parameters
    ----------
    text : str
        Start of a record.

    Returns
    -------
    tuple of (datetime or None, str)
        (None, "") for any other text.

    Examples
    --------
    >>> stamp_and_zone("2026-05-13 18:30 EDT"), stamp_and_zone("Wed May 13 18:30:00 PST 2026")[1]
    ((datetime.datetime(2026, 5, 13, 18, 30), 'EDT'), 'PST')
    """
    if match := ZONE_BEFORE_YEAR.fullmatch(text):
        stamp, zone = parse_time(f"{match[1]} {match[3]}"), match[2]
    elif match := STAMP_AND_ZONE.fullmatch(text):
        stamp, zone = parse_time(match[1]), match[2]
    else:
        return None, ""
    return (stamp, zone) if stamp and stamp.tzinfo is None else (None, "")


def with_zone_of_layout(record: RawRecord, time_zone: str) -> RawRecord:
    """The record with the start that was not read because of the abbreviation behind it, if it is the layout's zone.

    Parameters
    ----------
    record : RawRecord
        The record as its reader returns it.
    time_zone : str
        IANA name of the layout's zone.

    Returns
    -------
    RawRecord
        Unchanged for an abbreviation that the zone of the layout does not have on that day.
    """
    stamp, zone = stamp_and_zone(record.unread_start) if record.started_at is None else (None, "")
    if stamp is None or not is_zone_of(zone, stamp, time_zone):
        return record
    return replace(record, started_at=stamp, unread_start="")


def _names_of_start(record: RawRecord) -> list[str]:
    """Names of the entries that state the start of a record; without any, those of its time axes."""
    names = [
        entry.name
        for entry in record.entries
        if is_start_name(entry.name) and any(time == record.started_at for _, time in times_of_entry(entry))
    ]
    return names or [record.time_label, *(place for place, _ in record.clocks), *record.names]


@lru_cache(maxsize=4096)
def zone_in_name(name: str) -> str:
    """Time zone in the name of a start time or a time column, as ``zone_of`` reads it.

    Parameters
    ----------
    name : str
        Name of an entry or a column, with its unit.

    Returns
    -------
    str
        "" if the name holds none.

    Examples
    --------
    >>> [zone_in_name(n) for n in ("start_time_utc", "Start (UTC+2)", "Time [Europe/Zurich]", "Zeit (MEZ)", "t [s]")]
    ['UTC', 'UTC+2', 'Europe/Zurich', 'MEZ', '']
    """
    if match := UTC_OFFSET.search(name):
        return match[0]
    if {"utc", "gmt"} & set(words_of(name)):
        return "UTC"
    texts = [text.strip() for text in IN_BRACKETS.findall(name)]
    spaced = name.replace("_", " ")
    abbreviation = ABBREVIATION.search(spaced) or FOREIGN_ALONE.search(spaced)
    of_brackets = (t for t in texts if not t.isdigit() and (zone_of(t) or FOREIGN_IN_BRACKETS.fullmatch(t)))
    return next(of_brackets, abbreviation[0] if abbreviation else "")


def _zone_texts(entries: tuple[Entry, ...]) -> tuple[str, ...]:
    """Zones of entries under such a name, else of those whose whole name speaks of the time, as "Time base: UTC"."""
    texts = [
        (entry.name, " ".join(str(entry.value).split()))
        for entry in entries
        if isinstance(entry.value, (str, int, float, np.number)) and not isinstance(entry.value, bool)
    ]
    named = tuple(text for name, text in texts if _is_zone_name(name) and text.casefold() not in NO_ZONE)
    return named or tuple(text for name, text in texts if ZONE_ALONE.fullmatch(text) and _is_time_name(name))


@lru_cache(maxsize=4096)
def _is_time_name(name: str) -> bool:
    words = words_of(name)
    return any(map(TIME.fullmatch, words)) and all(TIME.fullmatch(w) or BESIDE_TIME.fullmatch(w) for w in words)


def _zones_of_other_names(entries: tuple[Entry, ...]) -> Iterator[str]:
    """Abbreviations of zones under any name: they are reported, and never change the start."""
    for entry in entries:
        if isinstance(entry.value, str) and not entry.is_piece:
            text = " ".join(entry.value.split())
            is_zone = bool(ZONE_ALONE.fullmatch(text) or (text != "WEST" and ABBREVIATION.fullmatch(text)))
            is_zone = is_zone or (_is_clock_name(entry.name) and _is_foreign(text))
            if is_zone and not any(map(NO_CLOCK.fullmatch, words_of(entry.name))):
                yield text


@lru_cache(maxsize=4096)
def _is_clock_name(name: str) -> bool:
    return any(TIME.fullmatch(word) or CLOCK_WORD.fullmatch(word) for word in words_of(name))


def _is_foreign(text: str) -> bool:
    return bool(FOREIGN_IN_BRACKETS.fullmatch(text) or ZONE_IN_WORDS.fullmatch(text))


def _season_texts(entries: tuple[Entry, ...]) -> Iterator[str]:
    """Entries that say whether the clock shows summer or winter time, "DST: off"."""
    for entry in entries:
        if isinstance(entry.value, (str, int, np.bool_)) and not entry.is_piece:
            text = f"{entry.name}: {entry.value}"
            if is_summer_time(text) is not None:
                yield text


@lru_cache(maxsize=4096)
def is_summer_time(text: str) -> bool | None:
    """Whether a text says that the clock shows summer time.

    Parameters
    ----------
    text : str
        Name and value of an entry.

    Returns
    -------
    bool or None
        None for a text that speaks of neither, or of a temperature in summer and the like.

    Examples
    --------
    >>> [is_summer_time(text) for text in ("DST: off", "Sommerzeit: ja", "Clock: winter time", "Site: summer")]
    [False, True, False, None]
    """
    if len(text) > MAX_SEASON_TEXT:
        return None
    spaced = " ".join(words_of(text.replace(": 0", ": no")))
    is_summer, is_winter = bool(SUMMER.search(spaced)), bool(WINTER.search(spaced))
    if is_summer == is_winter:
        return None
    is_denied = not DENIALS.isdisjoint(spaced.split())
    return is_summer != is_denied


MAX_SEASON_TEXT = 60  # characters


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
    if text.upper() in ("UTC", "UT", "Z", "ZULU", "GMT", "ETC/UTC"):
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
    except (ValueError, OSError, KeyError):  # ZoneInfoNotFoundError is a KeyError
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
        Abbreviation such as "CEST", or an entry about summer time.
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
    local = stamp.replace(tzinfo=ZoneInfo(time_zone))
    if ZONE_ALONE.fullmatch(text) and (zone := zone_of(text)):
        return local.utcoffset() == zone.utcoffset(stamp)
    if in_words := ZONE_IN_WORDS.fullmatch(text):
        names = ZONES_IN_WORDS.get(in_words[1].strip().lower(), ())
        is_standard = in_words[2].lower() == "standard"  # which Windows prints in summer, too
        return local.tzname() in (names if is_standard else names[1:])
    if (is_summer := is_summer_time(text)) is not None:
        return is_summer == bool(local.dst())
    return SAME_ABBREVIATIONS.get(text.upper(), text.upper()) == local.tzname()


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
    if not record.unread_zone or not record.started_at:
        return ""
    if all(is_zone_of(text, record.started_at, time_zone) for text in record.unread_zone.split(OR)):
        return ""
    if all(ZONE_ALONE.fullmatch(text) for text in record.unread_zone.split(OR)):
        return f"{record.unread_zone!r} may be its time zone: that of the layout is used, {time_zone}"
    return f"its time zone {record.unread_zone!r} cannot be read: that of the layout is used, {time_zone}"
