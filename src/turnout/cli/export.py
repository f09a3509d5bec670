"""Write tables and views for other tools: Parquet or CSV files, or Delta Lake tables.

turnout export out                            the usual tables and views, one Parquet file each
turnout export out --format csv --only worklist chart_states
turnout export lake --format delta --only modes_current charts

In CSV an apostrophe precedes text that a spreadsheet would take for a formula. Times are UTC, without a zone.
Delta Lake needs the extra: pip install '.[lakehouse]'
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.options import add_registry
from turnout.counts import count_of
from turnout.registry.spreadsheet import FORMULA_STARTS, MARK, QUOTE

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import duckdb

GROUP = "Results"
HELP = "write tables and views as Parquet, CSV or Delta Lake"
DEFAULT_TABLES = ("turnouts", "sections", "events", "campaigns", "modes_current", "charts", "baselines", "alarms",
         "chart_states", "worklist")  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Folder, names and format.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    parser.add_argument("folder", help="where to write; made where it does not exist")
    parser.add_argument(
        "--only", nargs="+", metavar="NAME", help=f"tables and views; usually {', '.join(DEFAULT_TABLES)}"
    )
    parser.add_argument("--format", choices=("parquet", "csv", "delta"), default="parquet", help="(%(default)s)")
    add_registry(parser)


def run(args: argparse.Namespace) -> int:
    """Write each table or view and print its number of rows; RegistryError if it is unknown or cannot be written.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.
    """
    from pathlib import Path

    import duckdb

    from turnout.errors import RegistryError
    from turnout.files import make_folder
    from turnout.registry.damage import damage_message
    from turnout.registry.database import open_registry

    folder, names = Path(args.folder), args.only or DEFAULT_TABLES
    with open_registry(args.registry) as con:
        _require_tables(con, names)
        try:
            make_folder(folder)
        except OSError as error:
            raise RegistryError(f"{error.filename or folder}: {error.strerror}. Name another folder.") from None
        for name in names:
            try:
                path, n = _write(con, name, folder, args.format)
            except duckdb.Error as error:
                if damage_message(error, args.registry):
                    raise
                reason = str(error).splitlines()[0]
                raise RegistryError(
                    f"{name} cannot be written to {folder}: {reason}. Free disk space or give write permission."
                ) from None
            print(f"{path}: {count_of(n, 'row')}")
    return 0


def _identifier(name: str) -> str:
    return '"' + name.replace('"', '""') + '"'


def _require_tables(con: duckdb.DuckDBPyConnection, names: Sequence[str]) -> None:
    """RegistryError if one of the tables and views does not exist, before any of them is written."""
    import duckdb

    from turnout.errors import RegistryError

    for name in names:
        try:
            con.execute(f"describe {_identifier(name)}")
        except duckdb.CatalogException:
            raise RegistryError(f"no table or view {name!r}. 'turnout query --list' names them.") from None


def _write(con: duckdb.DuckDBPyConnection, name: str, folder: Path, form: str) -> tuple[Path, int]:
    """(path, number of rows) of one written table or view; an existing one is replaced."""
    from turnout.files import whole_file
    from turnout.registry.schema import literal

    quoted = _identifier(name)
    if form == "delta":
        return folder / name, _delta(con, quoted, folder / name)
    path = folder / f"{name}.{form}"
    options = "format parquet, compression zstd" if form == "parquet" else "format csv, header"
    rows = f"select * from {quoted}" if form == "parquet" else _rows_for_spreadsheets(con, quoted)
    with whole_file(path) as unfinished:
        return path, con.execute(f"copy ({rows}) to {literal(str(unfinished))} ({options})").fetchall()[0][0]


def _rows_for_spreadsheets(con: duckdb.DuckDBPyConnection, quoted: str) -> str:
    """SQL of the rows of a table or view with its texts as ``without_formula`` writes them, and ``MARK`` in front."""
    starts = ", ".join(f"chr({ord(start)})" for start in FORMULA_STARTS)
    columns = con.execute(f"describe {quoted}").fetchall()
    changes = ", ".join(
        f"case when left({name}, 1) in ({starts}) then chr({ord(QUOTE)}) || {name} else {name} end as {name}"
        for name, kind in ((_identifier(row[0]), row[1]) for row in columns)
        if kind == "VARCHAR"
    )
    rows = f"select * replace ({changes}) from {quoted}" if changes else f"select * from {quoted}"
    first = columns[0][0]
    if not first.isidentifier():  # in quotes the mark would be part of the name
        return rows
    return f"select * rename ({_identifier(first)} as {_identifier(MARK + first)}) from ({rows})"


def _delta(con: duckdb.DuckDBPyConnection, quoted: str, path: Path) -> int:
    from turnout.errors import RegistryError

    try:
        from deltalake import write_deltalake
    except ImportError:
        raise RegistryError("Delta Lake needs a package: pip install '.[lakehouse]'.") from None
    rows = con.sql(f"select * from {quoted}").to_arrow_table()
    write_deltalake(str(path), rows, mode="overwrite")
    return rows.num_rows
