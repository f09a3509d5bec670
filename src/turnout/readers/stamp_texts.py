"""Notations of times that become one: days of the year, weeks, months as words, ISO durations, fractions behind colons.

Loggers print "2026-332T07:28:14", "28-Nov-2026 07:28:14", "PT0.5S" and "07:28:14:000050". They are rewritten as a
date of the calendar, a count of days and a decimal fraction, which all other modules read.
"""

import re
import unicodedata
from datetime import date

CLOCK_AHEAD = r"(?=[T ,_:]+\d{1,2}:\d{2})"
# Year and day of the year; only if a time of day follows.
DAY_OF_YEAR = re.compile(rf" *((?:19|20)\d{{2}})[-: ./]?(\d{{3}}){CLOCK_AHEAD}[T ,_:]+")
WEEK = re.compile(rf" *(\d{{4}})-?W(\d{{2}})-?(\d){CLOCK_AHEAD}[T ,_:]+")
DAY_AND_MONTH = re.compile(
    rf" *(\d{{1,2}})[-. /]{{1,2}}([^\W\d_]{{3,9}})\.?[-, /]{{1,2}}(\d{{4}}){CLOCK_AHEAD}[T ,_:]+"
)
MONTH_AND_DAY = re.compile(rf" *([^\W\d_]{{3,9}})\.?[- ](\d{{1,2}}),? (\d{{4}}){CLOCK_AHEAD}[T ,_:]+")
# The same as a cell of its own, beside a time of day in another one; 2026332 and 2026.332 are numbers there.
DAYS_ALONE = {
    DAY_OF_YEAR: re.compile(r" *((?:19|20)\d{2})-(\d{3}) *"),
    WEEK: re.compile(r" *(\d{4})-W(\d{2})-(\d) *"),
    DAY_AND_MONTH: re.compile(r" *(\d{1,2})[-. /]{1,2}([^\W\d_]{3,9})\.?[-, /]{1,2}(\d{4}) *"),
    MONTH_AND_DAY: re.compile(r" *([^\W\d_]{3,9})\.?[- ](\d{1,2}),? (\d{4}) *"),
}
DIGITS_ALONE = re.compile(r" *(\d{4})(\d{2})(\d{2})[T_](\d{2})(\d{2})(\d{2})(?=[.,Z+-]|$)")
# A time of day without colons behind a date, "2026-05-13 0820Z", and all in one word as armed forces write it.
COMPACT_CLOCK = re.compile(
    r"([T ,_]+)([01]\d|2[0-3])([0-5]\d)([0-5]\d)?"
    r"(?=(?:[.,]\d+)?(?: ?(?:Z|UTC|GMT|[+-]\d{2}:?\d{2}))?(?: ?h(?:rs?)?)?$)"
)
DATE_AHEAD = re.compile(
    r"(?:\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}(?:[-/.]\d{1,2}[-/.]|\.?[- ]?[^\W\d_]{3,9}\.?[-, ]*)\d{4})(?=[T ,_])"
)
DATE_TIME_GROUP = re.compile(r"(\d{2}) ?(\d{2})(\d{2}) ?([A-IK-Z]) ?([A-Za-z]{3}) ?(20\d{2}|\d{2})")
ZONE_LETTERS = {letter: k for k, letter in enumerate("YXWVUTSRQPONZABCDEFGHIKLM", start=-12)}  # h before UTC
# A time since the start with its unit, as MATLAB writes those of a timetable: "5e-05 sec".
WITH_UNIT = re.compile(r" *(\d{1,12}(?:[.,]\d{1,20})?(?:[eE][+-]?\d{1,2})?) ?(h|hr|min|s|sec|ms|[µ\u03bcu]s|ns) *")
SECONDS = {"h": 3600, "hr": 3600, "min": 60, "s": 1, "sec": 1, "ms": 1e-3, "ns": 1e-9}  # of µs in any letters: 1e-6
DURATION = re.compile(r" *P(?:(\d{1,5})D)?T(?:(\d{1,6})H)?(?:(\d{1,8})M)?(?:(\d{1,10})([.,]\d{1,12})?S)? *")
# A fraction behind a colon has as many digits as ms, µs or ns; two would be frames of a film.
FRACTION = re.compile(r"(\d{1,2}:\d{2}:\d{2}):(\d{9}|\d{6}|\d{3})(?:[.,](\d{3}|\d{6}))?(?!\d)")
# Dates and times of day in Chinese, Japanese and Korean; "上午", "午前" and "오전" mean before noon.
EAST_ASIAN_DAY = re.compile(
    r"((?:19|20)\d{2})\s?[年년]\s?(\d{1,2})\s?[月월]\s?(\d{1,2})\s?[日일]\s*(?:[(（]\w+[)）]\s*)?"
)
EAST_ASIAN_CLOCK = re.compile(
    r"(?:(?:(?P<am>上午|午前|오전)|(?P<pm>下午|午後|오후))\s?)?"
    r"(?<![\d:+-])(\d{1,2})(?:\s?[时時点點시]\s?|:)(\d{1,2})(?:\s?[分분]\s?|:|(?!\d))(\d{1,2}(?:[.,]\d+)?)?(?:\s?[秒초])?"
)
EAST_ASIAN_MARK = re.compile("[年년时時点點시午오]")
YEAR_MONTH_DAY = re.compile(
    r" *((?:19|20)\d{2})\. ?(\d{1,2})\. ?(\d{1,2})\. +(?=[^\d]{0,3}\d{1,2}:)"
)  # Korean, Hungarian
ZONE_NAME = re.compile(r"(?<=\d|Z)\[[A-Za-z_]+(?:/[\w+-]+)*\]$")  # behind an offset, as Java and RFC 9557 print it
# Beginnings of months in English, German, French, Danish, Italian and Spanish.
MONTH_WORDS = {
    1: "jan gen ene", 2: "feb fev", 3: "mar mrz maer", 4: "apr avr abr", 5: "may mai maj mag", 6: "jun juin giu",
    7: "jul juil lug", 8: "aug aou ago", 9: "sep set", 10: "oct okt ott", 11: "nov", 12: "dec dez dic des",
}  # fmt: skip
# Weekdays without "day", "tag", "dag", "di" behind them: English, German, French, Danish, Italian, Spanish, Dutch.
WEEKDAYS = frozenset(
    """
    mon tue tues wed wednes thu thur thurs fri sat satur sun mo di mi do fr sa so die diens mit mittwoch donners frei
    sams sonnabend sonn lun mar mercre mer jeu vendre ven same sam dimanche dim man tir tirs tis ons tor tors fre
    lør søn lor son ma ti on to lø sø mercole gio giove vener sab sabato dom domenica lunes martes mie miercoles jueves
    jue viernes vie sabado domingo maan dins woens donder vrij zater zon wo vr za zo
    """.split()
)


