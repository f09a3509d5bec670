"""Column of a table that numbers the records, and the rows of each record."""

import re
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from turnout.errors import ReadError
from turnout.readers.channel_maps import kind_of
from turnout.readers.clock_texts import is_clock_or_date
from turnout.readers.lazy import Column
from turnout.readers.record_numbers import with_missing
from turnout.readers.source import COPY_AGAIN, Source
from turnout.readers.texts import decode_text

RECORD_NAME = re.compile(
    r"(?:record|rec|segment|impact|hit|shot|schlag|coup)"
    r"(?P<number>[_ .-]?(?:no|nr|num|number|nummer|id|index|n°|#)\.?)?",
    re.IGNORECASE,
)
LOST_REMEDY = f"{COPY_AGAIN}; if that impact was rejected in the field, the others can be used as they are"


def may_number_records(name: str) -> bool:
    """Whether a column of this name may number the records.

    Parameters
    ----------
    name : str
        Name of a column.

    Returns
    -------
    bool

    Examples
    --------
    >>> [may_number_records(name) for name in ("record", "Impact No", "Schlag-Nr.", "hit", "force")]
    [True, True, True, True, False]
    """
    return bool(RECORD_NAME.fullmatch(name.strip()))


def record_column(columns: Mapping[str, Column], source: Source) -> str | None:
    """Name of the column that numbers the records.

    Under another name than "record" it has whole numbers that never fall, in blocks of one length but for the last:
    a force, or a flag that is set at the contact, may have such a name as well. Blocks of any length count under a
    name that says "number", as "Impact No"; that of one impact alone is constant. Columns under names that are not
    known are examined by their form (``record_borders``).

    Parameters
    ----------
    columns : mapping of str to Column
        Columns by name.
    source : Source
        The raw file.

    Returns
    -------
    str or None
        None without such a column.

    Raises
    ------
    ReadError
        If a column "record" holds texts or does not number every row: all records would be read as one.
    """
    names = [name for name in columns if may_number_records(name)]
    for name in sorted(names, key=lambda name: not _is_record(name)):
        column = columns[name]
        if _is_record(name) and column.dtype.kind in "OUST" and len(column):
            problem = f"it holds {kind_of(column.dtype)}, such as {str(column[:1][0])[:60]!r}"
            raise source.error(f"column {name!r}", problem, "Write the numbers of the records as whole numbers")
        if column.dtype.kind not in "fiu":
            continue
        numbers = _signed_numbers(column)
        if _is_record(name) and not np.isfinite(numbers).all():
            raise source.error(f"column {name!r}", "it does not number every row", COPY_AGAIN)
        is_single = _is_number(name) and len(numbers) > 0 and bool((numbers == np.rint(numbers[0])).all())
        if _is_record(name) or is_single or _numbers_blocks(numbers, _is_number(name)):
            return name
    return None


def _is_record(name: str) -> bool:
    return name.strip().lower() == "record"


def _is_number(name: str) -> bool:
    """Whether a name says that it is a number of records, as "Impact No"."""
    match = RECORD_NAME.fullmatch(name.strip())
    return match is not None and match["number"] is not None


def _signed_numbers(numbers: Column) -> np.ndarray:
    """The numbers, those without a sign as with one: else 1 after 2 would be a step of 255."""
    values = np.asarray(numbers[:])
    return values.astype(np.int64) if values.dtype.kind == "u" else values


def _numbers_blocks(numbers: np.ndarray, is_number: bool) -> bool:
    """Whether whole numbers never fall, in blocks of one length but for the last; of any length under ``is_number``."""
    if not np.isfinite(numbers).all() or (numbers != np.rint(numbers)).any() or (np.diff(numbers) < 0).any():
        return False
    lengths = np.diff([0, *(np.flatnonzero(np.diff(numbers)) + 1), len(numbers)])
    if is_number:
        return len(lengths) > 1 and lengths[:-1].min() > 1
    return len(lengths) > 1 and lengths[0] > 1 and len(set(lengths[:-1])) == 1 and lengths[-1] <= lengths[0]


def spans_of_records(numbers: Column | None, n_row: int) -> list[slice | None]:
    """Rows of each record in the order of the file, None for one whose number is missing between two others.

    Numbers that fall are those of another counter, so none is missing.

    Parameters
    ----------
    numbers : (n_row,) Column or None
        The column that numbers the records; None: all rows are one record.
    n_row : int
        Number of rows.

    Returns
    -------
    list of (slice or None)

    Examples
    --------
    >>> spans_of_records(np.array([1, 1, 2, 2, 4, 4]), 6)
    [slice(0, 2, None), slice(2, 4, None), None, slice(4, 6, None)]
    """
    if numbers is None:
        return [slice(0, n_row)]
    values = _signed_numbers(numbers)
    edges = [0, *(int(k) + 1 for k in np.flatnonzero(np.diff(values))), n_row]
    spans = [slice(a, b) for a, b in pairwise(edges)]
    numbers_of_spans = values[edges[:-1]] if n_row else np.empty(0)
    if (numbers_of_spans != np.rint(numbers_of_spans)).any() or (np.diff(numbers_of_spans) < 1).any():
        return [*spans]
    span_of = dict(zip(map(int, numbers_of_spans), spans))
    return [span_of.get(number) for number in with_missing(span_of)]


def numbers_of_texts(texts: np.ndarray) -> np.ndarray:
    """A number for each text of a column, in the order in which the texts appear.

    Parameters
    ----------
    texts : (n,) array of str
        A column of texts.

    Returns
    -------
    (n,) array of int
        Equal texts have equal numbers.

    Examples
    --------
    >>> numbers_of_texts(np.array(["hit 1", "hit 1", "hit 2", "hit 1"]))
    array([0, 0, 1, 0])
    """
    numbers: dict[str, int] = {}
    return np.array([numbers.setdefault(str(text), len(numbers)) for text in texts], dtype=int)


def are_texts(column: Column) -> bool:
    """Whether a column holds texts other than dates and times of day.

    Parameters
    ----------
    column : (n,) Column
        A column as it is in the file.

    Returns
    -------
    bool
        False for an empty column. Its first cells may be empty.

    Examples
    --------
    >>> are_texts(np.array(["hit 1", "hit 2"])), are_texts(np.array(["10:00:01", "10:00:02"])), are_texts(np.arange(3))
    (True, False, False)
    """
    if column.dtype.kind not in "OUST" or not len(column):
        return False
    first = next((cell for cell in np.asarray(column[:]).tolist() if cell not in (None, "", b"")), None)
    first = decode_text(first) if isinstance(first, bytes) else first
    return isinstance(first, str) and not is_clock_or_date(first)


def missing_record(k: int, n: int, source: Source) -> ReadError:
    """Error of a record whose number is missing.

    Parameters
    ----------
    k : int
        Number of the record, from 0.
    n : int
        Number of records.
    source : Source
        The raw file.

    Returns
    -------
    ReadError
        It is returned, not raised.
    """
    problem = "its number is missing between those of its neighbours"
    return source.error(f"record {k + 1} of {n}", problem, LOST_REMEDY, reason="truncated")
