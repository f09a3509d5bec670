"""Numbers that recordings carry as notes, as people write them."""

from collections.abc import Mapping
from math import isfinite


def number(said: Mapping, name: str) -> float | None:
    """What a file notes under ``name`` as a number, None where there is none to be read.

    >>> number({"speed": "27,8"}, "speed"), number({"speed": "fast"}, "speed")
    (27.8, None)
    """
    try:
        value = float(str(said[name]).strip().replace(",", "."))
    except (KeyError, ValueError):
        return None
    return value if isfinite(value) else None
