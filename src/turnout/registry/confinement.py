"""Confine a connection to the registry: it reads the registry's files, writes none, and reaches nothing else."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import duckdb

from turnout.errors import RegistryError
from turnout.registry.database import open_registry
from turnout.registry.schema import literal

if TYPE_CHECKING:
    from datetime import datetime
    from os import PathLike

# Statements that only read; PIVOT is one of several steps (MULTI).
READING = {duckdb.StatementType.SELECT, duckdb.StatementType.MULTI}
_EXPLAIN = re.compile(r"\s*explain\b(\s+analyze\b|\s*\([^()]*\))?", re.IGNORECASE)


def open_confined(path: str | PathLike, as_of: int | str | datetime | None = None) -> duckdb.DuckDBPyConnection:
    """Open a registry for queries of people: no other file, no network, no extension, no change of these limits.

    Parameters
    ----------
    path : str or PathLike
        Folder of the registry, or its ``registry.duckdb``.
    as_of : int, str, datetime or None
        Number of a kept generation, or a time, as for ``open_registry``; None: the present one.

    Returns
    -------
    DuckDB connection
        Read-only connection.

    Raises
    ------
    RegistryError
        When there is none, when it cannot be opened, or when it was moved and not relocated.
    """
    connection = open_registry(path, as_of=as_of)
    ((folder,),) = connection.execute("select folder from registry_info").fetchall()
    for setting in (
        f"allowed_directories = [{literal(folder)}]",
        "enable_external_access = false",
        "python_enable_replacements = false",
        "lock_configuration = true",
    ):
        connection.execute(f"set {setting}")
    return connection


def require_reading(sql: str) -> None:
    """Accept queries only: the files of the registry are reachable, and no statement may write them.

    Parameters
    ----------
    sql : str
        One statement.

    Raises
    ------
    RegistryError
        If there is none or several, or it is no SELECT, FROM, DESCRIBE, SUMMARIZE, SHOW, PIVOT, or EXPLAIN of such.
    duckdb.Error
        If the text is no SQL.
    """
    statements = duckdb.extract_statements(sql)
    if len(statements) != 1:
        count = f"{len(statements)} queries, and only the last would be shown" if statements else "no query"
        raise RegistryError(f"{' '.join(sql.split())[:60]!r}: {count}. Give one query.")
    for statement in statements:
        if statement.type == duckdb.StatementType.EXPLAIN and (match := _EXPLAIN.match(statement.query)):
            require_reading(statement.query[match.end() :])
        elif statement.type not in READING:
            words = " ".join(statement.query.split()[:3])
            raise RegistryError(
                f"{words} ...: only queries are allowed (SELECT, FROM, DESCRIBE, SUMMARIZE, SHOW, PIVOT, EXPLAIN). "
                "Write results with --csv FILE or 'turnout export'."
            )
