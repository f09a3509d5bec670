"""Rows of tables beside the recordings that a command does not use: they are stated, and the command goes on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from turnout.config import Configuration


def input_warnings(configuration: Configuration, turnout_id: str, raw: str | Path) -> list[str]:
    """What cannot be used of events.csv, campaigns.csv and trains.csv for a turnout.

    Parameters
    ----------
    configuration : Configuration
    turnout_id : str
    raw : path
        Folder of all recordings.

    Returns
    -------
    list of str
    """
    from turnout.config.campaign_notes import read_notes

    _, errors = read_notes(configuration.turnout(turnout_id), Path(raw))
    return [*events_in_doubt(configuration, turnout_id), *map(str, errors)]


def events_in_doubt(configuration: Configuration, turnout_id: str) -> list[str]:
    """Rows of events.csv that may be of a turnout and do not count, or have a date that cannot be right.

    Parameters
    ----------
    configuration : Configuration
    turnout_id : str

    Returns
    -------
    list of str
        Their warnings, also of a similar id that no turnout has.
    """
    rows = (w for w in configuration.warnings if Path(w.path).name == "events.csv")
    return [str(w) for w in rows if turnout_id in w.turnouts or repr(turnout_id) in str(w)]
