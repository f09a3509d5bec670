"""Where diagnoses are not proven on concealed data, and the sentence that says so with every answer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.simulate import TurnoutTrack

UNPROVEN_SWITCH = "Diagnoses of switch panels are not yet proven on concealed data."


def reservation(track: TurnoutTrack) -> str:
    """Sentence on a track whose diagnoses are not proven.

    Parameters
    ----------
    track : TurnoutTrack
        Track of the turnout with all of its routes.

    Returns
    -------
    str
        "" for a track without the blade of a switch.
    """
    has_switch = any(t.blade is not None for t in (track.track, *track.tracks.values()))
    return UNPROVEN_SWITCH if has_switch else ""


def as_unproven(row: Mapping[str, Any], reason: str) -> dict[str, Any]:
    """A finding where the diagnosis has not been proven: its sentence says so, and a name is at most of grade B.

    Parameters
    ----------
    row : mapping
        Row of ``mismatch_findings``.
    reason : str
        What has not been proven.

    Returns
    -------
    dict
        Column -> value.

    Examples
    --------
    >>> as_unproven({"grade": "A", "sentence": "Hanging sleeper."}, UNPROVEN_SWITCH)["grade"]
    'B'
    """
    return {**row, "grade": "B" if row["grade"] == "A" else row["grade"], "sentence": f"{row['sentence']} {reason}"}
