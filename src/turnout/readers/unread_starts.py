"""Dates with a time of day in a file of which no start was read: one of them may be the start, so they are reported."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np

from turnout.errors import ReadError
from turnout.readers.entries import Entry
from turnout.readers.rate_units import words_of
from turnout.readers.source import RawRecord
from turnout.readers.stamp_texts import with_western_marks
from turnout.readers.stated_starts import DATE_WORD, OTHER, TIME_WORD, is_start_name
from turnout.readers.time_numbers import SINCE
from turnout.readers.time_texts import stated_time, time_of_vector

YEAR = r"(?:19|20)\d{2}"
DATE = (
    rf"(?:{YEAR}[-./]\s?\d{{1,2}}[-./]\s?\d{{1,2}}|\d{{1,2}}[-./]\s?\d{{1,2}}[-./]\s?(?:{YEAR}|\d{{2}})"
    rf"|\d{{1,2}}\.?[ -](?:de )?[^\W\d]{{3,}}\.?[ -](?:de )?{YEAR}|[^\W\d]{{3,}}\.? \d{{1,2}},? {YEAR})"
)
CLOCK = r"\d{1,2}(?::\d{2}(?::\d{2})?|\s?h\s?\d{2}|\.\d{2}\.\d{2})"
MOMENT = re.compile(
    rf"(?<![\d.,]){DATE}(?!\d)\D{{1,12}}{CLOCK}(?!\d)|(?<![\d.,]){CLOCK}\D{{1,12}}{DATE}(?!\d)"
    rf"|[^\W\d]{{3,}}\.? +\d{{1,2}} +{CLOCK} +{YEAR}(?!\d)"
    rf"|(?<!\d){YEAR}(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])[T _-](?:[01]\d|2[0-3])[0-5]\d"
)
DAY_ALONE, CLOCK_ALONE = (
    re.compile(DATE),
    re.compile(rf"{CLOCK}(?:\s?m\s?\d{{2}}\s?s?)?(?:[.,]\d+)?(?:\s?(?:[AaPp][Mm]|Uhr|h))?"),
)
# Whole words for events that are no start, beside those of ``stated_starts``, without accents.
OTHER_EVENT = re.compile(
    r"generated|output|diadem|written|report(?:ed)?|processed|evaluated|filtered|sent|received|downloaded|transferred"
    r"|approved|reviewed|verified|inspected|checked|gepruft|geprueft|geandert|geaendert|bearbeitet|ausgegeben|ausgewertet"
    r"|stand|eksporteret|[ae]?ndret|aendret|\u00e6ndret|oprettet|hentet|verifiee?|built|baujahr|weld(?:ed|ing)?|laid|glued"
    r"|commissioned|delivered|zero(?:ed)?|tared?|balanced|nullabgleich|boot(?:ed)?|power|uptime|possession|closure"
    r"|sperrpause|shift|schicht|arbeitszeit|licen[sc]e|lizenz|copyright|battery|batterie|akku|cal|forecast|weather|wetter"
    r"|inventarisiert|inventory|drawing|part"
)
# Names of a date and of a time of day in other languages, beside those of ``stated_starts``.
DAY_WORD = re.compile(r"day|tag|dag|jour|giorno|dia|data|den|dzien|paiva\w*|pvm|tarih|nap|measured|gemessen|taken")
CLOCK_WORD = re.compile(r"saat|saa|kello\w*|aika|ido|kl|um|at|gmt|utc")
YEAR_OF_FOUR_DIGITS = re.compile(rf"(?<!\d){YEAR}(?!\d)")
DAY_IN_NAME = re.compile(rf"(?<!\d)({YEAR})([-_.]?)(0[1-9]|1[0-2])\2(0[1-9]|[12]\d|3[01])(?!\d)")
DAY_IN_TEXT = re.compile(
    rf"(?<!\d)(?:({YEAR})[-./]?\s?(\d{{1,2}})[-./]?\s?(\d{{1,2}})|(\d{{1,2}})[-./]\s?(\d{{1,2}})[-./]\s?({YEAR}))"
)
MAX_TEXT = 200  # characters of a text that is searched
MAX_SHOWN = 60  # characters of an entry in the message


def with_unread_starts(records: Sequence[RawRecord | ReadError]) -> tuple[RawRecord | ReadError, ...]:
    """The records with the text of a date and a time of day as their unread start, if none of them has a start.

    Parameters
    ----------
    records : sequence of RawRecord or ReadError
        The records of a file, with the starts that were read.

    Returns
    -------
    tuple of (RawRecord or ReadError)
        The same records if one has a start or an unread one, or if nothing in the file may be one.
    """
    intact = [record for record in records if isinstance(record, RawRecord)]
    if any(record.started_at or record.unread_start for record in intact):
        return tuple(records)
    return tuple(
        replace(record, unread_start=text)
        if isinstance(record, RawRecord) and (text := possible_start(record))
        else record
        for record in records
    )


def possible_start(record: RawRecord) -> str:
    """Entry of a record that may state its start under a name that is not known.

    Parameters
    ----------
    record : RawRecord
        A record without a start.

    Returns
    -------
    str
        Name and value of the first with a date and a time of day, else of two of which one is called a date and one a
        time of day; "" if each is about another event, such as an export, a calibration or the end.
    """
    entries = [e for e in record.entries if not e.is_piece and not _is_of_other(e.name)]
    if times := [text for e in entries if not isinstance(e.value, str) and (text := _text_of_time(e))]:
        return times[0]
    entries = [e for e in entries if isinstance(e.value, str) and not SINCE.search(e.value)]
    if moment := next(_moments(entries), ""):
        return moment
    dated = [e for e in entries if _is_named(e.name, DATE_WORD, DAY_WORD) and YEAR_OF_FOUR_DIGITS.search(e.value)]
    days = [entry for entry in dated if DAY_ALONE.fullmatch(entry.value.strip())]
    entries = [e for e in entries if _is_named(e.name, TIME_WORD, CLOCK_WORD)]
    clocks = [e for e in entries if CLOCK_ALONE.fullmatch(e.value.strip()) and not DAY_ALONE.fullmatch(e.value.strip())]
    clocks = clocks or [e for e in days[1:] if CLOCK_ALONE.fullmatch(e.value.strip())]
    return f"{_quotation(days[0])}; {_quotation(clocks[0])}" if days and clocks else ""


def _text_of_time(entry: Entry) -> str:
    """Name and time of an entry that is a time stamp or counts from a declared origin; "" for a time of no logger."""
    if time_of_vector(entry.value):
        return f"{entry.name}: {entry.value}"
    is_stamp = isinstance(entry.value, datetime | np.datetime64)
    if np.ndim(entry.value) or not (is_stamp or SINCE.search(entry.name)):
        return ""
    time, _ = stated_time(entry.value, entry.name)
    return f"{entry.name}: {entry.value}{'' if is_stamp else f' ({time:%Y-%m-%d %H:%M:%S})'}" if time else ""


def _moments(entries: Sequence[Entry]) -> Iterator[str]:
    """Entries with a date and a time of day of which no word before it speaks of another event."""
    for entry in entries:
        text = with_western_marks(entry.value[:MAX_TEXT])
        match = MOMENT.search(text)
        if match and not _is_of_other(text[: match.start()]):
            yield _quotation(entry)


def _quotation(entry: Entry) -> str:
    return f"{entry.name}: {entry.value.strip()[:MAX_SHOWN]}"


def _is_of_other(text: str) -> bool:
    return any(OTHER.search(word) or OTHER_EVENT.fullmatch(word) for word in words_of(text))


def _is_named(name: str, *patterns: re.Pattern[str]) -> bool:
    return (
        is_start_name(name)
        or any(pattern.search(word) for pattern in patterns[:1] for word in words_of(name))
        or any(pattern.fullmatch(word) for pattern in patterns[1:] for word in words_of(name))
    )


def is_of_other_day(text: str, file_name: str) -> bool:
    """Whether a possible start is of another day than the name of its file, so that it is of another event.

    Parameters
    ----------
    text : str
        As ``possible_start`` returns it.
    file_name : str
        Name of the file, with its folders.

    Returns
    -------
    bool
        False if either has no day that can be read.

    Examples
    --------
    >>> [is_of_other_day(text, "s1/2024-05-13/a.csv") for text in ("Glue: 12.05.2024 10:00", "Glue: 2024-05-13 10:00")]
    [True, False]
    """
    days = {(int(y), int(m), int(d)) for y, _, m, d in DAY_IN_NAME.findall(file_name)}
    stated = set()
    for y, m, d, first, second, year in DAY_IN_TEXT.findall(text):
        stated |= (
            {(int(y), int(m), int(d))}
            if y
            else {(int(year), int(second), int(first)), (int(year), int(first), int(second))}
        )
    name, mark, _ = text.partition(": ")
    return bool(mark and days and stated) and not is_start_name(name) and days.isdisjoint(stated)
