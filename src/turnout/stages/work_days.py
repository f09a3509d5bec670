"""Recorded work on a turnout: what each kind changes, and the days that part the recordings before and after it."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.config.events import RENEWAL, RESETS, Event, read_events

if TYPE_CHECKING:
    from turnout.config.turnout import TurnoutConfig

# Groups of parameters that a kind of work makes uncertain again
OPENED = {
    "tamping": ("ballast", "ballast_damper", "wave", "surface"),
    "ballast_cleaning": ("ballast", "ballast_damper", "wave", "surface"),
    "pad_exchange": ("pad", "pad_damper"),
    "rail_change": ("rail", "wave", "surface", "depth", "top_shape", "gain", "seat"),
    "grinding": ("wave", "surface", "depth", "top_shape"),
    "sleeper_change": ("sleeper", "pad", "pad_damper", "ballast", "ballast_damper", "wave"),
    "sensor_change": ("gain", "seat"),
}
OPENED[RENEWAL] = tuple(sorted({group for opened in OPENED.values() for group in opened}))  # of one section
# The same of a resonance that a row resets beside those of its kind, as "other" with "railpad" for tightened clips
OF_RESONANCE = {"ballast": ("ballast", "ballast_damper"), "railpad": ("pad", "pad_damper")}


def further_resonances(event: Event) -> list[str]:
    """Resonances that a row resets beside those of its kind.

    Parameters
    ----------
    event : Event

    Returns
    -------
    list of str
    """
    return [resonance for resonance in event.resets if resonance not in RESETS[event.kind]]


def opened_groups(event: Event) -> set[str]:
    """Groups of parameters that the work makes uncertain again; none, where it changes neither track nor sensors.

    Parameters
    ----------
    event : Event

    Returns
    -------
    set of str
    """
    return {*OPENED.get(event.kind, ()), *(group for r in further_resonances(event) for group in OF_RESONANCE[r])}


def days_of_work(events: Iterable[Event]) -> list[date]:
    """First days after the work that changes the track or its sensors.

    Parameters
    ----------
    events : iterable of Event
        Those of one turnout.

    Returns
    -------
    list of date
        In the order of time, each once.
    """
    return sorted({event.first_day_after for event in events if opened_groups(event)})


def work_days_of(turnout: TurnoutConfig) -> list[date]:
    """``days_of_work`` of a turnout.

    Parameters
    ----------
    turnout : TurnoutConfig

    Returns
    -------
    list of date
    """
    return days_of_work(recorded_events(turnout))


def recorded_events(turnout: TurnoutConfig) -> list[Event]:
    """Rows of events.csv about a turnout, in the order of time.

    Parameters
    ----------
    turnout : TurnoutConfig

    Returns
    -------
    list of Event
    """
    path = Path(turnout.folder) / "events.csv"
    return [event for event in _events_in(path, _state_of(path)) if event.turnout == turnout.id]


@lru_cache(maxsize=8)
def _events_in(path: Path, state: tuple[int, int] | None) -> tuple[Event, ...]:
    """Events in a file, which is read once for each ``state`` in which it is found."""
    recorded, _, _ = read_events(path, "events.csv", None, {})
    return tuple(recorded)


def _state_of(path: Path) -> tuple[int, int] | None:
    """Size and time of change of a file, None if there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns
