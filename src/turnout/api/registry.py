"""Ask the registry in SQL."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import duckdb

from turnout.errors import RegistryError
from turnout.registry import database

if TYPE_CHECKING:
    import pandas


class Registry:
    """A registry opened for reading; a context manager that closes it.

    Parameters
    ----------
    path : path-like
        Its folder, or its registry.duckdb.
    """

    def __init__(self, path: str | os.PathLike) -> None:
        self.path = Path(path)
        self._connection = database.open_registry(self.path)

    def sql(self, query: str, parameters: Sequence[Any] | Mapping[str, Any] | None = None) -> pandas.DataFrame:
        """Rows of a query as a data frame.

        Parameters
        ----------
        query : str
            In the SQL of DuckDB. docs/registry.md lists every table, view and macro with its columns and units.
        parameters : sequence or mapping, optional
            Values of ``?`` or ``$name`` in the query.

        Returns
        -------
        pandas.DataFrame
            One column per column of the query.

        Raises
        ------
        RegistryError
            With the message of DuckDB, if the query fails.
        """
        try:
            return self._connection.execute(query, parameters).df()
        except duckdb.Error as error:
            raise RegistryError(f"{error}\n'tables' names the tables and views; see docs/registry.md") from None

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of all tables and views."""
        query = "select view_name from duckdb_views() where not internal order by view_name"
        return tuple(name for (name,) in self._connection.execute(query).fetchall())

    def close(self) -> None:
        """Close the connection."""
        self._connection.close()

    def __enter__(self) -> Registry:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        try:
            query = "select generation, newest_measurement_at_utc from registry_info"
            ((generation, newest),) = self._connection.execute(query).fetchall()
        except duckdb.Error:
            return f"Registry({self.path}, closed)"
        until = f", measurements until {newest:%Y-%m-%d}" if newest else ", no measurement"
        return f"Registry({self.path}, generation {generation}, {len(self.tables)} tables and views{until})"


def open_registry(path: str | os.PathLike = "results/registry") -> Registry:
    """Open a registry for reading.

    Parameters
    ----------
    path : path-like
        Folder of the registry, or its registry.duckdb.

    Returns
    -------
    Registry
        ``sql(query)`` gives a pandas.DataFrame, ``tables`` the names of all tables and views. Use it in ``with``, or
        ``close()`` it.

    Raises
    ------
    RegistryError
        If there is no registry, or it cannot be opened.

    Examples
    --------
    >>> import turnout
    >>> with turnout.open_registry("results/registry") as registry:  # doctest: +SKIP
    ...     registry.sql("select * from section_trend(?, 'ballast')", ["tommerup_s2/A8"])
    >>> turnout.open_registry("no/such/folder")
    Traceback (most recent call last):
    turnout.errors.RegistryError: no/such/folder: there is no registry here...

    References
    ----------
    docs/registry.md.
    """
    return Registry(path)
