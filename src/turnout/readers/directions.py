"""Directions of sensors that a file states: one against an axis, such as -Z, needs the sign of the layout."""

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from turnout.readers.entry_owners import owners_of
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.source import RawRecord
from turnout.readers.texts import decode_text
from turnout.records import RawChannel

MINUS = r"[-\u2212\u2013]"
EDGE = r"[\s:._/,;()\[\]]"  # beside a direction; a hyphen between two words, as in "A1 - Z", is no minus
AGAINST_AXIS = re.compile(
    rf"^\s*{MINUS}\s?[XYZ](?:$|{EDGE})"
    rf"|{EDGE}{MINUS}[XYZ](?:$|{EDGE})"
    rf"|(?:^|{EDGE})[XYZ]{MINUS}(?:$|[\s,;:)\]]+(?!und\b|oder\b|and\b|or\b|et\b|og\b))"
    rf"|(?:^|{EDGE})(?:minus|neg(?:ative)?)[ _-]?[XYZ](?:$|{EDGE})",
    re.IGNORECASE,
)
UPSIDE_DOWN = re.compile(
    r"^\s*down\s*$|upside.?down|downwards?|abw(?:ä|ae)rts|nach unten|kopf(?:ü|ue)ber|vers le bas|nedad", re.IGNORECASE
)
# In the name of a channel itself; "down" there may be a place.
INVERTED = re.compile(
    r"upside.?down|(?<!non)(?<!un)(?<!no[nt][ _-])(?<!nicht[ _-])(?:inverted|invertiert|negated|flipped)", re.IGNORECASE
)
DIRECTION_NAME = re.compile(
    r"direction|richtung|orient|ausricht|^dof$|degreeoffreedom|axis$|achse$|mount|montage|einbau"
)
OTHER_NAME = re.compile(
    r"train|zug|travel|fahrt|driv|line|strecke|track|gleis|wind|scan|sort|cable|kabel|[xyz]axis$|time"
    r"|reference|force|hammer|impact|hit|strike|schlag|sto(?:ss|ß)|excit|anreg"  # of the force
)
DIRECTED = ("acceleration", "velocity", "displacement")  # quantities of a response; a hammer strikes in -Z
MAX_TEXT = 40  # characters: a longer text is a description


@lru_cache(maxsize=4096)
def is_against_axis(text: str) -> bool:
    """Whether a text states a direction against an axis.

    Parameters
    ----------
    text : str
        Name of a channel, or value of an entry.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_against_axis(text) for text in ("12 -Z", "rail:Z-", "neg_z", "rail inverted", "rail-z", "+Z", "Z-axis")]
    [True, True, True, True, False, False, False]
    """
    return len(text) <= MAX_TEXT and bool(AGAINST_AXIS.search(text) or INVERTED.search(text))


@lru_cache(maxsize=4096)
def is_direction_name(name: str) -> bool:
    """Whether a name means the direction in which a sensor measures.

    Parameters
    ----------
    name : str
        Name of an entry.

    Returns
    -------
    bool
        False for the direction of a train, of the track or of a force.
    """
    word = plain_word(name)
    return bool(DIRECTION_NAME.search(word)) and not OTHER_NAME.search(word)


def opposite_directions(record: RawRecord, channels: Sequence[RawChannel]) -> Iterator[tuple[int, str, str]]:
    """Responses that the file states to be measured against an axis, and that the layout takes with the sign +1.

    Parameters
    ----------
    record : RawRecord
        The record as it is in the file.
    channels : sequence of RawChannel
        Channels of the layout.

    Yields
    ------
    tuple of (int, str, str)
        Index of the channel; name of the entry, which may be the channel's own; its text.
    """
    rows = {record.row_of(c.source) for c in channels if c.quantity in DIRECTED and c.sign > 0}
    wanted = sorted(row for row in rows if row is not None)
    yield from ((i, record.names[i], record.names[i]) for i in wanted if is_against_axis(record.names[i]))
    for entry in record.entries:
        if entry.is_piece or not is_direction_name(entry.name):
            continue
        values = entry.value.ravel().tolist() if isinstance(entry.value, np.ndarray) else entry.value
        if isinstance(values, (list, tuple)) and len(values) == len(record.names):  # one for each channel
            yield from ((i, entry.name, text) for i in wanted if (text := _opposite_text(values[i])))
        elif text := _opposite_text(values):
            owners = owners_of(entry, record.entries, record.names)
            yield from ((i, entry.name, text) for i in wanted if not owners or i in owners)


def _opposite_text(value: Any) -> str:
    """The text of a value if it states a direction against an axis, else ""."""
    value = decode_text(value) if isinstance(value, bytes) else value
    if not isinstance(value, str) or len(value) > MAX_TEXT:
        return ""
    return value if is_against_axis(value) or UPSIDE_DOWN.search(value) else ""
