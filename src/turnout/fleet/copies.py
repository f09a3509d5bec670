"""The same files twice in one turnout's folder: one unit of them counts, the other says whose copy it is."""

from collections.abc import Iterable, Mapping

from turnout.fleet.batches import UnitResult
from turnout.fleet.guard import quarantine_row
from turnout.fleet.scan import unit_id
from turnout.fleet.state import Known
from turnout.records import Unit

KEY = "copy of "


def original_of(known: Known) -> str | None:
    """The unit whose copy it was found to be."""
    return known.key.removeprefix(KEY) if known.key.startswith(KEY) else None


def copies(units: Mapping[str, Known]) -> dict[str, str]:
    """Copy -> original, of units that have rows: one whose every file lies in another of its turnout and kind, too.

    Where both hold the same, the first by name is the original.

    >>> units = {name: Known("", "", "", "ok", "", held) for name, held in
    ...          {"t/passage/b": "1", "t/passage/a": "1", "t/passage/c": "2", "u/passage/a": "1"}.items()}
    >>> copies(units)
    {'t/passage/b': 't/passage/a'}
    """
    held = {name: frozenset(k.contents.split()) for name, k in units.items() if k.status in ("ok", "partly")}
    holders: dict[tuple[str, str], set[str]] = {}
    for name, contents in held.items():
        for content in contents:
            holders.setdefault((_folder(name), content), set()).add(name)
    found: dict[str, str] = {}
    for name in sorted(held):
        if held[name]:
            others = set.intersection(*(holders[_folder(name), content] for content in held[name]))
            originals = [o for o in sorted(others) if held[name] < held[o] or (held[name] == held[o] and o < name)]
            found |= {name: originals[0]} if originals else {}
    return found


def copy_result(unit: Unit, original: str, held_there: Iterable[str], algo: str) -> UnitResult:
    """What a copy is in the registry: one row of quarantine, and nothing that counts twice."""
    path = unit.files[0][0]
    found = f"same bytes as {', '.join(held_there)}"
    row = quarantine_row(unit, path, "duplicate", "the whole unit", found, "Delete one of them")
    return UnitResult(
        unit_id(unit), unit.turnout, unit.kind, KEY + original, algo, "quarantined", {"quarantine": [row]}
    )


def _folder(name: str) -> str:
    """Turnout and kind of a unit.

    >>> _folder("t1/passage/2026/a.h5")
    't1/passage'
    """
    return "/".join(name.split("/", 2)[:2])
