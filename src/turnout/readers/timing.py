"""How fast a record was sampled: what the file and its time column say against what was promised.

When the records of a file began, and which of their stamps are in order.

Start times as files write them.

How precisely a file can state a sampling rate: as a double, in single precision, or in the digits that it prints.

Channels that stand side by side in a record: of one rate, and from one moment on.
"""

import math
import re
from bisect import bisect_left, bisect_right
from datetime import UTC, datetime, timedelta
from math import isfinite
from zoneinfo import ZoneInfo

import numpy as np

from turnout.errors import ReadError

PART = 2**18  # samples of a time column that are looked at together
USUAL = 2**21  # samples that the usual step is taken from
DRIFT = 1e-4  # by which two clocks of one logger, each of its own crystal, may differ
PER_SECOND = (1.0, 1e3, 1e6)  # a time column without unit may be in s, ms or µs


def rate_of_time(time):
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
        Sample after which time jumps by more than half a step (samples are missing), None where it is even.

    Examples
    --------
    >>> rate, tolerance, gap = rate_of_time(np.array([0.0, 0.01, 0.02, 0.05, 0.06]))
    >>> gap
    2
    """
    time = np.asarray(time, dtype=float)
    span = time[-1] - time[0]
    step = float(np.median(np.diff(time[:USUAL])))
    for start, part in _parts(time):
        jumps = np.abs(np.diff(part) - step) > 0.5 * step
        if jumps.any():
            return 1.0 / step, 1e-9, start + int(np.argmax(jumps))
    rate = (time.size - 1) / span
    deviation = max(
        np.abs(part - time[0] - np.arange(start, start + part.size) / rate).max() for start, part in _parts(time)
    )
    return float(rate), float(max(2 * deviation / span, 1e-9)), None


def _parts(time):
    """(first index, samples) of consecutive parts that share one sample: hours are looked at in little memory."""
    for start in range(0, max(time.size - 1, 1), PART):
        yield start, time[start : start + PART + 1]


def check_time(time, where, source):
    """ReadError where a time column runs backwards, is not finite, jumps over missing samples, or is not even."""
    for start, part in _parts(time):
        if not np.isfinite(part).all():
            found = f"the time of sample {start + int(np.argmin(np.isfinite(part)))} is not a number"
            raise source.error(where, found, reason="not_finite")
    backwards = (start + int(np.argmax(b)) for start, part in _parts(time) if (b := np.diff(part) <= 0).any())
    if (k := next(backwards, None)) is not None:
        found = (
            f"the clock runs backwards or stands still: sample {k} at {time[k]:.9g} s, the next at {time[k + 1]:.9g} s"
        )
        remedy = "Check the logger's clock and export the record again"
        raise source.error(where, found, remedy, reason="clock_backwards")
    rate, _, gap = rate_of_time(time)
    if gap is not None:
        raise source.error(
            where,
            f"time jumps from {time[gap]:.9g} s to {time[gap + 1]:.9g} s at {rate:.6g} Hz: samples are missing",
            "Copy the file again from the logger; if the gap is there too, the logger lost samples",
            reason="truncated",
        )
    _check_even(time, rate, where, source)


def _check_even(time, rate, where, source):
    """ReadError where time leaves a straight line by more than a step and what a crystal may drift.

    Printed digits stay within a step, or it would stand still; each part has a line of its own, for over hours the
    warmth of the day moves a crystal by many steps.
    """
    for start, part in _parts(time):
        steps = np.arange(part.size)
        off = np.abs((part - part[0]) * rate - steps)
        if (odd := off > 1.0 + DRIFT * steps).any():
            k = int(np.argmax(odd))
            found = (
                f"its time column is not even: sample {start + k}, at {part[k]:.9g} s, is {off[k]:.3g} steps from "
                f"where {rate:.6g} Hz put it"
            )
            remedy = "Check the logger's clock, or export the record at an even rate"
            raise source.error(where, found, remedy, reason="wrong_rate")


def _refuse_another(unclear, promised, source):
    """ReadError where a file names frequencies in words that nobody understood, none of them the promised rate."""
    if unclear and all(abs(frequency - promised) > 1e-3 * promised for _, frequency in unclear):
        line = unclear[0][0][:60]
        found = f"{line!r} may be a sampling rate, and the layout's is {promised:.9g} Hz"
        remedy = (
            f"Correct the rate in the layout; if that line means something else, write 'rate: {promised:.9g}' above it"
        )
        raise source.error("the head", found, remedy, reason="wrong_rate")


def settled_rate(record, promised, where, source):
    """The promised rate if the file's agrees with it to the file's precision, the file's where none is promised.

    A rate that was printed with few digits (UFF58: 1/51200 s as 1.95312E-05) becomes the whole number of Hz
    that prints the same, where there is just one.
    """
    rate, tolerance = _stated_rate(record, where, source)
    if rate is None:
        if promised is None:
            remedy = "Give the rate in the layout, or as hammer_rate_hz or passage_rate_hz in turnouts.tsv"
            raise source.error(
                where, "neither the file nor the layout says the sampling rate", remedy, reason="wrong_rate"
            )
        _refuse_another(record.unclear, promised, source)
        return float(promised)
    if promised is not None:
        drift = DRIFT if record.rate is None else 0.0  # the time column's own clock
        if abs(rate - promised) > (tolerance + drift) * promised:
            remedy = "Correct the rate in the layout, or find out why the logger was set differently"
            found = f"sampled at {rate:.9g} Hz instead of {promised:.9g} Hz"
            raise source.error(where, found, remedy, reason="wrong_rate")
        return float(promised)
    whole = round(rate)
    unique = rate * tolerance < 0.5
    return float(whole) if unique and abs(rate - whole) <= rate * tolerance else float(rate)


def _stated_rate(record, where, source):
    """(rate [Hz], its tolerance) that a record states, or else its time column; ReadError where these disagree."""
    rate, tolerance = record.rate, record.rate_tolerance
    if rate is not None and (not isfinite(rate) or rate <= 0):
        raise source.error(where, f"the sampling rate is {rate!r} Hz", reason="wrong_rate")
    if record.time is None or len(record.time) <= 2:
        return rate, tolerance
    measured, precision, _ = rate_of_time(record.time)
    if rate is None:
        return measured, precision
    if all(abs(measured * n - rate) > (tolerance + precision + DRIFT) * rate for n in PER_SECOND):
        found = f"its time column has {measured:.9g} samples a second, its rate says {rate:.9g} Hz"
        remedy = "Find out which of them is right and export the record again with that one alone"
        raise source.error(where, found, remedy, reason="wrong_rate")
    return rate, tolerance


STAMP = "%Y-%m-%d %H:%M:%S.%f"


def started_at(moment, time_zone):
    """Naive UTC of a file's start time; a time stamp without a zone is in ``time_zone`` (IANA name).

    >>> from datetime import datetime
    >>> started_at(datetime(2024, 5, 13, 12, 0), "Europe/Zurich")
    datetime.datetime(2024, 5, 13, 10, 0)
    """
    if moment is None:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=ZoneInfo(time_zone))
    try:
        return moment.astimezone(UTC).replace(tzinfo=None)
    except OverflowError:  # a damaged stamp in the year 1 or 9999
        return None


def starts_of(moments, time_zone):
    """[(record, naive UTC)] of [(record, time stamp)] of one file, in its order.

    Of an hour that comes twice in autumn the first is meant, unless a record would then begin before the one in front.

    >>> from datetime import datetime
    >>> stamps = enumerate([datetime(2024, 10, 27, 2, 55), datetime(2024, 10, 27, 2, 5)])
    >>> [f"{start:%H:%M}" for _, start in starts_of(stamps, "Europe/Copenhagen")]
    ['00:55', '01:05']
    """
    found, latest = [], None
    for record, moment in moments:
        start = started_at(moment, time_zone)
        if start is not None and latest is not None and start < latest and moment.tzinfo is None:
            second = started_at(moment.replace(fold=1), time_zone)
            start = second if second is not None and second >= latest else start
        found.append((record, start))
        latest = start if latest is None or (start is not None and start > latest) else latest
    return found


def check_order(starts, source):
    """{record: ReadError} for the fewest records without which no record began before the one in front of it."""
    errors: dict[int, ReadError] = {}
    known = [(record, start) for record, start in starts if start is not None]
    kept = _in_order([start for _, start in known])
    for i, (record, start) in enumerate(known):
        n = bisect_left(kept, i)
        if n < len(kept) and kept[n] == i:
            continue
        if n and start < (front := known[kept[n - 1]][1]):
            where = f"before the record in front of it ({front:{STAMP}})"
        else:
            where = f"after a record behind it ({known[kept[n]][1]:{STAMP}})"
        found = f"it began at {start:{STAMP}}, {where}"
        remedy = "Check the logger's clock and the time zone in the layout"
        errors[record] = source.error(f"record {record + 1}", found, remedy, reason="clock_backwards")
    return errors


def _in_order(starts):
    """Places of the most ``starts`` that never go back; of several such choices the one that keeps the earliest.

    >>> _in_order([2099, 2001, 2002, 1970, 2002])
    [1, 2, 4]
    """
    rank = {start: -k for k, start in enumerate(sorted(set(starts)))}
    ends: list[int] = []  # ends[n]: of all orders of n + 1 starts, read from behind, the latest first one
    ahead = [0] * len(starts)  # how many can follow in order, the one itself included
    for i in reversed(range(len(starts))):
        k = bisect_right(ends, rank[starts[i]])
        ends[k : k + 1] = [rank[starts[i]]]
        ahead[i] = k + 1
    kept: list[int] = []
    for i, start in enumerate(starts):
        if ahead[i] == len(ends) - len(kept) and (not kept or start >= starts[kept[-1]]):
            kept.append(i)
    return kept


MATLAB_EPOCH = 719529  # datenum of 1970-01-01
DOTTED = re.compile(r"(\d{1,2})\.\s?(\d{1,2})\.\s?(\d{4})[\sT,;]+(\d{1,2}):(\d{2}(?::\d{2}(?:[.,]\d{1,9})?)?)")
MONTHS = {m: i for i, m in enumerate("jan feb mar apr may jun jul aug sep oct nov dec".split(), start=1)}


def moment(value):
    """datetime of ISO 8601 text, numpy datetime64 (UTC), seconds since 1970 (UTC) or a MATLAB datenum; else None.

    With dots the day comes first, "13.05.2024 10:00"; with slashes nobody can tell.

    Examples
    --------
    >>> moment("2024-05-13T10:00:00"), moment(719529.5)
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
        if match := DOTTED.fullmatch(value.strip()):
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


