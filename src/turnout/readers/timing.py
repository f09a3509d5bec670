"""Timing of records: sampling rate, time column, start times and the simultaneity of channels.

Rates are compared to the precision with which a file can state them: double, single, or its printed digits.
"""

import math
import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from math import isfinite
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np

from turnout.errors import ReadError
from turnout.readers.source import BLOCK_SIZE, RawRecord, Source

STEP_SAMPLES = 2**21  # samples whose median step is the usual step
MAX_CLOCK_DRIFT = 1e-4  # relative: two clocks of one logger with separate crystals may differ by this much
TIME_UNITS_PER_SECOND = (1.0, 1e3, 1e6)  # a time column without unit may be in s, ms or µs


def rate_of_time(time: np.ndarray) -> tuple[float, float, int | None]:
    r"""Sampling rate of a time column, and the relative precision its digits allow.

    .. math:: f_s = \frac{n - 1}{t_{n-1} - t_0}, \quad
        \mathrm{tolerance} = 2 \max_k \frac{|t_k - t_0 - k / f_s|}{t_{n-1} - t_0}

    Parameters
    ----------
    time : (n,) array of float
        Increasing. [s]

    Returns
    -------
    rate : float
        [Hz]
    tolerance : float
    gap : int or None
        Sample after which time jumps by more than half a step (samples are missing), None if there is none.

    Examples
    --------
    >>> rate, tolerance, gap = rate_of_time(np.array([0.0, 0.01, 0.02, 0.05, 0.06]))
    >>> gap
    2
    """
    time = np.asarray(time, dtype=float)
    span = time[-1] - time[0]
    step = float(np.median(np.diff(time[:STEP_SAMPLES])))
    for start, block in _blocks(time):
        jumps = np.abs(np.diff(block) - step) > 0.5 * step
        if jumps.any():
            return 1.0 / step, 1e-9, start + int(np.argmax(jumps))
    rate = (time.size - 1) / span
    deviation = max(
        np.abs(block - time[0] - np.arange(start, start + block.size) / rate).max() for start, block in _blocks(time)
    )
    return float(rate), float(max(2 * deviation / span, 1e-9)), None


