"""Entries by which a logger says that a channel left its range during the recording."""

import re
from collections.abc import Collection, Iterable, Iterator

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.entry_owners import CHANNEL
from turnout.readers.rate_statements import PLACEHOLDERS
from turnout.readers.rate_units import words_of
from turnout.readers.scale_vocabulary import plain_word
from turnout.readers.texts import decode_text

OVERLOAD = re.compile(
    r"overload|overld|ovr?ld|overflow|overrange|outofrange|clipp|saturat|u(?:e)?bersteuer|uberlauf|surcharge|sovraccaric"
)
# What is beside an overload: how it is detected, and at which value.
BESIDE_OVERLOAD = re.compile(
    r"detect|enabl|check|level|limit|thresh|schwell|mode|action|hold|time|margin|recover|type|protect|proof|capacity"
    r"|factor|(?<!satu)ratio|rating|%"
)
# Words that are said of rails, ballast and wagons, too: beside them only channels are named, or their signals.
AMBIGUOUS = re.compile(r"clipped|saturated|overloaded")
OF_SIGNALS = frozenset("adc amplifier at channel channels eingang input is kanal of on sensor signal the was".split())
CLAUSES = re.compile(r"[,;/|&\n]|\b(?:and|und|et|og|och)\b")
TRUE_WORDS = frozenset("true yes y ja oui si on overload overloaded clipped saturated".split())
DENYING_WORDS = frozenset(
    "no not non none nein nicht kein keine ohne without sans aucun free never ok ingen off aus false disabled inactive "
    "deactivated deaktiviert inaktiv unused uniform rectangular".split()
)
COUNT = re.compile(
    r"(?i)[\[(]?(?<![\d.,])[1-9]\d* ?(?:samples?|points?|times?|values?|events?|werte?|abtastwerte?|punkte|mal|x)\b"
    r"[\])]?"
)
MAX_WORDS = 5  # of a clause that states an overload: a longer one may speak of it for another reason


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
        if is_stated or (isinstance(value, str) and any(_is_statement(c, names) for c in CLAUSES.split(value))):
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


def is_denied(text: str) -> bool:
    """Whether a text says no: by a word, the number 0, or no value at all.

    Parameters
    ----------
    text : str
        Value of an entry, or a part of it.

    Returns
    -------
    bool

    Examples
    --------
    >>> [is_denied(text) for text in ("not used", "0 %", "n/a", "", "0.5 %", "on")]
    [True, True, True, True, False, False]
    """
    is_zero = bool(re.match(r"\s*0+(?:[.,]0*)?(?![\d.,])", text))
    return is_zero or text.strip().casefold() in PLACEHOLDERS or not DENYING_WORDS.isdisjoint(words_of(text))


def _is_statement(clause: str, names: Collection[str]) -> bool:
    """Whether a clause of a few words says that a channel left its range; its only numbers are those of channels."""
    words = words_of(clause)
    if not is_of_overload(clause) or is_denied(clause) or len(words) > MAX_WORDS:
        return False
    remainder = _without_channels(clause, names)
    if any(map(AMBIGUOUS.search, words)):
        further_words = [word for word in words_of(remainder) if not OVERLOAD.search(plain_word(word))]
        return len(words) > 1 and OF_SIGNALS.issuperset(further_words)
    return not re.search(r"\d", remainder)


def _without_channels(clause: str, names: Collection[str]) -> str:
    """A clause without the numbers of channels and their names, of which one may be a number and says nothing."""
    words = [name for name in sorted(names, key=len, reverse=True) if re.search(r"[^\W\d]", name)]
    of_names = "|".join(map(re.escape, words))
    clause = CHANNEL.sub(" ", COUNT.sub(" ", clause))
    return re.sub(rf"(?i)(?<![^\W_])(?:{of_names})(?![^\W_])", " ", clause) if of_names else clause


def _is_true(value: object, names: Collection[str]) -> bool:
    """Whether a value says yes: a word, a number above 0, a channel, or a list with one of them."""
    if isinstance(value, bytes):
        value = decode_text(value)
    if isinstance(value, str):
        is_empty = value.strip().casefold() in PLACEHOLDERS
        return not is_empty and any(_is_clause_true(clause, names) for clause in CLAUSES.split(value))
    if isinstance(value, (list, tuple, np.ndarray)):
        return any(_is_true(v, names) for v in np.ravel(np.asarray(value, dtype=object)).tolist())
    return isinstance(value, (bool, int, float, np.number, np.bool_)) and bool(value > 0)


def _is_clause_true(clause: str, names: Collection[str]) -> bool:
    """Whether a clause is a word that says yes, a number above 0, or names a channel and does not deny it."""
    remainder = _without_channels(clause, names).strip(" :=")
    if remainder.casefold() in TRUE_WORDS or re.fullmatch(r"[\d\s.]+", remainder):
        return not is_denied(remainder) or bool(re.search("[1-9]", remainder))
    return remainder != clause.strip(" :=") and OF_SIGNALS.issuperset(words_of(remainder))
