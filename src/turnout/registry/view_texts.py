"""The texts of views and macros, one SQL file per question, and the columns that they describe."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.resources import files

from turnout.errors import REMARK_REASONS, RegistryError
from turnout.reasons import REASONS
from turnout.registry.ids import content_id
from turnout.registry.schema import literal, tables

_NEEDS = re.compile(r"^--\s*needs:\s*(.+)$", re.MULTILINE)
_COLUMNS = re.compile(r"^-- columns of (\w+)(.*)\n((?:--.*(?:\n|$))+)", re.MULTILINE)
_COLUMN_FIELDS = ("view", "parameters", "column", "type", "unit", "meaning")


@cache
def view_files() -> dict[str, str]:
    """SQL text of every file in ``views``, each after those it depends on; ties by name.

    >>> order = list(view_files())
    >>> order.index("superseded") < order.index("modes_current")
    True
    """
    folder = files("turnout.registry") / "views"
    texts = {p.name[:-4]: p.read_text(encoding="utf-8") for p in folder.iterdir() if p.name.endswith(".sql")}
    return sort_by_needs(texts)


def sort_by_needs(texts: dict[str, str]) -> dict[str, str]:
    """Files sorted by dependency: each follows those in its line ``-- needs: a, b``.

    Parameters
    ----------
    texts : dict
        SQL text by name.

    Returns
    -------
    dict
        The same texts, sorted.

    Raises
    ------
    RegistryError
        If a file needs one that does not exist, or files need each other in a circle.

    Examples
    --------
    >>> list(sort_by_needs({"a": "-- needs: c", "b": "", "c": ""}))
    ['b', 'c', 'a']
    """
    sorter: TopologicalSorter = TopologicalSorter()
    for name in sorted(texts):
        needs = [n.strip() for line in _NEEDS.findall(texts[name]) for n in line.split(",") if n.strip()]
        if missing := [n for n in needs if n not in texts]:
            raise RegistryError(f"views/{name}.sql needs {', '.join(missing)}, and there is no such file.")
        sorter.add(name, *needs)
    try:
        sorter.prepare()
    except CycleError as error:
        raise RegistryError(f"views need each other in a circle: {' -> '.join(error.args[1])}") from None
    order: list[str] = []
    while sorter.is_active():
        ready = sorted(sorter.get_ready())
        order += ready
        sorter.done(*ready)
    return {name: texts[name] for name in order}


def reasons_sql() -> str:
    """SQL of the view ``reasons``: every reason code with its meaning, and whether it is a remark."""
    values = ", ".join(
        f"({literal(code)}, {literal(meaning)}, {code in REMARK_REASONS})" for code, meaning in REASONS.items()
    )
    return f"create or replace view reasons as select * from (values {values}) as r(reason_code, meaning, is_remark)"


@cache
def view_columns() -> tuple[dict[str, str], ...]:
    """Columns of all views and macros, from the comments ``-- columns of <name>`` at the end of their files.

    Returns
    -------
    tuple of dict
        Per column: view, parameters (of a macro), column, type, unit and meaning.

    Raises
    ------
    RegistryError
        When a line below such a comment is not ``-- column | type | unit | meaning``.
    """
    return tuple(row for name, sql in view_files().items() for row in described_columns(name, sql))


def described_columns(name: str, sql: str) -> Iterator[dict[str, str]]:
    """Columns that one file of views describes.

    Parameters
    ----------
    name : str
        Name of the file, without ``.sql``.
    sql : str
        Its text.

    Yields
    ------
    dict
        As in `view_columns`.

    Raises
    ------
    RegistryError
        When a line is not ``-- column | type | unit | meaning``.

    >>> list(described_columns("file", "-- columns of a(b)\\n-- c | double | Hz | frequency"))[0]["parameters"]
    '(b)'
    """
    for view, parameters, block in _COLUMNS.findall(sql):
        for line in block.splitlines():
            values = [value.strip() for value in line.removeprefix("--").split("|")]
            if len(values) != 4:
                raise RegistryError(f"views/{name}.sql: expected '-- column | type | unit | meaning', found {line!r}")
            yield dict(zip(_COLUMN_FIELDS, (view, parameters, *values), strict=True))


@cache
def views_version() -> str:
    """Hash of all views, reasons and column descriptions; a program with another one rebuilds the database."""
    described = [(c.table, c.name, c.unit, c.meaning) for t in tables().values() for c in t]
    return content_id("views", view_files(), reasons_sql(), described, list(view_columns()))
