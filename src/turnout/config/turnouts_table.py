"""Reader of config/turnouts.tsv: one row per turnout."""

import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from turnout.config.csv_table import rows_of
from turnout.config.document import Place, as_config_errors
from turnout.config.file_names import file_key, name_problem
from turnout.config.layout_schema import HAMMER_RATE, PASSAGE_RATE
from turnout.config.schema import ID, Key, suggestion, value_problem
from turnout.errors import ConfigError
from turnout.number_text import decimal_number

NO_TABLE = "Run 'turnout add ID LAYOUT' to begin one"
NO_PROJECT = "Run the command in the folder of a project; 'turnout init FOLDER' makes one"
ROW = {
    "turnout": Key("text", "id: letters, digits, _ and -", required=True, pattern=ID),
    "layout": Key("text", "the name of a file in config/layouts/, without .yaml", required=True),
    "raw": Key("text", "folder of its raw files below the raw root; empty: its id"),
    "name": Key("text", "name for display"),
    "line": Key("text", "railway line"),
    "km": Key("number", "position along the line", unit="km", minimum=0, maximum=10000),
    "lat_deg": Key("number", "latitude, WGS 84", unit="°", minimum=-90, maximum=90),
    "lon_deg": Key("number", "longitude, WGS 84", unit="°", minimum=-180, maximum=180),
    "external_id": Key("text", "the owner's id"),
    "id_scheme": Key("text", "scheme of external_id: railML, RINF, the owner's own"),
    "hammer_rate_hz": replace(HAMMER_RATE, meaning="samples per second of its hammer tests", nullable=False),
    "hammer_format": Key("text", "reader of its hammer tests"),
    "passage_rate_hz": replace(PASSAGE_RATE, meaning="samples per second of its passages", nullable=False),
    "passage_format": Key("text", "reader of its passages"),
    "pad_type": Key("text", "railpad of all its sections"),
    "sleeper_type": Key("text", "sleeper of all its sections"),
}


@dataclass(frozen=True)
class Row:
    """``values`` of the cells that are not empty, numbers as float; ``line`` is counted from 1."""

    values: dict[str, Any]
    line: int
    cells: tuple[str, ...]
    header: tuple[str, ...]
    path: str

    @property
    def id(self) -> str:
        """The id of the turnout."""
        return self.values["turnout"]

    @property
    def raw(self) -> str:
        """Its folder below the raw root; its id if the column is empty."""
        return self.values.get("raw", self.id)

    def place(self, column: str) -> Place:
        """Where the cell of ``column`` starts.

        Parameters
        ----------
        column : str
            Title of the column.

        Returns
        -------
        Place
            Where its cell starts; the start of the line if the table has no such column.
        """
        if column not in self.header:
            return Place(self.path, self.line, 1)
        before = self.cells[: self.header.index(column)]
        return Place(self.path, self.line, 1 + sum(len(cell) + 1 for cell in before))


def read_table(path: Path, name: str) -> tuple[list[Row], list[ConfigError]]:
    """Valid rows of turnouts.tsv, and the errors of the other rows.

    Parameters
    ----------
    path : Path
        turnouts.tsv.
    name : str
        What errors call the file.

    Returns
    -------
    tuple of (list of Row, list of ConfigError)
        The rows in their order, and the errors.
    """
    if not os.path.lexists(path):
        remedy = NO_TABLE if Path(path).parent.is_dir() else NO_PROJECT
        return [], [ConfigError(name, "the path", "there is no such file", remedy)]
    try:
        with as_config_errors(name, "line 1"):
            numbered = rows_of(Path(path).read_text(encoding="utf-8-sig"))
    except ConfigError as error:
        return [], [error]
    if not numbered:
        return [], [ConfigError(name, "line 1", "an empty table", "Write a header: turnout<tab>layout<tab>...")]
    header = titles_of(numbered[0][1])
    if errors := list(_header_errors(header, name, *numbered[0])):
        return [], errors
    rows: list[Row] = []
    line_of_id: dict[str, int] = {}
    folders: dict[str, Row] = {}
    ids: dict[str, Row] = {}
    for line, text in numbered[1:]:
        n_before = len(errors)
        row, row_errors = _row(text, line, header, name)
        errors += row_errors
        if row_errors:
            _note_turnouts((row,), row_errors)
            continue
        first = None
        if row.id in line_of_id:
            remedy = f"Give it another id, or remove one of the lines {line_of_id[row.id]} and {line}"
            errors.append(row.place("turnout").error(f"turnout {row.id!r} for the second time", remedy))
        elif (key := file_key(row.id)) in ids:
            first = ids[key]
            problem = f"turnout {row.id!r} and {first.id!r} differ only in capitals: on some file systems one folder"
            errors.append(row.place("turnout").error(problem, "Give it another id"))
        elif (folder := file_key(row.raw)) in folders and row.raw != folders[folder].raw:
            first = folders[folder]
            problem = f"raw folders {row.raw!r} and {first.raw!r} are one folder on some file systems"
            errors.append(row.place("raw").error(problem, "Give each turnout its own folder"))
        elif folder in folders:
            first = folders[folder]
            problem = f"raw folder {row.raw!r} is also that of turnout {first.id!r}"
            errors.append(row.place("raw").error(problem, "Give each turnout its own folder"))
        else:
            line_of_id[row.id], folders[folder], ids[key] = line, row, row
            rows.append(row)
        _note_turnouts((row, first) if first else (row,), errors[n_before:])
    return rows, errors