def _blocks(time: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """(first index, samples) of consecutive blocks that share one sample; so hours need little memory."""
    for start in range(0, max(time.size - 1, 1), BLOCK_SIZE):
        yield start, time[start : start + BLOCK_SIZE + 1]


def check_time(time: np.ndarray, where: str, source: Source) -> None:
    """Check that a time column increases evenly.

    Parameters
    ----------
    time : (n,) array of float
        The time column. [s]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If it runs backwards, is not finite, jumps over missing samples, or is not even.
    """
    for start, block in _blocks(time):
        if not np.isfinite(block).all():
            problem = f"the time of sample {start + int(np.argmin(np.isfinite(block)))} is not a number"
            raise source.error(where, problem, reason="not_finite")
    backwards = (start + int(np.argmax(b)) for start, block in _blocks(time) if (b := np.diff(block) <= 0).any())
    if (k := next(backwards, None)) is not None:
        problem = (
            f"the clock runs backwards or stands still: sample {k} at {time[k]:.9g} s, the next at {time[k + 1]:.9g} s"
        )
        remedy = "Check the logger's clock and export the record again"
        raise source.error(where, problem, remedy, reason="clock_backwards")
    rate, _, gap = rate_of_time(time)
    if gap is not None:
        raise source.error(
            where,
            f"time jumps from {time[gap]:.9g} s to {time[gap + 1]:.9g} s at {rate:.6g} Hz: samples are missing",
            "Copy the file again from the logger; if the gap is there too, the logger lost samples",
            reason="truncated",
        )
    _check_even(time, rate, where, source)


def _check_even(time: np.ndarray, rate: float, where: str, source: Source) -> None:
    """ReadError if time deviates from a straight line by more than one step plus the drift of a crystal.

    Rounding to printed digits stays within one step, or time would stand still. Each block has its own line, because
    over hours the temperature shifts a crystal by many steps.
    """
    for start, block in _blocks(time):
        steps = np.arange(block.size)
        offsets = np.abs((block - block[0]) * rate - steps)
        if (is_uneven := offsets > 1.0 + MAX_CLOCK_DRIFT * steps).any():
            k = int(np.argmax(is_uneven))
            problem = (
                f"its time column is not even: sample {start + k}, at {block[k]:.9g} s, is {offsets[k]:.3g} steps from "
                f"where {rate:.6g} Hz put it"
            )
            remedy = "Check the logger's clock, or export the record at an even rate"
            raise source.error(where, problem, remedy, reason="wrong_rate")


def _check_unclear_lines(unclear: Sequence[tuple[str, float]], promised: float, source: Source) -> None:
    """ReadError if a file states frequencies in unknown words and none of them is the rate of the layout."""
    if unclear and all(abs(frequency - promised) > 1e-3 * promised for _, frequency in unclear):
        line = unclear[0][0][:60]
        problem = f"{line!r} may be a sampling rate, and the layout's is {promised:.9g} Hz"
        remedy = (
            f"Correct the rate in the layout; if that line means something else, write 'rate: {promised:.9g}' above it"
        )
        raise source.error("the head", problem, remedy, reason="wrong_rate")


def resolve_rate(record: RawRecord, promised: float | None, where: str, source: Source) -> float:
    """The rate of the layout if that of the file agrees with it to the file's precision; without one, that of the file.

    A rate printed with few digits (UFF58: 1/51200 s as 1.95312E-05) becomes the whole number of Hz with the same
    printed digits, if there is only one.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    promised : float or None
        Rate that the layout states, or None. [Hz]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Returns
    -------
    float
        The sampling rate. [Hz]

    Raises
    ------
    ReadError
        If neither states a rate, they disagree, or rate and time column disagree.
    """
    rate, tolerance = _stated_rate(record, where, source)
    if rate is None:
        if promised is None:
            remedy = "Give the rate in the layout, or as hammer_rate_hz or passage_rate_hz in turnouts.tsv"
            raise source.error(
                where, "neither the file nor the layout says the sampling rate", remedy, reason="wrong_rate"
            )
        _check_unclear_lines(record.unclear, promised, source)
        return float(promised)
    if promised is not None:
        drift = MAX_CLOCK_DRIFT if record.rate is None else 0.0  # a time column has a clock of its own
        if abs(rate - promised) > (tolerance + drift) * promised:
            remedy = "Correct the rate in the layout, or find out why the logger was set differently"
            problem = f"sampled at {rate:.9g} Hz instead of {promised:.9g} Hz"
            raise source.error(where, problem, remedy, reason="wrong_rate")
        return float(promised)
    whole = round(rate)
    is_unique = rate * tolerance < 0.5
    return float(whole) if is_unique and abs(rate - whole) <= rate * tolerance else float(rate)


def _stated_rate(record: RawRecord, where: str, source: Source) -> tuple[float | None, float]:
    """(rate [Hz], tolerance) that a record states, else that of its time column; ReadError if these disagree."""
    rate, tolerance = record.rate, record.rate_tolerance
    if rate is not None and (not isfinite(rate) or rate <= 0):
        raise source.error(where, f"the sampling rate is {rate!r} Hz", reason="wrong_rate")
    if record.time is None or len(record.time) <= 2:
        return rate, tolerance
    measured, precision, _ = rate_of_time(record.time)
    if rate is None:
        return measured, precision
    if all(abs(measured * n - rate) > (tolerance + precision + MAX_CLOCK_DRIFT) * rate for n in TIME_UNITS_PER_SECOND):
        problem = f"its time column has {measured:.9g} samples a second, its rate says {rate:.9g} Hz"
        remedy = "Find out which of them is right and export the record again with that one alone"
        raise source.error(where, problem, remedy, reason="wrong_rate")
    return rate, tolerance


TIME_FORMAT = "%Y-%m-%d %H:%M:%S.%f"


def to_utc(stamp: datetime | None, time_zone: str) -> datetime | None:
    """Naive UTC of a file's start time; a time stamp without a zone is in ``time_zone`` (IANA name).

    Parameters
    ----------
    stamp : datetime or None
        Start time that the file states, or None.
    time_zone : str
        IANA name of the zone of a time stamp without one.

    Returns
    -------
    datetime or None
        Naive UTC; None without a time stamp, or for one that no calendar has.

    Examples
    --------
    >>> from datetime import datetime
    >>> to_utc(datetime(2024, 5, 13, 12, 0), "Europe/Zurich")
    datetime.datetime(2024, 5, 13, 10, 0)
    """
    if stamp is None:
        return None
    if stamp.tzinfo is None:
        stamp = stamp.replace(tzinfo=ZoneInfo(time_zone))
    try:
        return stamp.astimezone(UTC).replace(tzinfo=None)
    except OverflowError:  # a damaged stamp in the year 1 or 9999
        return None


def start_times(stamps: Iterable[tuple[int, datetime | None]], time_zone: str) -> list[tuple[int, datetime | None]]:
    """Start times of the records of one file in UTC.

    In the hour that comes twice in autumn a stamp means the first one, unless the record would precede its predecessor.

    Parameters
    ----------
    stamps : iterable of tuple of (int, datetime or None)
        (record, time stamp) in the order of the file.
    time_zone : str
        IANA name of the zone of time stamps without one.

    Returns
    -------
    list of tuple of (int, datetime or None)
        (record, naive UTC) in the same order.

    Examples
    --------
    >>> from datetime import datetime
    >>> stamps = enumerate([datetime(2024, 10, 27, 2, 55), datetime(2024, 10, 27, 2, 5)])
    >>> [f"{start:%H:%M}" for _, start in start_times(stamps, "Europe/Copenhagen")]
    ['00:55', '01:05']
    """
    starts: list[tuple[int, datetime | None]] = []
    latest: datetime | None = None
    for record, stamp in stamps:
        start = to_utc(stamp, time_zone)
        if stamp and start and latest and start < latest and stamp.tzinfo is None:
            second = to_utc(stamp.replace(fold=1), time_zone)
            start = second if second is not None and second >= latest else start
        starts.append((record, start))
        latest = start if latest is None or (start is not None and start > latest) else latest
    return starts


def check_order(starts: Sequence[tuple[int, datetime | None]], source: Source) -> dict[int, ReadError]:
    """Errors of the fewest records without which all others are in order of time.

    Parameters
    ----------
    starts : sequence of tuple of (int, datetime or None)
        (record, naive UTC) in the order of the file.
    source : Source
        The raw file.

    Returns
    -------
    dict of int to ReadError
        Number of the record -> its error.
    """
    errors: dict[int, ReadError] = {}
    timed = [(record, start) for record, start in starts if start is not None]
    ordered = _longest_ordered([start for _, start in timed])
    for i, (record, start) in enumerate(timed):
        n = bisect_left(ordered, i)
        if n < len(ordered) and ordered[n] == i:
            continue
        if n and start < (previous := timed[ordered[n - 1]][1]):
            where = f"before the record in front of it ({previous:{TIME_FORMAT}})"
        else:
            where = f"after a record behind it ({timed[ordered[n]][1]:{TIME_FORMAT}})"
        problem = f"it began at {start:{TIME_FORMAT}}, {where}"
        remedy = "Check the logger's clock and the time zone in the layout"
        errors[record] = source.error(f"record {record + 1}", problem, remedy, reason="clock_backwards")
    return errors


def _longest_ordered(starts: Sequence[Any]) -> list[int]:
    """Indices of the longest non-decreasing subsequence of ``starts``; of several, the earliest.

    >>> _longest_ordered([2099, 2001, 2002, 1970, 2002])
    [1, 2, 4]
    """
    rank = {start: -k for k, start in enumerate(sorted(set(starts)))}
    ends: list[int] = []  # ends[n]: rank of the latest first start of all subsequences of n + 1 starts
    n_following = [0] * len(starts)  # length of the longest subsequence from here on, this start included
    for i in reversed(range(len(starts))):
        k = bisect_right(ends, rank[starts[i]])
        ends[k : k + 1] = [rank[starts[i]]]
        n_following[i] = k + 1
    ordered: list[int] = []
    for i, start in enumerate(starts):
        if n_following[i] == len(ends) - len(ordered) and (not ordered or start >= starts[ordered[-1]]):
            ordered.append(i)
    return ordered


MATLAB_EPOCH = 719529  # datenum of 1970-01-01
DOTTED_DATE = re.compile(r"(\d{1,2})\.\s?(\d{1,2})\.\s?(\d{4})[\sT,;]+(\d{1,2}):(\d{2}(?::\d{2}(?:[.,]\d{1,9})?)?)")
MONTHS = {m: i for i, m in enumerate("jan feb mar apr may jun jul aug sep oct nov dec".split(), start=1)}


def parse_time(value: Any) -> datetime | None:
    """Time of a time stamp in any of the forms that files use.

    These are ISO 8601 text, numpy datetime64 (UTC), seconds since 1970 (UTC) and a MATLAB datenum. With dots the day
    comes first, "13.05.2024 10:00"; dates with slashes are ambiguous and not read.

    Parameters
    ----------
    value : any
        The time stamp as a library returns it.

    Returns
    -------
    datetime or None
        The time, with a zone if the file states one; None for any other value.

    Examples
    --------
    >>> parse_time("2024-05-13T10:00:00"), parse_time(719529.5)
    (datetime.datetime(2024, 5, 13, 10, 0), datetime.datetime(1970, 1, 1, 12, 0))
    """
    if isinstance(value, datetime):
        return value
    if isinstance(value, np.datetime64):
        stamp = value.astype("datetime64[us]").item()  # a whole number outside the years 1 to 9999, None for NaT
        return stamp.replace(tzinfo=UTC) if isinstance(stamp, datetime) else None
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        if match := DOTTED_DATE.fullmatch(value.strip()):
            value = f"{match[3]}-{match[2]:0>2}-{match[1]:0>2}T{match[4]:0>2}:{match[5]}"
        try:
            return datetime.fromisoformat(value.strip())
        except ValueError:
            return None
    if isinstance(value, (int, float)) and math.isfinite(value):
        if 6e5 < value < 8e5:
            return datetime(1970, 1, 1) + timedelta(seconds=round((value - MATLAB_EPOCH) * 86400, 6))
        if 1e8 < value < 1e11:
            return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=value)
    return None