def uff_moment(text):
    """datetime of UFF's ID line 3, DD-MMM-YY HH:MM:SS; None where something else stands there.

    Two-digit years from 70 on are of the last century.

    >>> uff_moment("18-Apr-16 13:49:58")
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


EXACT = 1e-9
SINGLE = 2.0**-23  # one unit in the last place of a 32 bit float
TEXT = 1e-6
FEWEST_DIGITS = 4


def single_precision(value: float) -> bool:
    """Whether a number may have gone through a 32 bit float.

    >>> single_precision(float(np.float32(1 / 44100))), single_precision(1 / 44100)
    (True, False)
    """
    with np.errstate(over="ignore"):
        return float(np.float32(value)) == value


def step_precision(step: float) -> float:
    """Relative size of one unit in the last digit of a time step [s], or what single precision leaves of it.

    One unit, not half of it: some exporters cut digits off instead of rounding. Fewer than four digits are taken for a
    round number as it was meant: 5E-05 is no 6E-05 cut off.

    >>> print(f"{step_precision(2.267574e-05):.1e} {step_precision(5e-05):.1e} {step_precision(1 / 44100):.1e}")
    4.4e-07 1.0e-09 1.0e-09
    """
    digits = repr(float(step)).partition("e")[0].replace(".", "").strip("0")
    printed = 1.0 / int(digits) if digits.isdigit() and len(digits) >= FEWEST_DIGITS else 0.0
    return max(EXACT, printed, SINGLE if single_precision(step) else 0.0)


def seconds_behind(moments):
    """Seconds of each channel's time stamp behind the first one's; 0 where not all have a comparable one.

    >>> from datetime import datetime
    >>> seconds_behind([datetime(2024, 5, 13, 10, 0, 1), datetime(2024, 5, 13, 10, 0, 0, 500_000)])
    [0.0, -0.5]
    """
    if None in moments or len({moment.tzinfo is None for moment in moments}) > 1:
        return [0.0] * len(moments)
    return [(moment - moments[0]).total_seconds() for moment in moments]


def check_together(names, steps, starts, where, source):
    """ReadError where channels state different steps [s] (0: not stated), or starts [s] more than half a step apart.

    Less than that apart are the channels of converters that take turns.
    """
    step = steps[0]
    if any(abs(other - step) > TEXT * abs(step) for other in steps):
        found = f"its channels have different steps: {sorted(set(steps))} s"
        remedy = "Record all channels at one rate, or export those of one rate to one file"
        raise source.error(where, found, remedy, reason="wrong_rate")
    early, late = min(starts), max(starts)
    if step and late - early > 0.5 * abs(step):
        first, last = names[starts.index(early)], names[starts.index(late)]
        found = f"channel {last!r} begins {late - early:.6g} s after channel {first!r}"
        remedy = "Start all channels by one trigger, or export them cut to the stretch that they share"
        raise source.error(where, found, remedy, reason="clock_drift")