def _note_turnouts(rows: Iterable[Row], errors: Iterable[ConfigError]) -> None:
    """Note in the errors of rows which turnouts they are about: of two that contradict each other, both."""
    ids = [str(row.values.get("turnout", "")) for row in rows]
    for error in errors:
        error.turnouts = tuple(turnout if re.fullmatch(ID, turnout) else "" for turnout in ids)


def titles_of(line: str) -> tuple[str, ...]:
    """Titles of a table with tabs between its columns; empty columns on the right are left out.

    Parameters
    ----------
    line : str
        The header.

    Returns
    -------
    tuple of str
        Titles without blanks or double quotes around them.

    Examples
    --------
    >>> titles_of('turnout\\t"layout"\\t\\t')
    ('turnout', 'layout')
    """
    titles = [cell_text(cell) for cell in line.split("\t")]
    while titles and not titles[-1]:
        titles.pop()
    return tuple(titles)


def cell_text(cell: str) -> str:
    """Content of a cell between tabs. Spreadsheets put a cell in double quotes if it holds a comma or a quote.

    Parameters
    ----------
    cell : str
        The cell as it is written.

    Returns
    -------
    str
        Its content, without blanks around it; quotes within a cell stay.

    Examples
    --------
    >>> cell_text(' "Tommerup, switch 3" '), cell_text('"Switch ""old"" 1"'), cell_text('"Nord" 3')
    ('Tommerup, switch 3', 'Switch "old" 1', '"Nord" 3')
    """
    text = cell.strip()
    content = text[1:-1]
    is_quoted = len(text) > 1 and text[0] == text[-1] == '"' and '"' not in content.replace('""', "")
    return content.replace('""', '"').strip() if is_quoted else text


def _header_errors(header: tuple[str, ...], name: str, line: int, text: str) -> Iterator[ConfigError]:
    column = 1
    if problem := separator_problem(header):
        yield Place(name, line, 1).error(*problem)
        return
    if not set(header) & set(ROW):
        problem_text = f"a header without a known column: {', '.join(map(repr, header))}"
        yield Place(name, line, 1).error(problem_text, "Write turnout<tab>layout<tab>... above the rows")
        return
    for i, (title, cell) in enumerate(zip(header, text.split("\t"))):
        place = Place(name, line, column)
        if title not in ROW:
            yield place.error(f"unknown column {title!r}", suggestion(title, ROW))
        elif title in header[:i]:
            yield place.error(f"column {title!r} for the second time", "Keep one of them")
        column += len(cell) + 1
    for title, key in ROW.items():
        if key.required and title not in header:
            yield Place(name, line, 1).error(f"no column {title!r}", f"Add it: {key.meaning}")


def separator_problem(cells: Sequence[str]) -> tuple[str, str] | None:
    """Error of a line whose cells are not separated by tabs.

    Parameters
    ----------
    cells : sequence of str
        The line, split at tabs.

    Returns
    -------
    tuple of (str, str) or None
        Problem and remedy; None if it is separated by tabs or has one cell.

    Examples
    --------
    >>> separator_problem(("turnout;layout",)), separator_problem(("turnout", "layout"))
    (('semicolons between the columns', 'Put tabs between the columns'), None)
    """
    for mark, name in ((";", "semicolons"), (",", "commas"), (None, "blanks")):
        if len(cells) == 1 and len(cells[0].split(mark)) > 1:
            return f"{name} between the columns", "Put tabs between the columns"
    return None


def _row(text: str, line: int, header: tuple[str, ...], name: str) -> tuple[Row, list[ConfigError]]:
    cells = tuple(text.split("\t"))
    row = Row({}, line, cells, header, name)
    if separator_error := separator_problem(cells):
        return row, [Place(name, line, 1).error(*separator_error)]
    if any(cell.strip() for cell in cells[len(header) :]):
        place = Place(name, line, 1 + sum(len(c) + 1 for c in cells[: len(header)]))
        return row, [place.error(f"{len(cells)} cells under {len(header)} columns", "Remove what is too much")]
    errors = []
    for title, cell in zip(header, cells):
        cell = cell_text(cell)
        if not cell:
            continue
        value: str | float = cell
        key = ROW[title]
        if key.value_type == "number":
            try:
                value = decimal_number(cell)
            except ValueError:
                value = cell
        if problem := value_problem(key, value):
            errors.append(row.place(title).error(f"{title} is {problem[0]}", problem[1]))
        row.values[title] = value
    for title, key in ROW.items():
        if key.required and title not in row.values:
            errors.append(row.place(title).error(f"{title} is empty", f"Write {key.meaning}"))
    if not errors and is_outside_root(row.raw):
        message = f"raw is {row.raw!r}, outside the raw root"
        errors.append(row.place("raw").error(message, "Write a folder below the raw root, without '..'"))
    elif "raw" in row.values:
        row.values["raw"] = str(PurePosixPath(row.raw))  # "t1/" and "./t1" are the folder "t1"
        if problem := name_problem(row.raw):
            errors.append(row.place("raw").error(f"raw is {row.raw!r}: {problem[0]}", problem[1]))
    if "turnout" in row.values and (problem := name_problem(row.id)):
        errors.append(row.place("turnout").error(f"turnout is {row.id!r}: {problem[0]}", problem[1]))
    return row, errors


def is_outside_root(path: str) -> bool:
    """Whether a relative path leads out of its folder.

    Parameters
    ----------
    path : str
        Path as it is written in a table or layout.

    Returns
    -------
    bool
        True for an absolute path, and for one with ".." or a backslash.

    Examples
    --------
    >>> is_outside_root("line_7/T00042"), is_outside_root("../other"), is_outside_root("/data")
    (False, True, True)
    """
    return PurePosixPath(path).is_absolute() or ".." in PurePosixPath(path).parts or "\\" in path
