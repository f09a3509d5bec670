"""Entries by which an analyser says that an exponential window was applied: it adds its decay to that of every mode."""

import re
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.overload_flags import CLAUSES, is_denied
from turnout.readers.rate_units import words_of
from turnout.readers.texts import decode_text

EXPONENTIAL = re.compile(r"exp(?:on?|onent\w*)?")
WINDOW = re.compile(r"window\w*|wdw|\w*fenster\w*|fenetre\w*|vindue|finestra|ventana|weighting|bewertung|decay")
OTHER = re.compile(r"averag\w*|mittel\w*|moyenn\w*|fft\w*|display\w*")
TIME_WEIGHTING = re.compile(r"\btime weighting\b")  # of a level
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
    for entry in (e for e in entries if not e.is_piece):
        values = entry.value if isinstance(entry.value, (list, tuple, np.ndarray)) else [entry.value]
        if any(_states_window(entry.name, value) for value in np.ravel(np.asarray(values, dtype=object)).tolist()):
            yield entry


def _states_window(name: str, value: Any) -> bool:
    """Whether a value, or one of its clauses with the name, states an exponential window that nothing denies."""
    text = (decode_text(value) if isinstance(value, bytes) else str(value))[:200]
    if len(words_of(f"{name} {text}")) > MAX_WORDS:
        return False
    if _is_exponential_window(name):
        return not is_denied(text)
    clauses = CLAUSES.split(text)
    denied = [*map(is_denied, clauses), False]  # "exponential, not used": by the next clause, too
    return any(
        _is_exponential_window(f"{name} {clause}") and not any(denied[i : i + 2]) for i, clause in enumerate(clauses)
    )


def _is_exponential_window(text: str) -> bool:
    words = words_of(TIME_WEIGHTING.sub("", " ".join(words_of(text))))
    kinds = (any(map(pattern.fullmatch, words)) for pattern in (EXPONENTIAL, WINDOW))
    return all(kinds) and not any(map(OTHER.fullmatch, words))
