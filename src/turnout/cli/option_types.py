"""Types of option values: numbers within limits, each with its message for another text."""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import dataclass

from turnout.number_text import decimal_number


def at_least_one(text: str) -> int:
    """The number of ``text``, 1 or more; argparse.ArgumentTypeError otherwise.

    Parameters
    ----------
    text : str
        Value of an option.

    Returns
    -------
    int
        The number.

    Examples
    --------
    >>> at_least_one("4")
    4
    """
    try:
        number = whole_number(text)
    except argparse.ArgumentTypeError:
        number = 0
    if number < 1:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 1 or more")
    return number


def whole_number(text: str) -> int:
    """The whole number of ``text``; argparse.ArgumentTypeError otherwise.

    Parameters
    ----------
    text : str
        Value of an option.

    Returns
    -------
    int
        The number.

    Examples
    --------
    >>> whole_number("-3")
    -3
    """
    if not re.fullmatch(r"[+-]?\d+", text.strip(), re.ASCII):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number")
    return int(text)


def above_zero(text: str) -> float:
    """The number of ``text``, above 0; argparse.ArgumentTypeError otherwise.

    Parameters
    ----------
    text : str
        Value of an option.

    Returns
    -------
    float
        The number.

    Examples
    --------
    >>> above_zero("160")
    160.0
    """
    return finite_number(text, lower_limit=0.0)


def zero_or_more(text: str) -> float:
    """The finite number of ``text``, 0 or more; argparse.ArgumentTypeError otherwise.

    Parameters
    ----------
    text : str
        Value of an option.

    Returns
    -------
    float
        The number.

    Examples
    --------
    >>> zero_or_more("0")
    0.0
    """
    number = finite_number(text)
    if number < 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not 0 or more")
    return number


def finite_number(text: str, lower_limit: float = -math.inf) -> float:
    """The finite number of ``text``; argparse.ArgumentTypeError otherwise.

    Parameters
    ----------
    text : str
        Value of an option.
    lower_limit : float
        The number has to be above it.

    Returns
    -------
    float
        The number.

    Examples
    --------
    >>> finite_number("-12.5")
    -12.5
    """
    try:
        number = decimal_number(text)
    except ValueError:
        number = math.nan
    if not lower_limit < number < math.inf:
        limit = "" if lower_limit == -math.inf else f" above {lower_limit:g}"
        raise argparse.ArgumentTypeError(f"{text!r} is not a number{limit}")
    return number


@dataclass(frozen=True)
class NumberBetween:
    """Type of an option: a number from ``lowest`` to ``highest`` in ``unit``; argparse.ArgumentTypeError otherwise.

    Examples
    --------
    >>> NumberBetween(1.0, 500.0, "km/h")("160")
    160.0
    """

    lowest: float
    highest: float
    unit: str

    def __call__(self, text: str) -> float:
        number = finite_number(text)
        if not self.lowest <= number <= self.highest:
            raise argparse.ArgumentTypeError(
                f"{text!r} is not a number from {self.lowest:g} to {self.highest:g} {self.unit}"
            )
        return number


SPEED = NumberBetween(1.0, 500.0, "km/h")
RAIL_TEMPERATURE = NumberBetween(-50.0, 80.0, "°C")
