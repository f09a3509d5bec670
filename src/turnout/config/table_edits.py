"""Add a row to a table of the configuration: by one command at a time, and checked before anything else sees it."""

import csv
import io
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from turnout.config.csv_table import TableError, header_of, rows_of
from turnout.config.document import Place
from turnout.config.turnouts_table import NO_PROJECT, separator_problem, titles_of
from turnout.errors import ConfigError, ConfigErrors
from turnout.files import remove_unfinished, temporary_path, write_atomic
from turnout.locks import folder_lock

CONFIGURATION = "the configuration"


@contextmanager
def added_row(path: Path, values: Mapping[str, str], columns: tuple[str, ...]) -> Iterator[dict[str, Path]]:
    """Context in which a table with one more row is checked; it replaces the table if no exception is raised.

    The folder is locked meanwhile, so that no other command loses its row. Any other program sees the table as it was,
    even if this process is killed.

    Parameters
    ----------
    path : Path
        The table: a TSV if its name says so, else a CSV. If it is a link, the file that it points to is written.
    values : mapping of str to str
        Column -> text; columns without a value stay empty.
    columns : tuple of str
        Header of a new table.

    Yields
    ------
    dict of str to Path
        Name of the table -> file with the additional row: the argument ``tables`` of ``load_configuration``.

    Raises
    ------
    ConfigError
        If a value has no column in the header, the table has no valid header, or its folder does not exist. Errors of
        the block in the new row name no line, because the table has no such line.
    TurnoutError
        If another command holds the folder for a minute, or without permission to write.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise ConfigError(path.parent, "the folder", "there is no such folder", NO_PROJECT)
    with folder_lock(path.parent, CONFIGURATION):
        content = _with_row(path, values, columns)
        trial = temporary_path(path)
        try:
            _write(trial, content, path)
            with _errors_of_new_row(path, content):
                yield {path.name: trial}
        finally:
            remove_unfinished(trial)
        _write(path.resolve(), content, path)


@contextmanager
def _errors_of_new_row(path: Path, content: bytes) -> Iterator[None]:
    """Context in which errors at the last line of ``content`` are said of a new row that was not written."""
    number = len(content.splitlines())

    def of_new_row(error: Exception) -> Exception:
        if not isinstance(error, ConfigError) or Path(error.path).name != path.name:
            return error
        if not re.fullmatch(rf"line {number}(, column \d+)?", error.place):
            return error
        return ConfigError(error.path, "the new row, which was not written", error.problem, error.remedy)

    try:
        yield
    except ConfigErrors as errors:
        raise ConfigErrors(map(of_new_row, errors.errors)) from None
    except ConfigError as error:
        raise of_new_row(error) from None


def turnout_and_section(name: str) -> tuple[str, str]:
    """Turnout and section of an id on the command line, such as "tommerup_s1/A7".

    Parameters
    ----------
    name : str
        A turnout, or turnout/section.

    Returns
    -------
    tuple of (str, str)
        The section is "" for the whole turnout.

    Raises
    ------
    ConfigError
        If the turnout is empty, or the section after a slash: what was meant for a section must not count for all.

    Examples
    --------
    >>> turnout_and_section("tommerup_s1/A7"), turnout_and_section("tommerup_s1")
    (('tommerup_s1', 'A7'), ('tommerup_s1', ''))
    """
    turnout, slash, section = name.strip().partition("/")
    if not turnout or (slash and not section):
        problem = f"no {'section after the slash' if turnout else 'turnout'} in {name!r}"
        raise ConfigError("the command line", "ID", problem, "Write TURNOUT or TURNOUT/SECTION")
    return turnout, section


def one_line(text: Any) -> str:
    r"""Text of a cell: None becomes empty, line breaks and tabs become blanks.

    Parameters
    ----------
    text : any
        Any value; None is empty.

    Returns
    -------
    str
        Text without line breaks and tabs.

    Examples
    --------
    >>> one_line("machine 09-3X\n at night ")
    'machine 09-3X at night'
    """
    return re.sub(r"\s+", " ", "" if text is None else str(text)).strip()


def _write(target: Path, content: bytes, path: Path) -> None:
    """Write a file; the exception of a failure names the table ``path``, for nobody knows the trial file."""
    try:
        write_atomic(target, lambda stream: stream.write(content))
    except OSError as error:
        error.filename = str(path)
        raise


def _with_row(path: Path, values: Mapping[str, str], columns: tuple[str, ...]) -> bytes:
    """Content of the table with one more row; a new table gets a header."""
    is_tsv = path.suffix == ".tsv"
    header, separator = columns, "\t" if is_tsv else ","
    if os.path.lexists(path):
        header, separator = (_tsv_header(path), "\t") if is_tsv else _csv_header(path)
    cells = _ordered_cells(path, values, header)
    before = path.read_bytes() if os.path.lexists(path) else f"{separator.join(columns)}\n".encode()
    end = b"\r\n" if b"\r\n" in before else b"\n"
    gap = b"" if before.endswith(b"\n") else end
    return before + gap + (separator.join(cells) if is_tsv else _csv_line(cells, separator)).encode() + end


def _csv_line(cells: list[str], separator: str) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="", delimiter=separator).writerow(cells)
    return text.getvalue()


def _csv_header(path: Path) -> tuple[tuple[str, ...], str]:
    try:
        return header_of(path, str(path))
    except TableError as fault:
        raise fault.error from None


def _tsv_header(path: Path) -> tuple[str, ...]:
    """Titles of a table with tabs between its columns and # before comments."""
    try:
        lines = rows_of(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ConfigError(path, f"line {line}", "a byte that is not UTF-8", "Save the file as UTF-8") from None
    if not lines:
        raise Place(str(path), 1, 1).error("an empty table", "Write a header: turnout<tab>layout<tab>...")
    number, text = lines[0]
    header = titles_of(text)
    if separator_error := separator_problem(header):
        raise Place(str(path), number, 1).error(*separator_error)
    return header


def _ordered_cells(path: Path, values: Mapping[str, str], header: tuple[str, ...]) -> list[str]:
    texts = {title: one_line(value) for title, value in values.items()}
    for title, value in texts.items():
        if value and title not in header:
            remedy = "Add it to the header, or leave the value out"
            raise Place(str(path), 1, 1).error(f"no column {title!r} for {value!r}", remedy)
    return [texts.get(title, "") for title in header]