def is_weekday(word: str) -> bool:
    """Whether a word is the name of a weekday, or its beginning.

    Parameters
    ----------
    word : str
        Without a dot behind it.

    Returns
    -------
    bool
        Accents do not matter.

    Examples
    --------
    >>> [is_weekday(word) for word in ("Wed", "Mittwoch", "mercredi", "lørdag", "sábado", "May", "UTC")]
    [True, True, True, True, True, False, False]
    """
    letters = unicodedata.normalize("NFKD", word.casefold())
    plain = "".join(c for c in letters if not unicodedata.combining(c))
    return bool({plain, re.sub(r"(?:day|tag|dag|di)$", "", plain)} & WEEKDAYS)


def month_of(text: str) -> int:
    """Number of the only month that a text names.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    int
        0 for none or several.

    Examples
    --------
    >>> month_of("13. März 2024"), month_of("Mon May 13"), month_of("12:30")
    (3, 5, 0)
    """
    letters = unicodedata.normalize("NFKD", text.casefold())
    words = re.findall(r"[a-z]{3,}", "".join(c for c in letters if not unicodedata.combining(c)))
    months = {k for word in words for k, starts in MONTH_WORDS.items() if word.startswith(tuple(starts.split()))}
    return months.pop() if len(months) == 1 else 0


