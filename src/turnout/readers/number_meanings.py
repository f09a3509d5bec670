"""What a number without unit may be: a rate, the time of one sample, a code or a time stamp."""

import re
from fractions import Fraction

from turnout.readers.precision import Interval, readings
from turnout.readers.rate_statements import USUAL_RATES
from turnout.readers.time_numbers import EPOCHS

MAX_FACTOR = 10_000  # a larger whole number is a code, unless people choose it as a rate or a converter has it
YEARS = (1990, 2061)
ROUND_RATE = 100.0  # Hz: people choose multiples of it
MAX_CHANCE = 0.1  # share of all numbers of so many digits that are the inverse of a round rate by chance
MIN_LARGEST = 127  # of a converter of 8 bits


def number_value(number: str) -> float:
    """Value of a printed number, 0 if it is none.

    Parameters
    ----------
    number : str
        The number as it is written.

    Returns
    -------
    float

    Examples
    --------
    >>> number_value("1e3"), number_value("")
    (1000.0, 0.0)
    """
    printed = readings(number)
    return float(printed[0].value) if printed else 0.0


def rates_of_number(number: str) -> tuple[Interval, ...]:
    """Rates that a number without unit may mean: in Hz and kHz, or a step in s, ms and µs.

    Parameters
    ----------
    number : str
        The number as it is written.

    Returns
    -------
    tuple of Interval
        Rates, with the rounding of the number.

    Examples
    --------
    >>> [round(float(i.rate), 3) for i in rates_of_number("20")]
    [20.0, 0.05, 20000.0, 50.0, 50000.0]
    """
    units = ((False, 1), (True, 1), (False, 1000), (True, Fraction(1, 1000)), (True, Fraction(1, 10**6)))
    return tuple(
        interval
        for is_step, scale in units
        for reading in readings(number)
        if (interval := reading.interval(Fraction(scale), is_step))
    )


def is_inverse_of_rate(number: str, scale: float) -> bool:
    """Whether a time is that of one sample by its digits: they are the inverse of a round rate.

    Parameters
    ----------
    number : str
        The time as it is written.
    scale : float
        Its unit. [s]

    Returns
    -------
    bool

    Examples
    --------
    >>> is_inverse_of_rate("78.125", 1e-6), is_inverse_of_rate("78.3", 1e-6)
    (True, False)
    """
    n_digit = len(re.sub(r"[eE].*|\D", "", number).strip("0"))
    tolerance = 10.0 ** (1 - n_digit)  # relative, of a rounded number
    times = [float(reading.value) * scale for reading in readings(number)]
    for rate in (1.0 / time for time in times if time > 0.0):
        step, n_step = ROUND_RATE / rate, rate / ROUND_RATE
        is_close = tolerance <= MAX_CHANCE * step and abs(n_step - round(n_step)) * step <= tolerance
        if is_close and USUAL_RATES[0] <= rate <= USUAL_RATES[1]:
            return True
    return False


def is_code(value: float) -> bool:
    """Whether a whole number is a time stamp, a year or a code rather than a setting.

    Parameters
    ----------
    value : float
        The number.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_code(value) for value in (2021, 48211, 20000, 32767)]
    [True, True, False, False]
    """
    is_epoch = any(EPOCHS[0] <= value / scale <= EPOCHS[1] for scale in (1.0, 1e3, 1e6, 1e9))
    return is_epoch or ((YEARS[0] <= value <= YEARS[1] or value > MAX_FACTOR) and not _is_round(int(value)))


def _is_round(value: int) -> bool:
    """Whether a whole number is one that people choose as a factor or a rate, or the largest one of a converter."""
    return (value >= MIN_LARGEST and value & (value + 1) == 0) or value % 50 == 0 or value % 16 == 0
