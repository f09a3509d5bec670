"""The first or the last row of a text file, if it is written otherwise than the others: it may be no sample."""

import re
from collections.abc import Iterator, Sequence
from mmap import mmap

from turnout.errors import ReadError
from turnout.readers.csv_cells import cells_of, decode_line, is_text
from turnout.readers.csv_header import Head
from turnout.readers.csv_rows import line_number
from turnout.readers.source import Source

N_COMPARED = 20, 100  # fewest and most rows with which the first or the last one is compared
N_DESCRIBING = 5  # rows at the beginning or the end that may describe the columns, as a mean and a deviation do
DECIMALS = re.compile(r"[+-]?\d*(?:[.,](\d*))?([eE][+-]?\d+)?")
ZERO = re.compile(r"[+-]?0*[.,]?0*(?:[eE][+-]?\d+)?")
ROW_REMEDY = "Delete this row if it is no sample; write what it states into a line above, such as 'rate: 20000'"


def outer_row_remarks(data: bytes | mmap, head: Head, end: int, source: Source) -> Iterator[ReadError]:
    """Remark on the first or the last row if it is written otherwise than the others: it may describe the columns.

    In each column its number has other decimals than all others. A row of zeros is a sample.

    Parameters
    ----------
    data : bytes or mmap
        Bytes of the file.
    head : Head
        The lines above the rows.
    end : int
        Byte behind the rows.
    source : Source
        The text file.

    Yields
    ------
    ReadError
        The remark.

    Raises
    ------
    ReadError
        If none of its numbers is 0, at which computed signals begin.
    """
    position = head.offset
    top: list[bytes] = []
    while len(top) <= N_COMPARED[1] and 0 <= position < end:
        start, position = position, data.find(b"\n", position, end) + 1 or end
        top.append(data[start:position])
    size = (N_COMPARED[1] + 2) * max(map(len, top), default=0)
    bottom = data[max(head.offset, end - size) : end].splitlines()[:0:-1][: N_COMPARED[1] + 1]
    for lines, position in ((top, head.offset), (bottom, end - 1)):
        rows = [cells_of(decode_line(line), head.separator) for line in lines]
        columns = [column for column in zip(*rows) if column[0] and not is_text(column[-1])]
        numbers = [column[0][:MAX_SIZE] for column in columns]
        if len(rows) <= N_COMPARED[0] or not columns or all(map(ZERO.fullmatch, numbers)):
            continue
        if all(_is_written_otherwise(column[0], column[N_DESCRIBING:]) for column in columns):
            where = f"line {line_number(data, position) + 1}"
            listed = ", ".join(map(repr, numbers[:MAX_LISTED]))
            problem = f"its numbers have other decimals than those of the other rows ({listed}): it may be no sample"
            if not any(map(ZERO.fullmatch, numbers)):
                raise source.error(where, problem, ROW_REMEDY, reason="wrong_length")
            yield source.error(where, problem, ROW_REMEDY, reason="entry_unknown")


MAX_SIZE = 20  # characters of a cell that a message quotes
MAX_LISTED = 4  # cells that a message quotes


def _is_written_otherwise(cell: str, cells: Sequence[str]) -> bool:
    """Whether a number has other decimals than all others, which have as many each; or it is whole and none of them."""
    shapes = [(bool(m[2]), len(m[1] or "")) for c in (cell, *cells) if (m := DECIMALS.fullmatch(c))]
    if len(shapes) <= len(cells):  # one of them is no number
        return False
    is_uniform = len(set(shapes[1:])) == 1
    return (
        shapes[0] != shapes[1]
        if is_uniform
        else shapes[0] == (False, 0) and min(n for _, n in shapes[1:]) >= MIN_DECIMALS
    )


MIN_DECIMALS = 2  # of numbers printed to as many digits as they need: by chance 1 in 100 is whole