def plain_stamp(text: str) -> str:
    """A time stamp in the notation that all modules read; any other text unchanged.

    Parameters
    ----------
    text : str
        A cell or a value.

    Returns
    -------
    str
        With the date as YYYY-MM-DD, a duration as a count of days and hours, a fraction behind a point.

    Examples
    --------
    >>> plain_stamp("2026-332T07:28:14.5"), plain_stamp("28-Nov-2026 07:28:14:000050")
    ('2026-11-28T07:28:14.5', '2026-11-28T07:28:14.000050')
    >>> plain_stamp("PT90.5S"), plain_stamp("13.05.2026 10:00:00,5")
    ('0 days 00:01:30.5', '13.05.2026 10:00:00,5')
    >>> plain_stamp("5e-05 sec"), plain_stamp("1.5 hr")
    ('0 days 00:00:00.000050000000', '0 days 01:30:00.000000000000')
    """
    if text.lstrip()[:1] == "P" and (match := DURATION.fullmatch(text)) and any(match.groups()):
        days, hours, minutes, seconds = (int(number or 0) for number in match.groups()[:4])
        minutes, seconds = minutes + seconds // 60, seconds % 60
        hours, minutes = hours + minutes // 60, minutes % 60
        return f"{days + hours // 24} days {hours % 24:02}:{minutes:02}:{seconds:02}{match[5] or ''}"
    if text.rstrip()[-1:] in "cshnr" and (match := WITH_UNIT.fullmatch(text)):
        duration = round(float(match[1].replace(",", ".")) * SECONDS.get(match[2], 1e-6), 12)
        hour, minute = divmod(int(duration // 60.0), 60)
        return f"{hour // 24} days {hour % 24:02}:{minute:02}:{duration % 60.0:015.12f}"
    text = YEAR_MONTH_DAY.sub(_with_dashes, with_western_marks(ZONE_NAME.sub("", text)))
    text = FRACTION.sub(lambda match: f"{match[1]}.{match[2]}{match[3] or ''}", text)
    if match := DIGITS_ALONE.match(text):
        text = "{}-{}-{}T{}:{}:{}".format(*match.groups()) + text[match.end() :]
    for pattern, alone in DAYS_ALONE.items():
        if (match := alone.fullmatch(text)) and (day := _day_of(pattern, *match.groups())):
            return day.isoformat()
    return with_calendar_date(text)


def with_colons(text: str) -> str:
    """A time stamp with colons in its time of day: behind a date, or in a date-time group of armed forces.

    Parameters
    ----------
    text : str
        A value.

    Returns
    -------
    str
        Unchanged without such a time of day.

    Examples
    --------
    >>> with_colons("2026-05-13 0820Z"), with_colons("13 May 2026 102030"), with_colons("131020BMAY26")
    ('2026-05-13 08:20Z', '13 May 2026 10:20:30', '2026-05-13T10:20:00+02:00')
    """
    if (match := DATE_TIME_GROUP.fullmatch(text.strip())) and (month := month_of(match[5])):
        day, hour, minute, letter = match.groups()[:4]
        return f"20{match[6][-2:]}-{month:02}-{day}T{hour}:{minute}:00{ZONE_LETTERS[letter]:+03}:00"
    if not (date_ahead := DATE_AHEAD.match(text)):
        return text
    if not (match := COMPACT_CLOCK.match(text, date_ahead.end())):
        return text  # also digits behind a time of day with colons: they are its fraction
    return text[: match.start(2)] + ":".join(filter(None, match.groups()[1:])) + text[match.end() :]


def with_western_marks(text: str) -> str:
    """A time stamp with the words of Chinese, Japanese and Korean between its numbers replaced by dashes and colons.

    Parameters
    ----------
    text : str
        A cell or a value.

    Returns
    -------
    str
        Unchanged without such a word.

    Examples
    --------
    >>> with_western_marks("2026年5月13日 0时30分05秒"), with_western_marks("2026-05-13 下午3:05:00")
    ('2026-05-13 00:30:05', '2026-05-13 03:05:00 PM')
    """
    if not EAST_ASIAN_MARK.search(text):
        return text
    text = EAST_ASIAN_DAY.sub(_with_dashes, text)
    return EAST_ASIAN_CLOCK.sub(_western_clock, text).strip()


def _with_dashes(match: re.Match[str]) -> str:
    return f"{match[1]}-{match[2]:0>2}-{match[3]:0>2} "


def _western_clock(match: re.Match[str]) -> str:
    hour, minute, second = match.groups()[2:]
    half = " AM" if match["am"] else " PM" if match["pm"] else ""
    return f"{hour:0>2}:{minute:0>2}:{second or '00':0>2}{half}"


def with_calendar_date(text: str) -> str:
    """A time stamp with its day of the year, its week or its month in a word replaced by a date YYYY-MM-DD.

    Parameters
    ----------
    text : str
        A cell or a value.

    Returns
    -------
    str
        Unchanged without such a day, or with one that no calendar has.

    Examples
    --------
    >>> with_calendar_date("2026332 07:28:14"), with_calendar_date("2026-W48-6T07:28:14")
    ('2026-11-28T07:28:14', '2026-11-28T07:28:14')
    """
    for pattern in (DAY_OF_YEAR, WEEK, DAY_AND_MONTH, MONTH_AND_DAY):
        if (match := pattern.match(text)) and (day := _day_of(pattern, *match.groups())):
            return f"{day.isoformat()}T{text[match.end() :]}"
    return text


def _day_of(pattern: re.Pattern[str], *parts: str) -> date | None:
    """The day that the parts of a match state, None if no calendar has it."""
    try:
        if pattern is DAY_OF_YEAR:
            first = date(int(parts[0]), 1, 1)
            day = date.fromordinal(first.toordinal() + int(parts[1]) - 1)
            return day if day.year == first.year and int(parts[1]) else None
        if pattern is WEEK:
            return date.fromisocalendar(*map(int, parts))
        number, word = parts[:2] if pattern is DAY_AND_MONTH else parts[1::-1]
        return date(int(parts[2]), month_of(word), int(number))
    except ValueError:
        return None
