"""Words beside the samples of a record, in any format: states of a logger, overloads, samples that are invalid."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from turnout.readers.entries import Entry
from turnout.readers.overload_flags import is_of_overload
from turnout.readers.source import Source
from turnout.readers.texts import decode_text

MAX_WORDS = 8  # different words of a column of states; names of channels in a table of the head are more
# Words of an overload in a column of states, where they need no channel beside them.
OVERLOADS = frozenset(
    "over ovr ovl ovfl ol clip clipped sat saturated overloaded überlast ueberlast überlastet ueberlastet sättigung "
    "saettigung gesättigt gesaettigt dépassement depassement saturé sature saturée saturee overbelastet overstyret "
    "mætning mættet".split()
)
# Words that say of a sample that it is none.
INVALID = frozenset(
    "invalid bad error err fault ungültig ungueltig fehler fehlerhaft gestört gestoert invalide erreur défaut defaut "
    "ugyldig fejl".split()
)
# Words that say yes or no of each sample: numbers say it without doubt.
FLAGS = INVALID | frozenset("true false yes no on off ja nein oui non valid gültig gueltig valide gyldig".split())


def entries_of_words(columns: Mapping[str, np.ndarray]) -> Iterator[Entry]:
    """Entries of the words of columns, by which a logger may say what it did to the samples, or that it was overloaded.

    One of several words with a number is the name of a state: "step 4" states no step of the samples.

    Parameters
    ----------
    columns : mapping of str to (n,) array of str, bytes or object
        Texts by the name of their column, None where one is empty.

    Yields
    ------
    Entry
        One for each word of an overload, and then for the rarest others.

    Examples
    --------
    >>> words = np.array(["run", "step 4", "run", "OVR", "run"])
    >>> [entry.value for entry in entries_of_words({"State": words})]
    ['overload: OVR', 'run']
    """
    for name, column in columns.items():
        words = rarest_words(column)
        texts = [f"overload: {word}" if word.casefold() in OVERLOADS else word for word in words]
        texts = [text for text in texts if len(words) == 1 or is_of_overload(text) or not re.search(r"\d", text)]
        texts.sort(key=lambda text: not is_of_overload(text))
        yield from (Entry(f"column {name!r}", name, text) for text in texts[:MAX_WORDS])


def rarest_words(column: np.ndarray) -> tuple[str, ...]:
    """The different words of a column, the rarest first.

    Parameters
    ----------
    column : (n,) array of str, bytes or object
        Texts, None where one is empty.

    Returns
    -------
    tuple of str
    """
    counts = Counter(filter(None, _words(column)))
    return tuple(sorted(counts, key=counts.__getitem__))


def check_valid(columns: Mapping[str, np.ndarray], source: Source) -> None:
    """Check that no word says of a sample that it is invalid.

    Parameters
    ----------
    columns : mapping of str to (n,) array of str, bytes or object
        Texts by the name of their column, None where one is empty.
    source : Source
        The raw file, for the message.

    Raises
    ------
    ReadError
        If one does. The channels that it is about may have any number there.
    """
    for name, column in columns.items():
        for i, word in enumerate(_words(column)):
            if word.casefold() in INVALID:
                problem = f"{word!r} in row {i + 1} of the samples says that they are invalid there"
                raise source.error(f"column {name!r}", problem, INVALID_REMEDY)


INVALID_REMEDY = "Export the valid part alone; leave this column out if it is not about the sensors"


def _words(column: np.ndarray) -> Iterator[str]:
    """The text of each row without blanks around it, "" where it is empty."""
    for cell in column.tolist():
        text = decode_text(cell) if isinstance(cell, bytes) else cell
        yield "" if text is None else str(text).strip()
