"""Comments of the catalogue: what a row of each view and macro is, and unit and meaning of each column."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout.registry.schema import literal, tables

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    import duckdb

OWN_MEANINGS = {
    "registry_info": "One row: what this registry is.",
    "reasons": "One row per reason code.",
    "newest_measurement": "Time of the newest plausible measurement. [UTC]",
    "published_at": "Day on which this generation was published.",
}
SPLIT_PARTS = {  # of a large table, see ``supersede.split_files``
    "settled": "Part of {} without results that were computed again.",
    "touched": "Part of {} in which results were computed again.",
}


def row_meaning(name: str, sqls: Iterable[str]) -> str:
    """Meaning of a row of a view or macro: the SQL comment above the statement that creates it.

    Parameters
    ----------
    name : str
        Name of the view or macro.
    sqls : iterable of str
        Texts of the files of views.

    Returns
    -------
    str
        The meaning, "" without a comment.

    Examples
    --------
    >>> row_meaning("a", ["-- One row per day.\\n-- needs: b\\ncreate or replace view a as select 1"])
    'One row per day.'
    """
    for sql in sqls:
        for keyword in ("view", "macro"):
            head, statement, _ = sql.partition(f"create or replace {keyword} {name}")
            if statement and not (sql[len(head) + len(statement)].isalnum() or sql[len(head) + len(statement)] == "_"):
                comment = head.rstrip().rpartition("\n\n")[2].splitlines()
                return " ".join(c[2:].strip() for c in comment if c.startswith("--") and "needs:" not in c)
    return OWN_MEANINGS.get(name, "")


def column_comment(meaning: str, unit: str) -> str:
    """Comment of a column: its meaning, and its unit if it has one.

    Parameters
    ----------
    meaning : str
        What a value is.
    unit : str
        Its unit, "" without one.

    Returns
    -------
    str
        The text.

    Examples
    --------
    >>> column_comment("natural frequency", "Hz")
    'natural frequency [Hz]'
    """
    return f"{meaning} [{unit}]" if unit else meaning


def add_comments(
    con: duckdb.DuckDBPyConnection, sqls: Iterable[str], columns: Iterable[Mapping[str, str]], split: Iterable[str]
) -> None:
    """Add comments to all views, macros and columns of the registry, for tools that show them.

    Parameters
    ----------
    con : duckdb connection
        The catalogue of a registry, called "registry", writable.
    sqls : iterable of str
        Texts of the files of views.
    columns : iterable of mapping
        Columns of views as ``view_columns`` gives them.
    split : iterable of str
        Tables that have a view of each of ``SPLIT_PARTS``.
    """
    sqls = tuple(sqls)
    described = [(c.table, c.name, c.unit, c.meaning) for t in tables().values() for c in t]
    described += [(v["view"], v["column"], v["unit"], v["meaning"]) for v in columns]
    described += [
        (f"{table}_{part}", c.name, c.unit, c.meaning)
        for table in split
        for part in SPLIT_PARTS
        for c in tables()[table]
    ]
    meanings = {t: f"One row per {', '.join(c.name for c in cs if c.key) or 'entry'}." for t, cs in tables().items()}
    meanings |= {f"{table}_{part}": words.format(table) for table in split for part, words in SPLIT_PARTS.items()}
    rows = con.execute(
        "select table_name, column_name from duckdb_columns() where database_name = 'registry'"
    ).fetchall()
    present = set(rows)
    statements = ["begin"]
    for view, column, unit, meaning in described:
        if (view, column) in present:
            text = literal(column_comment(meaning, unit))
            statements.append(f'comment on column "{view}"."{column}" is {text}')
    for view in sorted({view for view, _ in present}):
        if meaning := meanings.get(view) or row_meaning(view, sqls):
            statements.append(f'comment on view "{view}" is {literal(meaning)}')
    functions = "select distinct function_name, function_type from duckdb_functions() where database_name = 'registry'"
    for name, kind in con.execute(f"{functions} and not internal").fetchall():
        if meaning := row_meaning(name, sqls):
            con.execute(
                f'comment on {"macro table" if kind == "table_macro" else "macro"} "{name}" is {literal(meaning)}'
            )
    con.execute("; ".join([*statements, "commit"]))
