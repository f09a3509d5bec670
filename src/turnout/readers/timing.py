"""Timing of records: rate and evenness of a time column, start times and the simultaneity of channels."""

from collections.abc import Iterator, Sequence
from datetime import datetime

import numpy as np

from turnout.readers.precision import TEXT_PRECISION
from turnout.readers.rate_statements import MAX_CLOCK_DRIFT
from turnout.readers.source import BLOCK_SIZE, Source

STEP_SAMPLES = 2**21  # samples whose median step is the usual step


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
    if is_coarse(time):
        return float((time.size - 1) / span), float(2 * _resolution(time) / span), None
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


MIN_COARSENESS = 1.05  # steps between two different times: a clock that stands still once leaves this at 1


def is_coarse(time: np.ndarray) -> bool:
    r"""Whether a clock with steps longer than the sampling step wrote a time column: samples share their times.

    .. math:: r = \min_{t_{k+1} \ne t_k} (t_{k+1} - t_k), \quad |t_k - t_0 - k / f_s| \le r

    Parameters
    ----------
    time : (n,) array of float
        The time column. [s]

    Returns
    -------
    bool
        False if the times leave the straight line by more than the step of the clock: samples are missing.

    Examples
    --------
    >>> seconds = np.arange(100) / 2000.0
    >>> is_coarse(np.floor(seconds * 1000.0) / 1000.0), is_coarse(seconds), is_coarse(np.maximum(seconds, 0.01))
    (True, False, False)
    """
    if np.all(np.diff(time[:BLOCK_SIZE])):  # a coarse clock repeats at least one time in 21: long records end here
        return False
    steps = np.diff(time)
    if np.any(steps < 0.0) or np.count_nonzero(steps) < MIN_CLOCK_STEPS:
        return False
    resolution, step = _resolution(time), (time[-1] - time[0]) / (time.size - 1)
    deviation = np.abs(time - time[0] - step * np.arange(time.size)).max()
    return bool(resolution >= MIN_COARSENESS * step and deviation <= resolution * (1.0 + 1e-6))


MIN_CLOCK_STEPS = 3  # of a coarse clock


def _resolution(time: np.ndarray) -> float:
    """Least difference of two different times that follow each other. [s]"""
    steps = np.diff(time)
    return float(steps[steps > 0.0].min())


def _blocks(time: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """(first index, samples) of consecutive blocks that share one sample; so hours need little memory."""
    for start in range(0, max(time.size - 1, 1), BLOCK_SIZE):
        yield start, time[start : start + BLOCK_SIZE + 1]


def check_time(time: np.ndarray, where: str, source: Source) -> None:
    """Check that a time column increases evenly, or as evenly as a clock with longer steps shows it.

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
    if is_coarse(time):
        return
    backwards = (start + int(np.argmax(b)) for start, block in _blocks(time) if (b := np.diff(block) <= 0).any())
    if (k := next(backwards, None)) is not None:
        problem = (
            f"the clock runs backwards or stands still: sample {k} at {time[k]:.15g} s, "
            f"the next at {time[k + 1]:.15g} s"
        )
        remedy = "Check the logger's clock and export the record again"
        if time[k] == time[k + 1]:
            remedy += ", the time with more digits if it was rounded"
        elif time[k + 1] == time[0]:
            problem = f"its time begins again after {k + 1} samples: another record follows"
            remedy = "Export each record to a file, or number the records in a column 'record'"
        raise source.error(where, problem, remedy, reason="clock_backwards")
    rate, _, gap = rate_of_time(time)
    if gap is not None:
        raise source.error(
            where,
            f"time jumps from {time[gap]:.15g} s to {time[gap + 1]:.15g} s at {rate:.6g} Hz: samples are missing",
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
                f"its time column is not even: sample {start + k}, at {block[k]:.15g} s, is {offsets[k]:.3g} steps "
                f"from where {rate:.6g} Hz put it"
            )
            remedy = "Check the logger's clock, or export the record at an even rate"
            raise source.error(where, problem, remedy, reason="wrong_rate")


def seconds_since_first(stamps: np.ndarray) -> np.ndarray:
    """Seconds of time stamps or durations, counted from the first one.

    Parameters
    ----------
    stamps : (n,) array of datetime64 or timedelta64
        Time stamps.

    Returns
    -------
    (n,) array of float
        NaN for a missing time stamp. [s]
    """
    seconds = (stamps - stamps[0]).astype("timedelta64[ns]").astype(float) * 1e-9
    return np.where(np.isnat(stamps), np.nan, seconds)


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
