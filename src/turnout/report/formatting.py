"""Format numbers with their 95 % interval, days, and states for pages."""

from __future__ import annotations

import html
import math
import re
from datetime import datetime
from functools import cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from typing import Any

BADGES = {
    "confirm now": "confirm",
    "inspect this week": "inspect",
    "plan": "plan",
    "learning": "learning",
    "ok": "ok",
    "cannot tell": "unknown",
    "not measured": "unknown",
    "suppressed": "unknown",
}

EPOCH = datetime(1970, 1, 1)
MARKUP = re.compile("[&<>\"']")  # characters that have a meaning in HTML


def escape(text: str, quote: bool = True) -> str:
    """Text with the characters escaped that have a meaning in HTML.

    Most texts of a chart have none, and to find that out is faster than to replace them.

    Parameters
    ----------
    text : str
        Any text.
    quote : bool
        Whether quotation marks are escaped.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> escape("3 < 4"), escape("receptance [m/N]")
    ('3 &lt; 4', 'receptance [m/N]')
    """
    return html.escape(text, quote) if MARKUP.search(text) else text


@cache
def student_quantile(n: int) -> float:
    r"""97.5 % quantile of Student's t with n - 1 degrees of freedom, from the finite series of its distribution.

    .. math:: P(|t| < \sqrt\nu \tan\theta) = \sin\theta \sum_{k=0}^{\nu/2-1} \frac{(2k-1)!!}{(2k)!!} \cos^{2k}\theta,
              \qquad \tfrac{2}{\pi} \Bigl(\theta + \sin\theta \sum_{k=0}^{(\nu-3)/2}
              \frac{(2k)!!}{(2k+1)!!} \cos^{2k+1}\theta\Bigr)

    for even and odd :math:`\nu`. No page needs scipy for it, which takes 20 MB and a tenth of a second to import.

    Parameters
    ----------
    n : int
        Number of values, at least 2.

    Returns
    -------
    float
        Quantile; nan for fewer values.

    References
    ----------
    Abramowitz and Stegun 1964, 26.7.3 and 26.7.4.

    Examples
    --------
    >>> round(student_quantile(30), 3)
    2.045
    """
    if n < 2:
        return math.nan
    low, high = 0.0, math.pi / 2.0
    while low < (middle := 0.5 * (low + high)) < high:
        if _share_within(middle, int(n) - 1) < 0.95:
            low = middle
        else:
            high = middle
    return math.sqrt(n - 1) * math.tan(middle)