def parse_uff_time(text: str) -> datetime | None:
    """Time in ID line 3 of a Universal File, DD-MMM-YY HH:MM:SS.

    Two-digit years from 70 on are 1970 to 1999.

    Parameters
    ----------
    text : str
        The line.

    Returns
    -------
    datetime or None
        The time; None for any other text.

    Examples
    --------
    >>> parse_uff_time("18-Apr-16 13:49:58")
    datetime.datetime(2016, 4, 18, 13, 49, 58)
    """
    try:
        date, clock = text.split()[:2]
        day, month, year = date.split("-")
        hour, minute, second = clock.split(":")
        years = int(year) + (0 if len(year) == 4 else 1900 if int(year) >= 70 else 2000)
        start = datetime(years, MONTHS[month[:3].lower()], int(day), int(hour), int(minute))
        return start + timedelta(seconds=float(second))
    except (ValueError, KeyError, OverflowError):
        return None


EXACT_PRECISION = 1e-9
SINGLE_PRECISION = 2.0**-23  # one unit in the last place of a 32 bit float
TEXT_PRECISION = 1e-6
MIN_DIGITS = 4


def is_single_precision(value: float) -> bool:
    """Whether a number may have been stored as a 32 bit float.

    Parameters
    ----------
    value : float
        A finite number.

    Returns
    -------
    bool
        True if conversion to 32 bit and back does not change it.

    Examples
    --------
    >>> is_single_precision(float(np.float32(1 / 44100))), is_single_precision(1 / 44100)
    (True, False)
    """
    with np.errstate(over="ignore"):
        return float(np.float32(value)) == value


