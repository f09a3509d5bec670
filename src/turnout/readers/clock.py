"""How fast a record was sampled: what the file and its time column say against what was promised."""

from math import isfinite

import numpy as np

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
