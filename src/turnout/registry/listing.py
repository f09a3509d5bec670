"""Tables, views and macros in words, for the command line and for docs/registry.md."""

import difflib
from functools import cache

from turnout.errors import RegistryError
from turnout.registry.columns import tables
from turnout.registry.database import view_columns
from turnout.registry.view_files import view_files


@cache
def views() -> dict[str, tuple[str, tuple[dict[str, str], ...]]]:
    """Every view, and every macro with its parameters: what a row is, and its columns.

    >>> views()["section_trend(section, resonance)"][1][1]["column"]
    'frequency_hz'
    """
    found: dict[str, list[dict[str, str]]] = {}
    for row in view_columns():
        found.setdefault(row["view"] + row["parameters"], []).append(row)
    return {call: (row_of(rows[0]["view"]), tuple(rows)) for call, rows in found.items()}


def row_of(name: str) -> str:
    """What a row of the view is: the comment above the statement that creates it, else the first line of its file."""
    for sql in view_files().values():
        for keyword in ("view", "macro"):
            head, found, _ = sql.partition(f"create or replace {keyword} {name}")
            if found and not (sql[len(head) + len(found)].isalnum() or sql[len(head) + len(found)] == "_"):
                comment = head.rstrip().rpartition("\n\n")[2].splitlines()
                lines = [c[2:].strip() for c in comment if c.startswith("--") and "needs:" not in c]
                return " ".join(lines)
    return {"registry_info": "One row: what this registry is.", "reasons": "One row per reason code."}.get(name, "")


def listing() -> str:
    """One line per table, view and macro."""
    lines = ["Tables"]
    lines += [f"  {t:<24} {', '.join(c.name for c in cs if c.key)}" for t, cs in tables().items()]
    lines += ["", "Views and macros"]
    lines += [f"  {call:<46} {what}" for call, (what, _) in sorted(views().items())]
    return "\n".join(lines)


def describe(name: str | None = None) -> str:
    """Columns of one table, view or macro, or of all, with type, unit and meaning."""
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
