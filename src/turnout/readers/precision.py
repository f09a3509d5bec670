"""Printed numbers: their value, the interval that rounding allows, and readings of ambiguous separators.

One rule holds for all formats. A number is known to half a unit of its last digit; to one unit from five digits on,
because some exporters truncate instead of rounding. Trailing zeros count as digits: "4.0E-05" has two. Rounding excuses
5 % at most. A short number without trailing zeros whose rate is a whole number of Hz ("4e-05", "0.0001", "25.6 kHz")
may be exact, because programs that print the shortest form omit the zeros, or rounded: alone it counts as exact, and
beside a more precise statement of the same file as rounded.
"""

import re
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

EXACT_PRECISION = 1e-9
SINGLE_PRECISION = 2.0**-23  # one unit in the last place of a 32 bit float
TEXT_PRECISION = 1e-6
SHORT_DIGITS = 4  # a number with fewer digits may be the shortest form of an exact one
TRUNCATED_DIGITS = 5  # from here on one unit in the last digit is allowed, because the number may be truncated
MAX_ROUNDING = Fraction(1, 20)  # relative: a difference that is larger is not excused by few digits

NUMBER = re.compile(r"[+-]?(?:\d[\d.,'’\u00a0\u202f]*|[.,]\d+)(?:[eEdD][+-]?\d{1,3}(?![\d.]))?")
GROUPS = re.compile(r"[1-9]\d{0,2}(?:([.,'’\u00a0\u202f ])\d{3})(?:\1\d{3})*")
SPACED_GROUPS = re.compile(r"[1-9]\d{0,2}(?: \d{3})+(?![\d.,])")


@dataclass(frozen=True)
class Interval:
    """A sampling rate and the bounds within which rounding lets it be. [Hz]

    ``loose_low`` and ``loose_high`` are the bounds if a number that may be exact was rounded.
    """

    rate: float
    low: float
    high: float
    loose_low: float
    loose_high: float

    @property
    def width(self) -> float:
        """Relative half width."""
        return 0.5 * (self.high - self.low) / self.rate

    @property
    def loose_width(self) -> float:
        """Relative half width if the number was rounded."""
        return 0.5 * (self.loose_high - self.loose_low) / self.rate

    @property
    def loose(self) -> "Interval":
        """The interval if the number was rounded."""
        return Interval(self.rate, self.loose_low, self.loose_high, self.loose_low, self.loose_high)

    def divide(self, factor: float) -> "Interval":
        """The interval of a rate divided by a factor.

        Parameters
        ----------
        factor : float
            Above 0.

        Returns
        -------
        Interval
            Rate and bounds divided by it.
        """
        bounds = (self.rate, self.low, self.high, self.loose_low, self.loose_high)
        return Interval(*(bound / factor for bound in bounds))

    def overlaps(self, other: "Interval") -> bool:
        """Whether both can be the same rate.

        Parameters
        ----------
        other : Interval
            Another statement.

        Returns
        -------
        bool
            True if the bounds have a rate in common.
        """
        return self.low <= other.high and other.low <= self.high

    def widen(self, tolerance: float) -> "Interval":
        """The interval with bounds moved outwards.

        Parameters
        ----------
        tolerance : float
            Relative to the rate.

        Returns
        -------
        Interval
            Same rate, wider bounds.
        """
        below, above = 1 - tolerance, 1 + tolerance
        bounds = (self.low * below, self.high * above, self.loose_low * below, self.loose_high * above)
        return Interval(self.rate, *bounds)


def around(rate: float, tolerance: float) -> Interval:
    """Interval of a rate with a relative precision.

    Parameters
    ----------
    rate : float
        [Hz]
    tolerance : float
        Relative.

    Returns
    -------
    Interval
        Bounds on both sides.
    """
    return Interval(rate, rate, rate, rate, rate).widen(tolerance)


