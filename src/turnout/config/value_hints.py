"""Hints at the end of a remedy: what to write in place of a number with a decimal comma, a unit or a prefix."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from turnout.config.schema import Key

DECIMAL_COMMA = re.compile(r"[+-]?\d+,(?!\d{3}$)\d+")  # three digits may be a mark for thousands
NO_UNIT = ("", None, "-", "1")
PLAIN_UNITS = ("m", "s", "N", "Hz", "V")  # which people write with a prefix
PREFIXES = (("m", 1e-3), ("k", 1e3))
NUMBER_WITH_UNIT = re.compile(r"([+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)\s*([^\s\d.,]\S*)", re.ASCII)
DECIMAL_POINT = "If it belongs to the number before it, write a point in place of the comma, as in 24.6"


def is_in_range(key: Key, value: float) -> bool:
    """Whether a number is within the limits of a key.

    Parameters
    ----------
    key : Key
    value : float

    Returns
    -------
    bool
    """
    low = key.minimum is not None and value < key.minimum
    high = key.maximum is not None and value > key.maximum
    return not low and not high and (key.above is None or value > key.above)


def decimal_point_hint(text: str) -> str:
    """How a number with a decimal comma has to be written.

    Parameters
    ----------
    text : str
        What was written in place of a number.

    Returns
    -------
    str
        The end of a remedy; "" for other texts.

    Examples
    --------
    >>> decimal_point_hint("13,1"), decimal_point_hint("20,000"), decimal_point_hint("fast")
    (', with a decimal point: 13.1', '', '')
    """
    return f", with a decimal point: {text.strip().replace(',', '.')}" if DECIMAL_COMMA.fullmatch(text.strip()) else ""


def hint_without_unit(key: Key, text: str) -> str:
    """How a number with its unit behind it has to be written.

    Parameters
    ----------
    key : Key
        The key, a number.
    text : str
        What was written.

    Returns
    -------
    str
        The end of a remedy; "" for other texts, and where no allowed value results.
    """
    match = NUMBER_WITH_UNIT.fullmatch(text.strip())
    if not match:
        return ""
    prefixes = {"%": 0.01} if key.unit in NO_UNIT else {prefix + str(key.unit): f for prefix, f in PREFIXES}
    factors = {key.unit: 1.0} | prefixes
    if match[2] not in factors:
        return ""
    value = float(match[1]) * factors[match[2]]
    is_allowed = is_in_range(key, value) and (key.value_type == "number" or value.is_integer())
    return f", without the unit: {value:.9g}" if is_allowed else ""


def hint_at_other_unit(key: Key, value: float) -> str:
    """What a number would be if it is in percent or has a prefix before its unit.

    Parameters
    ----------
    key : Key
        The key, a number.
    value : float
        What was written.

    Returns
    -------
    str
        The end of a remedy; "" where no allowed value results.
    """
    if not value:
        return ""
    if key.unit in NO_UNIT and key.maximum is not None and key.maximum <= 1.0 and is_in_range(key, value / 100.0):
        return f" ({value:g} % are {value / 100.0:g})"
    if key.unit in PLAIN_UNITS:
        for prefix, factor in PREFIXES:
            if not (prefix == "m" and key.unit == "Hz") and is_in_range(key, value * factor):
                return f" ({value:.9g} {prefix}{key.unit} are {value * factor:.9g} {key.unit})"
    return ""
