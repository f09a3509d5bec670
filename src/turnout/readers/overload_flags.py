"""Entries by which a logger says that a channel left its range during the recording."""

import re
from collections.abc import Collection, Iterable, Iterator

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import CHANNEL
from turnout.readers.rate_units import words_of
from turnout.readers.scale_words import plain_word
from turnout.readers.texts import decode_text

OVERLOAD = re.compile(
    r"overload|overld|ovr?ld|overflow|overrange|outofrange|clipp|saturat|u(?:e)?bersteuer|uberlauf|surcharge|sovraccaric"
)
# What is beside an overload: how it is detected, and at which value.
BESIDE_OVERLOAD = re.compile(
    r"detect|enabl|check|level|limit|thresh|schwell|mode|action|hold|time|margin|recover|type|%"
)
TRUE_WORDS = frozenset("true yes ja oui si on overload overloaded clipped saturated".split())
DENYING_WORDS = frozenset(
    "no not non none nein nicht kein keine ohne without sans aucun free never ok ingen off aus false".split()
)
MAX_WORDS = 5  # of a text that states an overload: a longer one may speak of it for another reason


def overload_entries(entries: Iterable[Entry], names: Collection[str] = ()) -> Iterator[Entry]:
    """Entries of the metadata that state an overload.

    Parameters
    ----------
    entries : iterable of Entry
        Metadata of a record.
    names : collection of str
        Names of its channels.

    Yields
    ------
    Entry
        Each whose name speaks of an overload and whose value is true, a number above 0, a channel, or a list with one;
        and each short text that speaks of an overload and does not deny it.

    Examples
    --------
    >>> entries = [Entry("head", "Overload", "yes"), Entry("head", "Overflow", 0), Entry("head", "Clip level", 9.0)]
    >>> [entry.name for entry in overload_entries(entries)]
    ['Overload']
    >>> entries = [Entry("head", "Overload", "ch 2"), Entry("head", "Status", "CH2 OVLD")]
    >>> entries.append(Entry("head", "Info", "no overload"))
    >>> [entry.name for entry in overload_entries(entries)]
    ['Overload', 'Status']
    """
    for entry in (e for e in entries if not e.is_piece):
        value = decode_text(entry.value) if isinstance(entry.value, bytes) else entry.value
        is_stated = is_of_overload(entry.name) and _is_true(value, names)
        if is_stated or (isinstance(value, str) and is_of_overload(value) and _is_statement(value)):
            yield entry


def is_of_overload(text: str) -> bool:
    """Whether a text speaks of an overload, and not of how it is detected.

    Parameters
    ----------
    text : str
        Name or value of an entry.

    Returns
    -------
    bool
    """
    word = plain_word(text)
    return bool(OVERLOAD.search(word)) and not BESIDE_OVERLOAD.search(word)


def _is_statement(text: str) -> bool:
    """Whether a text has few words, of which none denies it, and no numbers but those of channels."""
    words = words_of(text)
    return len(words) <= MAX_WORDS and DENYING_WORDS.isdisjoint(words) and not re.search(r"\d", CHANNEL.sub("", text))


def _is_true(value: object, names: Collection[str]) -> bool:
    """Whether a value says yes: a word, a number above 0, a channel, or a list with one of them."""
    if isinstance(value, bytes):
        value = decode_text(value)
    if isinstance(value, str):
        word = value.strip().casefold()
        if re.fullmatch(r"[\d\s,;]+", word):
            return any(map(int, re.findall(r"\d+", word)))
        is_channel = bool(CHANNEL.search(word)) and _is_statement(word)
        return word in TRUE_WORDS or is_channel or word in {name.strip().casefold() for name in names}
    if isinstance(value, (list, tuple, np.ndarray)):
        return any(_is_true(v, names) for v in np.ravel(np.asarray(value, dtype=object)).tolist())
    return isinstance(value, (bool, int, float, np.number, np.bool_)) and bool(value > 0)