@dataclass(frozen=True)
class PrintedNumber:
    """One reading of a printed number: its value, the value of one unit in its last digit, its digits and notation.

    ``is_short`` is True if trailing zeros may have been omitted.
    """

    value: Fraction
    unit: Fraction
    digits: int
    is_short: bool
    tolerance: float = TEXT_PRECISION

    def interval(self, scale: Fraction, is_step: bool) -> Interval | None:
        """Sampling rate that the number states.

        Parameters
        ----------
        scale : Fraction
            Hz or s per unit of the number.
        is_step : bool
            Whether it is a time step.

        Returns
        -------
        Interval or None
            None if it is not positive.

        Examples
        --------
        >>> def rate(text): return readings(text)[0].interval(Fraction(1), True)
        >>> rate("0.0001").width < 1e-5, round(rate("0.000020").width, 3), rate("1.95312E-05").high > 51200
        (True, 0.025, True)
        """
        value = self.value * scale
        if value <= 0:
            return None
        rate = 1 / value if is_step else value
        margin = self.unit * scale / (1 if self.digits >= TRUNCATED_DIGITS else 2)
        margin = min(margin, value * MAX_ROUNDING)
        is_exact = rate.denominator == 1 and self.is_short
        bounds = [value - margin, value + margin]
        exact_bounds = [value, value] if is_exact else bounds
        if is_step:
            bounds, exact_bounds = [1 / b for b in reversed(bounds)], [1 / b for b in reversed(exact_bounds)]
        return Interval(float(rate), *map(float, (*exact_bounds, *bounds))).widen(self.tolerance)


def readings(value: Any) -> tuple[PrintedNumber, ...]:
    """All readings of a number or of the text of one.

    A separator that three digits follow may mark thousands or decimals: such a text has two readings.

    Parameters
    ----------
    value : any
        Number, numpy scalar, or text of a number without a unit.

    Returns
    -------
    tuple of PrintedNumber
        Empty if it is no finite number.

    Examples
    --------
    >>> [float(r.value) for r in readings("25,600")], [float(r.value) for r in readings("3,90625E-05")]
    ([25600.0, 25.6], [3.90625e-05])
    """
    if isinstance(value, (bool, np.bool_)):
        return ()
    if isinstance(value, (int, float, np.integer, np.floating)):
        return _of_number(value)
    text = str(value).strip()
    if SPACED_GROUPS.fullmatch(text):
        text = text.replace(" ", "")
    if not NUMBER.fullmatch(text):
        return ()
    text = text.upper().replace("D", "E")
    if match := GROUPS.fullmatch(text):
        whole = _parse_decimal(re.sub(r"\D", "", text))
        mark = match[1]
        if mark in ".," and text.count(mark) == 1:
            return (whole, _parse_decimal(text.replace(",", ".")))
        return (whole,)
    text = re.sub(r"['’\u00a0\u202f]", "", text)
    if "," in text and "." in text:  # the last one is the decimal mark
        thousands = "," if text.rindex(".") > text.rindex(",") else "."
        text = text.replace(thousands, "")
    text = text.replace(",", ".")
    return (_parse_decimal(text),) if text.count(".") <= 1 and any(c.isdigit() for c in text.partition("E")[0]) else ()


def _of_number(value: float | np.integer | np.floating) -> tuple[PrintedNumber, ...]:
    """The reading of a number in binary: that of its shortest decimal form."""
    if not np.isfinite(value):
        return ()
    if isinstance(value, (int, np.integer)):
        return (PrintedNumber(Fraction(int(value)), Fraction(0), len(str(abs(int(value)))), True, EXACT_PRECISION),)
    with np.errstate(over="ignore"):
        single = np.float32(value)
    is_single = float(single) == float(value)
    text = np.format_float_scientific(single if is_single else np.float64(value), unique=True, trim="-")
    shown = _parse_decimal(text.upper())
    is_long = shown.digits >= (8 if is_single else 15)
    value_shown = Fraction(float(value)) if is_long else shown.value
    unit = Fraction(0) if is_long or shown.digits < SHORT_DIGITS else shown.unit
    tolerance = SINGLE_PRECISION if is_single else EXACT_PRECISION
    return (PrintedNumber(value_shown, unit, shown.digits, True, tolerance),)


def _parse_decimal(text: str) -> PrintedNumber:
    """The reading of a number with a decimal point and perhaps an exponent "E"."""
    mantissa, _, exponent = text.partition("E")
    _, _, decimals = mantissa.partition(".")
    digits = re.sub(r"\D", "", mantissa).lstrip("0")
    unit = Fraction(10) ** (int(exponent or 0) - len(decimals))
    value = Fraction(text)
    is_short = not decimals.endswith("0") and len(digits.rstrip("0")) < SHORT_DIGITS
    return PrintedNumber(value, unit, max(len(digits), 1), is_short)
