"""Add a row to a table of the configuration, in the order of the table's own header, or leave it as it was."""

import csv
import io
import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from turnout.config.csv_table import TableFault, header_of
from turnout.config.document import Place
from turnout.config.table import no_tabs
from turnout.errors import ConfigError
from turnout.files import write_atomic


@contextmanager
def taken_back(path: Path) -> Iterator[None]:
    """What is written to ``path`` inside stays only if nothing is raised there."""
    path = Path(path)
    before = path.read_bytes() if os.path.lexists(path) else None
    try:
        yield
    except BaseException:
        if before is None:
            path.unlink(missing_ok=True)
        elif path.read_bytes() != before:
            _write(path, before)
        raise


def one_line(text: object) -> str:
    """Text as a cell holds it: None is empty, line breaks and tabs are blanks.

    >>> one_line("machine 09-3X\\n at night ")
    'machine 09-3X at night'
    """
    return re.sub(r"\s+", " ", "" if text is None else str(text)).strip()


def append_csv(path: Path, values: Mapping[str, str], columns: tuple[str, ...]) -> str:
    """Add one row to a CSV; a new table gets ``columns``. Returns the line; ConfigError where a value has no column."""
    try:
        header = header_of(path, str(path)) if path.exists() else columns
    except TableFault as fault:
        raise fault.error from None
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(_in_order(path, values, header))
    return _append(path, text.getvalue(), ",".join(columns))


def append_tsv(path: Path, values: Mapping[str, str], columns: tuple[str, ...]) -> str:
    """The same for a table with tabs between its columns, where a line that begins with # is a comment."""
    header = columns
    if path.exists():
        try:
            lines = path.read_text(encoding="utf-8-sig").splitlines()
        except UnicodeDecodeError as error:
            found = "a byte that is not UTF-8"
            raise ConfigError(path, f"byte {error.start}", found, "Save the file as UTF-8") from None
        titles = next((line for line in lines if line.strip() and not line.startswith("#")), "")
        if not titles:
            raise Place(str(path), 1, 1).error("an empty table", "Write a header: turnout<tab>layout<tab>...")
        header = tuple(title.strip() for title in titles.split("\t"))
        if wrong := no_tabs(header):
            raise Place(str(path), 1 + lines.index(titles), 1).error(*wrong)
    return _append(path, "\t".join(_in_order(path, values, header)), "\t".join(columns))


def _in_order(path: Path, values: Mapping[str, str], header: tuple[str, ...]) -> list[str]:
    said = {title: one_line(value) for title, value in values.items()}
    for title, value in said.items():
        if value and title not in header:
            remedy = "Add it to the header, or leave the value out"
            raise Place(str(path), 1, 1).error(f"no column {title!r} for {value!r}", remedy)
    return [said.get(title, "") for title in header]


def _append(path: Path, line: str, header: str) -> str:
    before = path.read_bytes() if path.exists() else f"{header}\n".encode()
    end = "\r\n" if b"\r\n" in before else "\n"
    gap = b"" if before.endswith(b"\n") else end.encode()
    _write(path, before + gap + (line + end).encode())
    return line


def _write(path: Path, content: bytes) -> None:
    """In one step: a table that people keep is whole or as it was. Where ``path`` is a link, its file is written."""
    write_atomic(path.resolve(), lambda stream: stream.write(content))
