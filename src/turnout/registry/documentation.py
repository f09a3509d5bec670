"""The generated parts of docs/registry.md and docs/reasons.md, from what the program itself goes by.

``python -m turnout.registry.documentation docs`` writes them anew; a test compares.
"""

import re
import sys
from pathlib import Path

from turnout.errors import REASONS
from turnout.registry.columns import Column, tables
from turnout.registry.listing import views

_PART = "<!-- {name}: generated, do not edit -->\n{body}\n<!-- end of {name} -->"


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


def view_tables() -> str:
    """One table of columns per view and macro, under what a row of it is."""
    blocks = []
    for call, (what, rows) in sorted(views().items()):
        lines = [f"### {call}", "", what, "", "| column | type | unit | meaning |", "|---|---|---|---|"]
        lines += [f"| {r['column']} | {r['type']} | {r['unit']} | {r['meaning']} |" for r in rows]
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)


def reasons_page() -> str:
    """docs/reasons.md."""
    lines = [
        "# Reasons",
        "",
        "Why a recording is in quarantine, or an impact, a model or a passage was not used. The list is closed:",
        "`turnout.errors.REASONS`. In SQL: `from reasons`, `from rejected`, `from quarantine_open`.",
        "`rejected` has two more words for fits of passages: `null_explains`, a model of noise fits as well, and",
        "`not_an_impulse` ([passages](passages.md)).",
        "",
        "| reason | meaning |",
        "|---|---|",
        *(f"| `{code}` | {meaning} |" for code, meaning in REASONS.items()),
    ]
    return "\n".join(lines) + "\n"


def with_parts(page: str, parts: dict[str, str]) -> str:
    """``page`` with every generated part replaced; KeyError where it has no place for one."""
    for name, body in parts.items():
        found = re.compile(rf"<!-- {name}: generated, do not edit -->\n.*?\n?<!-- end of {name} -->", re.DOTALL)
        if not found.search(page):
            raise KeyError(f"no place for {name}")
        page = found.sub(_PART.format(name=name, body=body).replace("\\", r"\\"), page)
    return page


def write(folder: Path) -> None:
    """Write the generated parts into the pages of ``folder``."""
    page = folder / "registry.md"
    parts = {"tables": table_tables(), "views": view_tables()}
    page.write_text(with_parts(page.read_text(encoding="utf-8"), parts), encoding="utf-8")
    (folder / "reasons.md").write_text(reasons_page(), encoding="utf-8")


def _values(column: Column) -> str:
    """What a value may be: required or not, and its range or its choices."""
    parts = ["required"] if column.required and not column.key else []
    if column.allowed:
        parts.append(", ".join(column.allowed))
    elif column.minimum is not None and column.maximum is not None and abs(column.maximum) < 1e300:
        parts.append(f"{column.minimum:g} to {column.maximum:g}")
    elif column.minimum is not None and column.minimum > -1e300:
        parts.append(f"at least {column.minimum:g}")
    if column.decimals is not None:
        parts.append(f"kept to {10.0**-column.decimals:g}")
    return "; ".join(parts)


if __name__ == "__main__":
    write(Path(sys.argv[1]))
