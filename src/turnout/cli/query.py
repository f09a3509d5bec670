"""Query the registry in SQL.

  turnout query "from resonance_drift(365)"
  turnout query "select * from section_trend('tommerup_s1/A7', 'ballast')" --csv trend.csv
  turnout query "from worklist" --as-of 2026-11-24T12:00    what readers saw at that time (UTC), or in generation 17
  turnout query --list

docs/registry.md lists every table, view and macro with its columns and units. Only queries are allowed, and only the
files of the registry are read. In CSV output an apostrophe precedes text that a spreadsheet would take for a formula.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import sys
from contextlib import contextmanager
from decimal import Decimal
from difflib import get_close_matches
from pathlib import Path
from shutil import get_terminal_size
from typing import TYPE_CHECKING

from turnout.cli.option_types import at_least_one
from turnout.cli.options import add_csv, add_registry, add_result, check_output_files
from turnout.counts import first_texts
from turnout.registry.spreadsheet import MARK, without_formula

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import TextIO

    import duckdb

NAMES_SQL = """
    select turnout_id from turnouts union select section_id from sections union select distinct band from charts
    union select distinct kind from events"""
MAX_SECTIONS = 4  # that a remark names
GROUP = "Results"
HELP = "query the registry in SQL"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The query, the folder of the registry and the output.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("sql", nargs="?", help="a query; '-' reads it from standard input")
    add_registry(parser)
    add_csv(parser)
    parser.add_argument("--rows", type=at_least_one, default=60, help="rows shown at most (%(default)s)")
    parser.add_argument(
        "--as-of",
        metavar="TIME|GENERATION",
        help="what readers saw at that time (UTC) or in that generation; kept for a day",
    )
    parser.add_argument("--list", action="store_true", help="name the tables, views and macros")


def run(args: argparse.Namespace) -> int:
    """Print or write the rows of a query; RegistryError with the message of DuckDB if it fails.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    import duckdb

    from turnout.errors import RegistryError
    from turnout.registry.confinement import open_confined, require_reading
    from turnout.registry.damage import damage_message
    from turnout.registry.documentation import listing

    check_output_files(args, "--csv")
    if args.list or not args.sql:
        print(listing())
        return 0
    sql = _text_of_query(args.sql)
    with open_confined(args.registry, args.as_of) as connection:
        try:
            require_reading(sql)
            result = connection.sql(sql)
            if result is None:
                return 0
            if args.json:
                add_result(args, [dict(zip(result.columns, row)) for row in result.fetchall()])
            if args.csv:
                _write_csv(result, args.csv)
            elif not args.json:
                table = format_table(result, args.rows, get_terminal_size().columns if sys.stdout.isatty() else None)
                print(table)
                if not args.quiet and table.endswith("(0 rows)"):
                    for remark in misspelt_names(connection, sql):
                        print(remark, file=sys.stderr)
        except duckdb.Error as error:
            if damage_message(error, args.registry):
                raise
            raise RegistryError(f"{error}\n'turnout query --list' names the tables, views and macros") from None
    return 0


def misspelt_names(connection: duckdb.DuckDBPyConnection, sql: str) -> list[str]:
    """A remark on each text of a query that resembles a name of the registry and is none, for a result without rows.

    Parameters
    ----------
    connection : DuckDB connection
        An open registry.
    sql : str
        The query.

    Returns
    -------
    list of str
        Sentences.
    """
    from turnout.config.events import RESETS

    names = {str(name) for (name,) in connection.execute(NAMES_SQL).fetchall()}
    remarks = []
    for text in (text for text in re.findall(r"'([^']+)'", sql) if text not in names):
        of_label = sorted(name for name in names if name.endswith(f"/{text}"))
        if text in RESETS:
            remarks.append(f"The registry has no event of the kind {text!r}.")
        elif of_label:
            sections = first_texts([*map(repr, of_label)], MAX_SECTIONS)
            remarks.append(f"The registry has no {text!r}. A section is written with its turnout: {sections}.")
        elif close := get_close_matches(text, names | RESETS.keys(), n=1):
            remarks.append(f"The registry has no {text!r}. Did you mean {close[0]!r}?")
    return remarks


def _text_of_query(word: str) -> str:
    """The query of the command line, or that of standard input for "-"; RegistryError if it is no text in UTF-8."""
    from turnout.errors import RegistryError

    try:
        return (sys.stdin.buffer.read() if word == "-" else os.fsencode(word)).decode("utf-8-sig")
    except UnicodeError:
        problem = "the query contains a byte that is not UTF-8"
        raise RegistryError(f"{problem}. Type it in a terminal with UTF-8, or save its file as UTF-8.") from None


def _write_csv(result: duckdb.DuckDBPyRelation, path: str) -> None:
    with open_output(path) as stream:
        writer = csv.writer(stream)
        writer.writerow(map(without_formula, result.columns))
        writer.writerows([without_formula(value) for value in row] for row in result.fetchall())


@contextmanager
def open_output(path: str) -> Iterator[TextIO]:
    """The CSV file at ``path`` open for writing, standard output for "-". No part of a file is left if writing fails.

    A file begins with ``MARK``.

    Parameters
    ----------
    path : str
        File to write, or "-".

    Yields
    ------
    text file
        Standard output stays open behind the context.

    Raises
    ------
    RegistryError
        If the file cannot be written.
    """
    from turnout.errors import RegistryError
    from turnout.files import whole_file

    if path == "-":
        yield sys.stdout
        return
    try:
        with whole_file(path) as unfinished, open(unfinished, "w", newline="", encoding="utf-8") as stream:
            if unfinished != Path(path):  # a pipe or a device is for a program
                stream.write(MARK)
            yield stream
    except OSError as error:
        raise RegistryError(
            f"{path} cannot be written: {error.strerror}. Correct this, or write a file in another folder."
        ) from None


def format_table(result: duckdb.DuckDBPyRelation, limit: int = 60, width: int | None = None) -> str:
    """Text table of a result: numbers right aligned, NULL empty, and the number of rows.

    A terminal would break the lines of a wider table: then each row is a block with a line for each value.

    Parameters
    ----------
    result : duckdb.DuckDBPyRelation
        Rows of a query.
    limit : int
        Most rows that are shown.
    width : int, optional
        Characters in a line of the terminal; None: any number.

    Returns
    -------
    str
        Head, rows and the number of rows.
    """
    rows = result.limit(limit + 1).fetchall()
    is_longer, rows = len(rows) > limit, rows[:limit]
    text = [[_cell(value) for value in row] for row in rows]
    widths = [max(len(name), *(len(row[i]) for row in text), 0) for i, name in enumerate(result.columns)]
    right = [
        all(isinstance(row[i], (int, float, Decimal)) or row[i] is None for row in rows) for i in range(len(widths))
    ]

    def line(cells: Sequence[str]) -> str:
        return "  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(cells, widths, right)).rstrip()

    total = result.count("*").fetchall()[0][0] if is_longer else len(rows)
    count = f"({len(rows)} of {total} rows)" if is_longer else f"({total} row{'s' if total != 1 else ''})"
    head = [line(result.columns), line(["-" * w for w in widths])]
    if rows and width is not None and len(head[1]) > width:
        longest = max(map(len, result.columns))
        blocks = [
            "\n".join(f"{name:<{longest}}  {cell}" for name, cell in zip(result.columns, row) if cell) for row in text
        ]
        return "\n\n".join([*blocks, count])
    return "\n".join([*head, *map(line, text), count])


def _cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list) and len(value) > 6:
        return f"[{', '.join(_cell(v) for v in value[:3])} ... {len(value)}]"
    return " ".join(str(value).split())
