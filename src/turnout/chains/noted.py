"""Numbers that recordings carry as notes, as people write them."""

from collections.abc import Iterable, Mapping
from math import isfinite
from statistics import median

COLDEST, HOTTEST = -50.0, 80.0  # of a rail [°C]


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


def temperature(said: Mapping) -> float | None:
    """The rail temperature that a file notes [°C], None without one and where no rail is as cold or hot: a thermometer
    that is broken says 85 or 999.

    >>> temperature({"rail_temperature": "21,5"}), temperature({"rail_temperature": 999.0})
    (21.5, None)
    """
    value = number(said, "rail_temperature")
    return value if value is not None and COLDEST <= value <= HOTTEST else None


def rail_temperature(recordings: Iterable) -> float | None:
    """Median of the rail temperatures that recordings note [°C], None without any."""
    told = [t for r in recordings if (t := temperature(r.conditions)) is not None]
    return median(told) if told else None
