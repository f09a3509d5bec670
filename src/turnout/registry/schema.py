"""Tables and columns of the registry from ``columns.csv``, with their DDL and checks."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from glob import escape
from importlib.resources import files
from os import PathLike, fspath
from typing import TYPE_CHECKING

from turnout.number_text import number_text

if TYPE_CHECKING:
    from typing import NoReturn

# Computed after every run: for all charts at once, and what open alarms rest on.
DERIVED_TABLES = ("charts", "baselines", "chart_status", "alarms", "change_findings")
# Replaced as a whole, from configuration, by hand or by computation; the others get one file per run and year.
WHOLE_TABLES = ("turnouts", "sections", "events", "campaigns", "acknowledgements", *DERIVED_TABLES)
# Columns of every result row that the registration fills in.
FILLED_BY_REGISTER = ("run_id", "result_id")
# Parent table: its id, and the tables whose rows have no meaning without their parent row.
CHILDREN = {
    "models": ("model_id", ("modes", "impact_modes", "receptances")),
    "passages": ("passage_id", ("passage_fits",)),
    "mismatch_findings": ("finding_id", ("mismatch_parameters", "mismatch_curves", "twin_states")),
}
# Rows are sorted by section, then by type of resonance, then by time, so that one chart is contiguous in the file.
SORT_FIRST = ("turnout_id", "section_id", "channel", "band", "method")


@dataclass(frozen=True)
class Column:
    """One column: its SQL type, its unit, the range and the values it may take."""

    table: str
    name: str
    type: str
    unit: str
    key: bool
    required: bool
    minimum: float | None
    maximum: float | None
    decimals: int | None
    allowed: tuple[str, ...]
    meaning: str

    @property
    def is_list(self) -> bool:
        """Whether a value is a list of numbers or texts."""
        return self.type.endswith("[]")

    @property
    def check(self) -> str | None:
        """SQL condition for every value but NULL; every double has one, because NaN > 1 is true in SQL.

        >>> column("modes", "damping_ratio").check
        '"damping_ratio" between 1e-06 and 0.999'
        """
        quoted = f'"{self.name}"'
        if self.allowed:
            return f"{quoted} in ({', '.join(literal(a) for a in self.allowed)})"
        if self.is_list:
            finite = f"list_count({quoted}) = len({quoted})"
            if self.type in ("double[]", "float[]"):
                finite += f" and isfinite(list_sum({quoted}))"
            return f"(len({quoted}) = 0 or ({finite}))"
        if self.minimum is not None and self.maximum is not None:
            return f"{quoted} between {self.minimum!r} and {self.maximum!r}"
        if self.minimum is not None and self.type in ("integer", "bigint"):
            return f"{quoted} >= {int(self.minimum)}"
        return f"isfinite({quoted})" if self.type in ("double", "float", "timestamp") else None

    @property
    def rounded(self) -> str:
        """SQL expression of the value rounded to its resolution."""
        if self.decimals is None or self.is_list:
            return f'"{self.name}"'
        return f'round("{self.name}", {self.decimals})'

    @property
    def rule(self) -> str:
        """The requirement of ``check`` in words."""
        if self.allowed:
            return "one of " + ", ".join(self.allowed)
        if self.is_list:
            return "every element finite and none empty"
        if self.minimum is not None and self.maximum is not None:
            return f"between {number_text(self.minimum)} and {number_text(self.maximum)} {self.unit}".rstrip()
        return f"at least {number_text(self.minimum)}" if self.minimum is not None else "finite"

    @property
    def ddl(self) -> str:
        """Column definition of CREATE TABLE: name, type and constraints."""
        words = [f'"{self.name}" {self.type}']
        if self.required or self.key:
            words.append("not null")
        if self.check:
            words.append(f"check ({self.check})")
        return " ".join(words)


def literal(text: str) -> str:
    """SQL string literal.

    Parameters
    ----------
    text : str
        Any text.

    Returns
    -------
    str
        Text in quotes.

    Examples
    --------
    >>> literal("o'clock")
    "'o''clock'"
    """
    return "'" + str(text).replace("'", "''") + "'"


def file_literal(path: PathLike | str) -> str:
    """SQL string literal of a file to read; characters that DuckDB would take for a pattern are escaped.

    Parameters
    ----------
    path : PathLike or str
        Path of the file.

    Returns
    -------
    str
        Text in quotes.

    Examples
    --------
    >>> file_literal("line [1]/modes.parquet")
    "'line [[]1]/modes.parquet'"
    """
    return literal(escape(fspath(path)))


@cache
def tables() -> dict[str, tuple[Column, ...]]:
    """Every table of the registry with its columns, in the order of ``columns.csv``."""
    columns_by_table: dict[str, list[Column]] = {}
    text = (files("turnout.registry") / "columns.csv").read_text(encoding="utf-8")
    for row in csv.DictReader(text.splitlines()):
        number = {k: float(row[k]) if row[k] else None for k in ("minimum", "maximum", "decimals")}
        columns_by_table.setdefault(row["table"], []).append(
            Column(
                table=row["table"],
                name=row["column"],
                type=row["type"],
                unit=row["unit"],
                key=row["key"] == "key",
                required=row["required"] == "yes",
                minimum=number["minimum"],
                maximum=number["maximum"],
                decimals=None if number["decimals"] is None else int(number["decimals"]),
                allowed=tuple(row["allowed"].split("|")) if row["allowed"] else (),
                meaning=row["meaning"],
            )
        )
    return {table: tuple(columns) for table, columns in columns_by_table.items()}


def column(table: str, name: str) -> Column:
    """The column of a table.

    Parameters
    ----------
    table : str
        Name of the table.
    name : str
        Name of the column.

    Returns
    -------
    Column
        The column.

    Raises
    ------
    KeyError
        Where there is none.
    """
    return next((c for c in tables()[table] if c.name == name), None) or _no_column(table, name)


def _no_column(table: str, name: str) -> NoReturn:
    raise KeyError(f"{table} has no column {name!r}; it has {', '.join(c.name for c in tables()[table])}")


@cache
def names(table: str) -> tuple[str, ...]:
    """Names of the columns of ``table``.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    tuple of str
        Names, in the order of ``columns.csv``.
    """
    return tuple(c.name for c in tables()[table])


@cache
def key(table: str) -> tuple[str, ...]:
    """The columns that identify a row.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    tuple of str
        Names of the key columns.
    """
    return tuple(c.name for c in tables()[table] if c.key)


@cache
def time_column(table: str) -> str | None:
    """The time of a row: its first column that is a required timestamp.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    str or None
        Name of the column, None without one.
    """
    return next((c.name for c in tables()[table] if c.type == "timestamp" and c.required), None)


@cache
def sort_order(table: str) -> tuple[str, ...]:
    """Columns by which the rows of a file are sorted; the order is total, because it ends with the key.

    Parameters
    ----------
    table : str
        Name of the table.

    Returns
    -------
    tuple of str
        Names in SQL quotes.

    Examples
    --------
    >>> sort_order("modes")
    ('"turnout_id"', '"section_id"', '"band"', '"method"', '"measured_at_utc"', '"model_id"')
    """
    time = time_column(table)
    if "channel" in key(table):  # all sensors of a passage together: repeated ids and times compress well
        return ('"turnout_id"', f'"{time}"', *(f'"{k}"' for k in key(table)))
    order = [f'"{c}"' for c in SORT_FIRST if c in names(table)] + ([f'"{time}"'] if time else [])
    return tuple(order + [f'"{k}"' for k in key(table) if f'"{k}"' not in order])


def create_table(table: str, name: str, extra: str = "", is_indexed: bool = True) -> str:
    """CREATE TABLE with NOT NULL, CHECK and PRIMARY KEY.

    Parameters
    ----------
    table : str
        Name of the table.
    name : str
        Name under which it is created.
    extra : str
        Further columns, as in ", x integer".
    is_indexed : bool
        Whether there is a PRIMARY KEY, whose index takes a seventh of the time of a registration. Without it
        two rows may have the same key.

    Returns
    -------
    str
        The SQL statement.
    """
    body = ", ".join(c.ddl for c in tables()[table])
    keys = ", ".join(f'"{k}"' for k in key(table))
    rule = f", primary key ({keys})" if is_indexed else ""
    return f"create table {name} ({body}{extra}{rule})"
