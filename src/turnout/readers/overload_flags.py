"""Entries by which a logger says that a channel left its range during the recording."""

import re
from collections.abc import Iterable, Iterator

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.scale_words import plain_word
from turnout.readers.texts import decode_text

OVERLOAD = re.compile(
    r"overload|overflow|overrange|outofrange|clipp|saturat|u(?:e)?bersteuer|uberlauf|surcharge|sovraccaric"
)
# What is beside an overload: how it is detected, and at which value.
BESIDE_OVERLOAD = re.compile(
    r"detect|enabl|check|level|limit|thresh|schwell|mode|action|hold|time|margin|recover|type|%"
)
TRUE_WORDS = frozenset("true yes ja oui si on overload overloaded clipped saturated".split())


def overload_entries(entries: Iterable[Entry]) -> Iterator[Entry]:
    """Entries of the metadata that state an overload.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.

    Yields
    ------
    Entry
        Each whose name speaks of an overload and whose value is true, a number above 0, or a list with one.

    Examples
    --------
    >>> entries = [Entry("head", "Overload", "yes"), Entry("head", "Overflow", 0), Entry("head", "Clip level", 9.0)]
    >>> [entry.name for entry in overload_entries(entries)]
    ['Overload']
    """
    for entry in entries:
        word = plain_word(entry.name)
        if OVERLOAD.search(word) and not BESIDE_OVERLOAD.search(word) and not entry.is_piece and _is_true(entry.value):
            yield entry


def _is_true(value: object) -> bool:
    """Whether a value says yes: a word, a number above 0, or a list with one of them."""
    if isinstance(value, bytes):
        value = decode_text(value)
    if isinstance(value, str):
        word = value.strip().casefold()
        return word in TRUE_WORDS or (word.isdecimal() and int(word) > 0)
    if isinstance(value, (list, tuple, np.ndarray)):
        return any(map(_is_true, np.ravel(np.asarray(value, dtype=object)).tolist()))
    return isinstance(value, (bool, int, float, np.number, np.bool_)) and bool(value > 0)
