"""Numbers of an entry of the metadata."""

import re
from typing import Any

import numpy as np

NUMBER_AND_UNIT = re.compile(r"([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*(.*)")


def number_and_unit(text: str) -> tuple[float, str] | None:
    """The number at the beginning of a text and what follows. A comma is a decimal mark.

    Parameters
    ----------
    text : str
        Value of an entry.

    Returns
    -------
    tuple of (float, str) or None
        None without a number.
    """
    match = NUMBER_AND_UNIT.fullmatch(text.strip())
    return (float(match[1].replace(",", ".")), match[2].strip()) if match else None


def finite_numbers(value: Any) -> np.ndarray | None:
    """The finite numbers of a value.

    Parameters
    ----------
    value : any
        Value of an entry.

    Returns
    -------
    (n,) array or None
        None if it holds none or is an array of samples.
    """
    if isinstance(value, str):
        cells = re.split(r"[;\s]+", value.strip())
        listed = len(cells) == 1 and (value.count(",") > 1 or "." in value)  # else a comma is the decimal mark
        value = cells[0].split(",") if listed else [cell.replace(",", ".") for cell in cells]
        if len(value) > 1 and not re.match(r"[+-]?\.?\d", value[1]):  # a number with its unit
            number = finite_numbers(value[0])
            is_level = number is not None and value[1].casefold() == "db"
            return 10 ** (number / 20) if is_level and number is not None else number
    if not isinstance(value, (int, float, list, tuple, np.ndarray, np.generic)) or isinstance(value, bool):
        return None
    try:
        numbers = np.ravel(np.asarray(value, dtype=float))
    except (TypeError, ValueError):
        return None
    return numbers if 0 < numbers.size <= MAX_CHANNELS and np.isfinite(numbers).all() else None


MAX_CHANNELS = 64  # a longer array is no list of scales but one of samples
