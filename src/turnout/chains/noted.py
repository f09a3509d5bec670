"""Numbers that recordings carry as notes, as people write them."""

from collections.abc import Iterable, Mapping
from math import isfinite
from statistics import median


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


def rail_temperature(recordings: Iterable) -> float | None:
    """Median of the rail temperatures that recordings note [°C], None without any."""
    told = [t for r in recordings if (t := number(r.conditions, "rail_temperature")) is not None]
    return median(told) if told else None
