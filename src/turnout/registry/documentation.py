"""Describe tables, views and macros, for the command line and for docs/registry.md and docs/reasons.md.

``python -m turnout.registry.documentation docs`` rewrites the generated sections of these pages; a test compares.
"""

import difflib
import re
import sys
from functools import cache
from pathlib import Path

from turnout.errors import RegistryError
from turnout.number_text import number_text
from turnout.reasons import REASONS
from turnout.registry.comments import row_meaning
from turnout.registry.schema import Column, tables
from turnout.registry.view_texts import view_columns, view_files


@cache
def views() -> dict[str, tuple[str, tuple[dict[str, str], ...]]]:
    """Every view, and every macro with its parameters: the meaning of a row, and its columns.

    >>> views()["section_trend(section, resonance)"][1][1]["column"]
    'frequency_hz'
    """
    columns_by_call: dict[str, list[dict[str, str]]] = {}
    for row in view_columns():
        columns_by_call.setdefault(row["view"] + row["parameters"], []).append(row)
    return {
        call: (row_meaning(rows[0]["view"], view_files().values()), tuple(rows))
        for call, rows in columns_by_call.items()
    }


def listing() -> str:
    """One line per table, view and macro."""
    lines = ["Tables"]
    lines += [f"  {t:<24} {', '.join(c.name for c in cs if c.key)}" for t, cs in tables().items()]
    lines += ["", "Views and macros"]
    lines += [f"  {call:<46} {what}" for call, (what, _) in sorted(views().items())]
    return "\n".join(lines)


def describe(name: str | None = None) -> str:
    """Columns of one table, view or macro, or of all, with type, unit and meaning.

    Parameters
    ----------
    name : str or None
        Name of a table, view or macro; None: all.

    Returns
    -------
    str
        Text of several lines.

    Raises
    ------
    RegistryError
        For a name that does not exist; the message suggests a similar one.
    """
    described = {t: [(c.name, c.type, c.unit, c.meaning) for c in cs] for t, cs in tables().items()}
    for call, (_, rows) in views().items():
        described[call] = [(r["column"], r["type"], r["unit"], r["meaning"]) for r in rows]
    if name is not None:
        chosen = {k: v for k, v in described.items() if k.partition("(")[0] == name}
        if not chosen:
            near = difflib.get_close_matches(name, [k.partition("(")[0] for k in described], 1)
            hint = f" Did you mean {near[0]}?" if near else " `turnout registry describe` lists all."
            raise RegistryError(f"{name}: no such table, view or macro.{hint}")
        described = chosen
    blocks = []
    for title, lines in described.items():
        width = max(len(line[0]) for line in lines)
        blocks.append("\n".join([title, *(f"  {n:<{width}}  {k:<10} {u:<8} {m}".rstrip() for n, k, u, m in lines)]))
    return "\n\n".join(blocks)


_SECTION = "<!-- {name}: generated, do not edit -->\n{body}\n<!-- end of {name} -->"


def table_tables() -> str:
    """One table of columns per table of the registry; key columns in bold."""
    blocks = []
    for table, columns in tables().items():
        lines = [f"### {table}", "", "| column | type | unit | values | meaning |", "|---|---|---|---|---|"]
        lines += [
            f"| {f'**{c.name}**' if c.key else c.name} | {c.type} | {c.unit} | {_values(c)} | {c.meaning} |"
            for c in columns
        ]
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


MIN_SHARED_COLUMNS = 6  # of a view with another one; below it a list of all columns is as short
MIN_SHARED_SHARE = 0.75  # of the columns of a view


def view_tables() -> str:
    """One table of columns per view and macro, below the meaning of a row.

    Columns that are those of a table, or of a view above, are listed by name alone.
    """
    described = {table: {(c.name, c.type, c.unit, c.meaning) for c in columns} for table, columns in tables().items()}
    blocks = []
    for call, (what, rows) in sorted(views().items()):
        cells = [(r["column"], r["type"], r["unit"], r["meaning"]) for r in rows]
        base = max(described, key=lambda name: sum(c in described[name] for c in cells))
        shared = [c for c in cells if c in described[base]]
        if len(shared) < max(MIN_SHARED_COLUMNS, MIN_SHARED_SHARE * len(cells)):
            shared = []
        lines = [f"### {call}", "", what]
        if shared:
            listed, lacking = (sorted({name for name, *_ in c}) for c in (shared, described[base] - set(shared)))
            names = f"all but {', '.join(lacking)}" if lacking else "all"
            if len(lacking) > len(listed):
                names = ", ".join(listed)
            lines += ["", f"Columns as in [{base}](#{base}): {names}." + (" And:" if len(shared) < len(cells) else "")]
        if len(shared) < len(cells):
            lines += ["", "| column | type | unit | meaning |", "|---|---|---|---|"]
            lines += [f"| {' | '.join(c)} |" for c in cells if c not in shared]
        blocks.append("\n".join(lines))
        if "(" not in call:
            described[call] = set(cells)
    return "\n\n".join(blocks)


def reasons_page() -> str:
    """Text of docs/reasons.md."""
    lines = [
        "# Reasons",
        "",
        "This page explains why a recording is in quarantine, or why an impact, a model or a passage was not used.",
        "",
        "There are no other reasons. In SQL: `from reasons`, `from rejected`, `from quarantine_open`.",
        "The view `rejected` also has two states of fits to passages ([passages](passages.md#what-a-score-is-worth)):",
        "`null_explains` (random models fit as well) and `not_an_impulse` (the wheels do not act as impulses).",
        "",
        "| reason | meaning |",
        "|---|---|",
        *(f"| `{code}` | {meaning} |" for code, meaning in REASONS.items()),
    ]
    return "\n".join(lines) + "\n"


def with_sections(page: str, sections: dict[str, str]) -> str:
    """``page`` with every generated section replaced.

    Parameters
    ----------
    page : str
        Markdown text with the marks of the sections.
    sections : dict
        Text by name of the section.

    Returns
    -------
    str
        The new page.

    Raises
    ------
    KeyError
        Where the page lacks a section.
    """
    for name, body in sections.items():
        pattern = re.compile(rf"<!-- {name}: generated, do not edit -->\n.*?\n?<!-- end of {name} -->", re.DOTALL)
        if not pattern.search(page):
            raise KeyError(f"no place for {name}")
        page = pattern.sub(_SECTION.format(name=name, body=body).replace("\\", r"\\"), page)
    return page


def write(folder: Path) -> None:
    """Write the generated sections into the pages of ``folder``.

    Parameters
    ----------
    folder : Path
        Folder ``docs``.
    """
    page = folder / "registry.md"
    sections = {"tables": table_tables(), "views": view_tables()}
    page.write_text(with_sections(page.read_text(encoding="utf-8"), sections), encoding="utf-8")
    (folder / "reasons.md").write_text(reasons_page(), encoding="utf-8")


def _values(column: Column) -> str:
    """Rules of a value in words: required or not, its range or choices, its resolution."""
    words = ["required"] if column.required and not column.key else []
    if column.allowed:
        words.append(", ".join(column.allowed))
    elif column.minimum is not None and column.maximum is not None and abs(column.maximum) < 1e300:
        words.append(f"{number_text(column.minimum)} to {number_text(column.maximum)}")
    elif column.minimum is not None and column.minimum > -1e300:
        words.append(f"at least {number_text(column.minimum)}")
    if column.decimals is not None:
        words.append(f"rounded to {number_text(10.0**-column.decimals)}")
    return "; ".join(words)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
