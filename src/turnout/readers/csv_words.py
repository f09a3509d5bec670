"""Columns of words beside the numbers of a text file: alarms, digital inputs, states and marks of a logger."""

import re
from collections.abc import Sequence
from mmap import mmap

import numpy as np

from turnout.readers.clock_texts import is_clock_or_date
from turnout.readers.csv_cells import cells_of, decode_line, is_number, is_word
from turnout.readers.entries import Entry
from turnout.readers.lazy import Column
from turnout.readers.overload_flags import is_of_overload
from turnout.readers.source import Source

N_ROWS = 32  # rows in which the same columns hold words: so many are no lines of a head
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
MAX_SIZE = 20  # characters of a word


def is_row_with_words(data: bytes | mmap, position: int, separator: str) -> bool:
    """Whether rows of samples begin at a line, of which each has words in the same columns.

    A word that only some of the rows have is a label: "Minimum;-3.5;-61.7" above the samples. Flags are no such words.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the file.
    position : int
        First byte of the line.
    separator : str
        Separator of the cells.

    Returns
    -------
    bool
        False for fewer than 32 rows, and where a column has more than eight words.
    """
    words: dict[int, set[str]] = {}
    width = 0
    for n_row in range(N_ROWS):
        end = data.find(b"\n", position)
        if end < 0:
            return False
        cells = cells_of(decode_line(data[position:end]), separator)
        position = end + 1
        are_words = [is_word(cell) for cell in cells]
        if any(is_word and not _is_state(cell) for is_word, cell in zip(are_words, cells)):
            return False
        if n_row == 0:
            width, words = len(cells), {i: set() for i, is_word in enumerate(are_words) if is_word}
            has_number = any(map(is_number, cells))
            if not words or not has_number:
                return False
        if len(cells) != width or any(is_word and i not in words for i, is_word in enumerate(are_words)):
            return False
        for i, of_column in words.items():
            of_column.add(cells[i])
            if not are_words[i] or len(of_column) > MAX_WORDS:
                return False
    return True


def _is_state(word: str) -> bool:
    """Whether a word may be a state or a mark beside a sample: no flag, no overload, and no number with other marks."""
    plain = word.casefold()
    is_flag = plain in FLAGS or plain in OVERLOADS or is_of_overload(word)
    return len(word) <= MAX_SIZE and not is_flag and re.match(r"[+-]?[.,]?\d", word) is None


def are_words(column: np.ndarray) -> bool:
    """Whether a column that was read as text has states or marks, and no number, flag or overload.

    Parameters
    ----------
    column : (n,) array of object
        Its cells, None where one is empty.

    Returns
    -------
    bool
    """
    words = {cell.strip() for cell in column.tolist() if cell is not None}
    return bool(words) and all(is_word(word) and _is_state(word) for word in words)


def holds_words(column: Column) -> bool:
    """Whether a column was read as text and its first text is neither a date nor a time of day.

    Parameters
    ----------
    column : (n,) array or LazyColumn
        A column of the file.

    Returns
    -------
    bool
    """
    texts = np.asarray(column[:]).tolist() if column.dtype.kind == "O" else []
    first = next((text for text in texts if text is not None), "")
    return bool(first) and not is_clock_or_date(first)


def check_valid(name: str, column: np.ndarray, source: Source) -> None:
    """Check that no word of a column says of a sample that it is invalid.

    Parameters
    ----------
    name : str
        Name of the column.
    column : (n,) array of object
        Its cells, None where one is empty.
    source : Source
        The text file, for the message.

    Raises
    ------
    ReadError
        If one does. The channels that it is about may have any number there.
    """
    for i, cell in enumerate(column.tolist()):
        if cell is not None and cell.strip().casefold() in INVALID:
            problem = f"{cell.strip()!r} in row {i + 1} of the samples says that they are invalid there"
            raise source.error(f"column {name!r}", problem, INVALID_REMEDY)


INVALID_REMEDY = "Export the valid part alone; leave this column out if it is not about the sensors"


def entries_of_words(name: str, column: np.ndarray) -> Sequence[Entry]:
    """Entries of the words of a column, by which a logger may say that a channel left its range.

    Parameters
    ----------
    name : str
        Name of the column.
    column : (n,) array of object
        Its cells, None where one is empty.

    Returns
    -------
    sequence of Entry
        One for each of its first words, those of an overload before all others.
    """
    words = dict.fromkeys(cell.strip() for cell in column.tolist() if cell is not None)
    texts = [f"overload: {word}" if word.casefold() in OVERLOADS else word for word in words]
    texts.sort(key=lambda text: not is_of_overload(text))
    return [Entry(f"column {name!r}", name, text) for text in texts[:MAX_WORDS]]