def _share_within(theta: float, degrees: int) -> float:
    """Probability that Student's t is below sqrt(degrees) tan(theta) in magnitude."""
    sine, square, total = math.sin(theta), math.cos(theta) ** 2, 0.0
    is_odd = degrees % 2
    term = math.cos(theta) if is_odd else 1.0
    for k in range(1, (degrees - is_odd) // 2 + 1):
        total += term
        term *= square * (2 * k - 1 + is_odd) / (2 * k + is_odd)
    return 2.0 / math.pi * (theta + sine * total) if is_odd else sine * total


def with_interval(value: float | None, standard_error: float | None, n: int, digits: int = 1) -> str:
    """A value with the half width of its 95 % t interval, which gets one significant digit at least and two at most.

    Parameters
    ----------
    value : float or None
        The value.
    standard_error : float or None
        Its standard error.
    n : int
        Number of values that the error comes from.
    digits : int
        Usual number of decimals.

    Returns
    -------
    str
        Text; "none" without a value, "?" for an unknown error.

    Examples
    --------
    >>> with_interval(154.55, 0.4, 30)
    '154.6 ± 0.8'
    >>> with_interval(154.55, 0.004, 30)
    '154.550 ± 0.008'
    >>> with_interval(0.19321, None, 1, 3)
    '0.193 ± ?'
    >>> with_interval(None, None, 0)
    'none'
    """
    # an error of zero is below the resolution of the registry
    return with_half_width(value, student_quantile(n) * standard_error if standard_error and n > 1 else None, digits)


def with_half_width(value: float | None, half: float | None, digits: int = 1) -> str:
    """A value with half of its interval, which gets one significant digit at least and two at most.

    Parameters
    ----------
    value : float or None
        The value.
    half : float or None
        Half width of the interval, above 0.
    digits : int
        Usual number of decimals.

    Returns
    -------
    str
        Text; "none" without a value, "?" for an unknown interval.

    Examples
    --------
    >>> with_half_width(154.55, 0.004), with_half_width(154.55, None)
    ('154.550 ± 0.004', '154.6 ± ?')
    >>> with_half_width(0.41732, 0.0412, 4), with_half_width(154.55, 23.4)
    ('0.417 ± 0.041', '155 ± 23')
    """
    if value is None:
        return "none"
    n = supported_decimals(half, digits)
    return f"{value:.{n}f} ± {'?' if half is None else f'{half:.{n}f}'}"


def supported_decimals(half: float | None, digits: int) -> int:
    """Decimals of a value that leave one or two significant digits of half its interval.

    Parameters
    ----------
    half : float or None
        Half width of the interval, above 0.
    digits : int
        Usual number of decimals, which holds within these limits and without an interval.

    Returns
    -------
    int
        Number of decimals.

    Examples
    --------
    >>> [supported_decimals(half, 4) for half in (None, 0.00002, 0.0053, 0.0997, 0.13, 7.0)]
    [4, 5, 4, 2, 2, 1]
    """
    if half is None:
        return digits
    if 2.0 * half < 10.0**-digits:
        return -math.floor(math.log10(half))
    exponent = int(f"{half:.1e}".partition("e")[2])  # of the rounded width: 0.0997 is 0.10
    return min(digits, max(0, 1 - exponent))


def day(when: datetime | None) -> str:
    """The day of a time stamp, or a dash.

    Parameters
    ----------
    when : datetime or None
        Time.

    Returns
    -------
    str
        YYYY-MM-DD.
    """
    return "–" if when is None else f"{when:%Y-%m-%d}"


def day_and_time(when: datetime) -> str:
    """The day of work, with its time where it has one: it decides about the tests of that day.

    Parameters
    ----------
    when : datetime
        Time in UTC; midnight stands for the day.

    Returns
    -------
    str
        YYYY-MM-DD, or with "HH:MM UTC" behind it.

    Examples
    --------
    >>> day_and_time(datetime(2026, 4, 2)), day_and_time(datetime(2026, 4, 2, 14, 30))
    ('2026-04-02', '2026-04-02 14:30 UTC')
    """
    return f"{when:%Y-%m-%d %H:%M} UTC" if when.hour or when.minute else f"{when:%Y-%m-%d}"


def campaign_of(row: Mapping[str, Any], time: str = "measured_at_utc") -> str:
    """The name of a campaign, as its folder and ``campaigns.csv`` have it: the local day. Its start in UTC may be a day
    earlier.

    Parameters
    ----------
    row : mapping
        ``campaign_id``, turnout and name with a slash between them, and its start in UTC, each if it has one.
    time : str
        Column of the start, whose day stands for a campaign without an id.

    Returns
    -------
    str
        A dash without either.

    Examples
    --------
    >>> start = datetime(2026, 5, 12, 22, 30)
    >>> campaign_of({"campaign_id": "W5/2026-05-13", "measured_at_utc": start}), campaign_of({"measured_at_utc": start})
    ('2026-05-13', '2026-05-12')
    """
    campaign_id = row.get("campaign_id")
    return campaign_id.rpartition("/")[2] if campaign_id else day(row.get(time))


def badge(state: str) -> str:
    """Style of the badge that shows ``state``.

    Parameters
    ----------
    state : str
        State of a chart.

    Returns
    -------
    str
        Name of the style.
    """
    return BADGES.get(state, "unknown")


def number_ranges(numbers: Iterable[int]) -> str:
    """Whole numbers in words, those in a row as a range.

    Parameters
    ----------
    numbers : iterable of int
        Numbers in any order.

    Returns
    -------
    str
        For example "1 to 3, 7".

    Examples
    --------
    >>> number_ranges([3, 1, 2, 7]), number_ranges([4, 5]), number_ranges([])
    ('1 to 3, 7', '4, 5', '')
    """
    rows: list[list[int]] = []
    for number in sorted(set(numbers)):
        if rows and number == rows[-1][-1] + 1:
            rows[-1].append(number)
        else:
            rows.append([number])
    return ", ".join(
        f"{row[0]} to {row[-1]}" if len(row) > 2 else ", ".join(str(number) for number in row) for row in rows
    )


def seconds(when: datetime) -> float:
    """Time on the axis of a chart.

    Parameters
    ----------
    when : datetime
        Naive UTC.

    Returns
    -------
    float
        Since 1970. [s]

    Examples
    --------
    >>> seconds(datetime(1970, 1, 2))
    86400.0
    """
    return (when - EPOCH).total_seconds()


STIFFNESS_NOTE = (
    "The stiffness behind a resonance holds if all supports around the section have changed alike. Where a diagnosis "
    "names single sleepers, its value counts: that of these sleepers, with their neighbours unchanged."
)


def has_stiffness(worklist: Iterable[Mapping[str, Any]]) -> bool:
    """Whether a row of the worklist states a stiffness, which needs ``STIFFNESS_NOTE``.

    Parameters
    ----------
    worklist : iterable of mapping
        Rows of the worklist.

    Returns
    -------
    bool

    Examples
    --------
    >>> has_stiffness([{"changed_component": None}, {"changed_component": "ballast"}]), has_stiffness([])
    (True, False)
    """
    return any(work.get("changed_component") in ("ballast", "pad", "both") for work in worklist)


def result_and_evidence(diagnosis: str) -> tuple[str, str]:
    """The first clause of a diagnosis, what was found, and the others, which state what it rests on.

    Parameters
    ----------
    diagnosis : str
        Text of ``worklist.diagnosis``.

    Returns
    -------
    (str, str)

    Examples
    --------
    >>> result_and_evidence("hanging sleeper at 36.0 m; 24 hammer tests; no train")
    ('hanging sleeper at 36.0 m', '24 hammer tests; no train')
    """
    result, _, evidence = diagnosis.partition("; ")
    return result, evidence


def diagnoses_once(worklist: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The diagnosis of each row of the worklist, "as above for this turnout" where an earlier row has the same one.

    Parameters
    ----------
    worklist : iterable of mapping
        Rows of the worklist.

    Yields
    ------
    str
        "" for a row without a diagnosis.

    Examples
    --------
    >>> rows = [{"turnout_id": "W1", "diagnosis": words} for words in ("a gap", None, "a gap")]
    >>> list(diagnoses_once(rows))
    ['a gap', '', 'as above for this turnout']
    """
    shown: set[tuple[str, str]] = set()
    for work in worklist:
        diagnosis = work.get("diagnosis") or ""
        key = (work["turnout_id"], diagnosis)
        yield "as above for this turnout" if diagnosis and key in shown else diagnosis
        shown.add(key)


def sorted_statements(detail: str | None) -> list[str]:
    """Statements on a model, those that begin with a frequency in the order of frequencies and after all others.

    Parameters
    ----------
    detail : str or None
        Column ``detail`` of a model: statements with "; " between them.

    Returns
    -------
    list of str
        At least one, which is empty without a detail.

    Examples
    --------
    >>> sorted_statements("701 Hz not used: too weak; 99 Hz not used: damping too high; the fit is poor")
    ['the fit is poor', '99 Hz not used: damping too high', '701 Hz not used: too weak']
    """

    def frequency(statement: str) -> float:
        number, _, quantity = statement.partition(" ")
        return float(number) if quantity.startswith("Hz ") and number.isdecimal() else 0.0

    return sorted((detail or "").split("; "), key=frequency)
