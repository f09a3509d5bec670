"""The views and macros of the registry: one SQL file per question, created in the order of their needs."""

import re
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib.resources import files

from turnout.errors import REASONS, RegistryError
from turnout.registry.columns import literal

_NEEDS = re.compile(r"^--\s*needs:\s*(.+)$", re.MULTILINE)


@cache
def view_files() -> dict[str, str]:
    """SQL text of every file in ``views``, each after those it needs; ties by name.

    >>> order = list(view_files())
    >>> order.index("superseded") < order.index("modes_current")
    True
    """
    folder = files("turnout.registry") / "views"
    texts = {p.name[:-4]: p.read_text(encoding="utf-8") for p in folder.iterdir() if p.name.endswith(".sql")}
    return in_order(texts)


def in_order(texts: dict[str, str]) -> dict[str, str]:
    """The files sorted so that each follows what its line ``-- needs: a, b`` names.

    >>> list(in_order({"a": "-- needs: c", "b": "", "c": ""}))
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
    """View ``reasons``: every reason code with its meaning."""
    values = ", ".join(f"({literal(code)}, {literal(meaning)})" for code, meaning in REASONS.items())
    return f"create or replace view reasons as select * from (values {values}) as r(reason_code, meaning)"
