"""Connections of DuckDB that load no extension."""

from __future__ import annotations

from typing import TYPE_CHECKING

import duckdb

if TYPE_CHECKING:
    from typing import Any

OFFLINE_CONFIG: dict[str, str | bool | int | float | list[str]] = {
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
}


def connect(**config: Any) -> duckdb.DuckDBPyConnection:
    """DuckDB connection in memory that downloads no extension.

    Parameters
    ----------
    **config : str
        Further settings of DuckDB.

    Returns
    -------
    DuckDB connection
        The connection.
    """
    con = duckdb.connect(":memory:", config=OFFLINE_CONFIG | {"memory_limit": "2GB"} | config)
    con.execute("set enable_progress_bar = false")  # it would mix with the output of a command
    return con


def limit_memory(con: duckdb.DuckDBPyConnection) -> None:
    """Let a job use little memory: one thread, of which each takes about 20 MB, and freed memory is given back early.

    Parameters
    ----------
    con : DuckDB connection
        Any connection.
    """
    con.execute("set threads = 1")
    con.execute("set allocator_flush_threshold = '1MB'")  # 128 MB by default