def step_precision(step: float) -> float:
    """Relative size of one unit in the last digit of a time step [s], or of single precision.

    One unit, not half a unit: some exporters truncate instead of rounding. A step of fewer than four digits is taken as
    exact: 5E-05 is not a truncated number.

    Parameters
    ----------
    step : float
        Time step as the file states it. [s]

    Returns
    -------
    float
        Relative precision.

    Examples
    --------
    >>> print(f"{step_precision(2.267574e-05):.1e} {step_precision(5e-05):.1e} {step_precision(1 / 44100):.1e}")
    4.4e-07 1.0e-09 1.0e-09
    """
    digits = repr(float(step)).partition("e")[0].replace(".", "").strip("0")
    printed = 1.0 / int(digits) if digits.isdigit() and len(digits) >= MIN_DIGITS else 0.0
    return max(EXACT_PRECISION, printed, SINGLE_PRECISION if is_single_precision(step) else 0.0)


def start_offsets(stamps: Sequence[datetime | None]) -> list[float]:
    """Start of each channel relative to the first one.

    Parameters
    ----------
    stamps : sequence of datetime or None
        Start time of each channel, None if not stated.

    Returns
    -------
    list of float
        Offsets, all 0 if not all time stamps are comparable. [s]

    Examples
    --------
    >>> from datetime import datetime
    >>> start_offsets([datetime(2024, 5, 13, 10, 0, 1), datetime(2024, 5, 13, 10, 0, 0, 500_000)])
    [0.0, -0.5]
    """
    stated = [stamp for stamp in stamps if stamp is not None]
    if len(stated) < len(stamps) or len({stamp.tzinfo is None for stamp in stated}) > 1:
        return [0.0] * len(stamps)
    return [(stamp - stated[0]).total_seconds() for stamp in stated]


