"""Numbers that people note in recordings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import isfinite
from statistics import median
from typing import Any

from turnout.records import Recording

MIN_RAIL_TEMPERATURE, MAX_RAIL_TEMPERATURE = -50.0, 80.0  # °C: a noted rail temperature outside is a broken thermometer


def noted_number(notes: Mapping[str, Any], name: str) -> float | None:
    """The value that a file notes under a name, as a number.

    Parameters
    ----------
    notes : mapping of str to any
        Notes of a record by name.
    name : str
        Name of the note.

    Returns
    -------
    float or None
        None if it is missing, no number or not finite.

    Examples
    --------
    >>> noted_number({"speed": "27,8"}, "speed"), noted_number({"speed": "fast"}, "speed")
    (27.8, None)
    """
    try:
        value = float(str(notes[name]).strip().replace(",", "."))
    except (KeyError, ValueError):
        return None
    return value if isfinite(value) else None


def noted_rail_temperature(notes: Mapping[str, Any]) -> float | None:
    """The rail temperature that a file notes. [°C]

    A broken thermometer notes 85 or 999.

    Parameters
    ----------
    notes : mapping of str to any
        Notes of a record by name.

    Returns
    -------
    float or None
        None without one, or outside the plausible range.

    Examples
    --------
    >>> noted_rail_temperature({"rail_temperature": "21,5"}), noted_rail_temperature({"rail_temperature": 999.0})
    (21.5, None)
    """
    value = noted_number(notes, "rail_temperature")
    return value if value is not None and MIN_RAIL_TEMPERATURE <= value <= MAX_RAIL_TEMPERATURE else None


def doubt_of_rail_temperature(notes: Mapping[str, Any]) -> str | None:
    """Why a noted rail temperature is not used, in words; None where it is, or where none is noted.

    Parameters
    ----------
    notes : mapping of str to any
        Notes of a record by name.

    Returns
    -------
    str or None

    Examples
    --------
    >>> doubt_of_rail_temperature({"rail_temperature": 20.0}), doubt_of_rail_temperature({})
    (None, None)
    """
    value = noted_number(notes, "rail_temperature")
    if value is None or noted_rail_temperature(notes) is not None:
        return None
    return (
        f"a rail temperature of {value:g} °C is noted, outside {MIN_RAIL_TEMPERATURE:g} to {MAX_RAIL_TEMPERATURE:g}: "
        "not used. Is the thermometer broken, or the unit another one?"
    )


def rail_temperature(recordings: Iterable[Recording]) -> float | None:
    """Median of the rail temperatures noted in recordings. [°C]

    Parameters
    ----------
    recordings : iterable of Recording
        Recordings of one section and campaign.

    Returns
    -------
    float or None
        None if no recording notes one.
    """
    temperatures = [t for r in recordings if (t := noted_rail_temperature(r.conditions)) is not None]
    return median(temperatures) if temperatures else None
