"""Entries by which an analyser says that an exponential window was applied: it adds its decay to that of every mode."""

import re
from collections.abc import Iterable, Iterator

from turnout.readers.entries import Entry
from turnout.readers.overload_flags import DENYING_WORDS
from turnout.readers.rate_units import words_of
from turnout.readers.texts import decode_text

EXPONENTIAL = re.compile(r"exp(?:o(?:nent\w*)?)?")
WINDOW = re.compile(r"window\w*|wdw|\w*fenster\w*|fenetre\w*|vindue|finestra|ventana|weighting|bewertung|decay")
OTHER = re.compile(r"averag\w*|mittel\w*|moyenn\w*|fft\w*|display\w*|exposure|export\w*|expected|experiment\w*")
WINDOW_PROBLEM = "that an exponential window was applied to its samples, which adds damping to every mode"
WINDOW_REMEDY = "Export the signals without a window, or subtract its decay rate from that of each mode"
MAX_WORDS = 12  # of a name and a value that state a window


def is_window_name(name: str) -> bool:
    """Whether an entry of this name may state the windows of channels.

    Parameters
    ----------
    name : str
        Name of an entry of the metadata.

    Returns
    -------
    bool
    """
    return any(map(WINDOW.fullmatch, words_of(name)))


def window_entries(entries: Iterable[Entry]) -> Iterator[Entry]:
    """Entries of the metadata that state an exponential window.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.

    Yields
    ------
    Entry
        Each whose name and value together speak of such a window, and do not deny it.

    Examples
    --------
    >>> stated = Entry("line 1", "Response window", "Exponential"), Entry("line 2", "Exponential window", "off")
    >>> [entry.name for entry in window_entries([*stated, Entry("line 3", "Averaging", "exponential")])]
    ['Response window']
    """
    for entry in entries:
        value = decode_text(entry.value) if isinstance(entry.value, bytes) else str(entry.value)
        words = words_of(f"{entry.name} {value[:200]}")
        is_stated = any(map(EXPONENTIAL.fullmatch, words)) and any(map(WINDOW.fullmatch, words))
        is_denied = not DENYING_WORDS.isdisjoint(words) or value in ("0", "0.0") or any(map(OTHER.fullmatch, words))
        if is_stated and not is_denied and len(words) <= MAX_WORDS and not entry.is_piece:
            yield entry