def check_simultaneous(
    names: Sequence[str], steps: Sequence[float], starts: Sequence[float], where: str, source: Source
) -> None:
    """Check that all channels have the same step, and starts within half a step.

    Multiplexed converters cause smaller differences of the starts.

    Parameters
    ----------
    names : sequence of str
        Names of the channels.
    steps : sequence of float
        Time step of each channel, 0 if not stated. [s]
    starts : sequence of float
        Start of each channel. [s]
    where : str
        The record, for the message.
    source : Source
        The raw file.

    Raises
    ------
    ReadError
        If steps differ, or starts differ by more than half a step.
    """
    step = steps[0]
    if any(abs(channel_step - step) > TEXT_PRECISION * abs(step) for channel_step in steps):
        problem = f"its channels have different steps: {sorted(set(steps))} s"
        remedy = "Record all channels at one rate, or export those of one rate to one file"
        raise source.error(where, problem, remedy, reason="wrong_rate")
    earliest, latest = min(starts), max(starts)
    if step and latest - earliest > 0.5 * abs(step):
        first, last = names[starts.index(earliest)], names[starts.index(latest)]
        problem = f"channel {last!r} begins {latest - earliest:.6g} s after channel {first!r}"
        remedy = "Start all channels by one trigger, or export them cut to the stretch that they share"
        raise source.error(where, problem, remedy, reason="clock_drift")
