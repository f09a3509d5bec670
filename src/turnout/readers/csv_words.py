"""Columns of words beside the numbers of a text file: alarms, digital inputs, states and marks of a logger."""

import re
from mmap import mmap

import numpy as np

from turnout.readers.clock_texts import is_clock_or_date
from turnout.readers.csv_cells import cells_of, decode_line, is_number, is_word
from turnout.readers.lazy import Column
from turnout.readers.overload_flags import is_of_overload
from turnout.readers.word_columns import FLAGS, MAX_WORDS, OVERLOADS

N_ROWS = 32  # rows in which the same columns hold words: so many are no lines of a head
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
