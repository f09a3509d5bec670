"""The same files twice in one turnout's folder: they count in one unit, the other says whose copies it holds."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from turnout.config.merge import digest
from turnout.fleet.batches import UnitResult
from turnout.fleet.guard import quarantine_row, status_of
from turnout.fleet.plan import Planned
from turnout.fleet.state import WITH_ROWS, Known
from turnout.records import Unit

KEY = "copy of "


@dataclass(frozen=True)
class Original:
    """The ``unit`` in which a copied file counts, and its ``path`` there."""

    unit: str
    path: str


def originals_of(known: Known) -> list[str]:
    """The units of which it was found to hold copies."""
    return [line.removeprefix(KEY) for line in known.key.split("\n") if line.startswith(KEY)]


def copies(units: Mapping[str, Known]) -> dict[str, dict[str, str]]:
    """Copy -> {content: unit in which it counts}, of units that have rows, within one turnout and kind.

    A unit whose every file lies in another one, too, is a copy as a whole. Of others that share files, and of two that
    hold the same, the first by name keeps them. What a unit was computed without before is not forgotten.

    >>> units = {name: Known("", "", "", "ok", "", held) for name, held in
    ...          {"t/passage/b": "1", "t/passage/a": "1 3", "t/passage/c": "2 3", "u/passage/a": "1"}.items()}
    >>> copies(units)
    {'t/passage/b': {'1': 't/passage/a'}, 't/passage/c': {'3': 't/passage/a'}}
    """
    held = {name: frozenset(k.counted) for name, k in units.items() if k.status in WITH_ROWS}
    holders: dict[tuple[str, str], set[str]] = {}
    for name, contents in held.items():
        for content in contents:
            holders.setdefault((_folder(name), content), set()).add(name)
    found = _whole_copies(held, holders)
    whole = set(found)
    for (_, content), names in sorted(holders.items()):
        first, *later = sorted(names - whole)
        for name in later:
            found.setdefault(name, {})[content] = first
    for name, counts_in in found.items():
        for content in units[name].elsewhere:
            if there := holders.get((_folder(name), content), set()) - whole:
                counts_in[content] = min(there)
    return found


def _whole_copies(held: Mapping[str, frozenset[str]], holders: Mapping) -> dict[str, dict[str, str]]:
    found = {}
    for name in sorted(name for name in held if held[name]):
        others = set.intersection(*(holders[_folder(name), content] for content in held[name]))
        originals = [o for o in sorted(others) if held[name] < held[o] or (held[name] == held[o] and o < name)]
        if originals:
            found[name] = dict.fromkeys(sorted(held[name]), originals[0])
    return found


def originals(
    name: str, counts_in: Mapping[str, str], units: Mapping[str, Known], wanted: Mapping[str, Planned]
) -> dict[str, Original]:
    """Path -> original, of the files of a unit whose content ``counts_in`` another one."""
    return {
        path: Original(other, _path_of(content, wanted[other].unit, units[other]))
        for (path, *_), content in zip(wanted[name].unit.files, units[name].held)
        if (other := counts_in.get(content))
    }


def without(unit: Unit, copied: Mapping[str, Original]) -> Unit:
    """The unit without the files that count elsewhere."""
    return replace(unit, files=tuple(file for file in unit.files if file[0] not in copied))


def key_without(key: str, copied: Mapping[str, Original]) -> str:
    """The ``key`` of a unit that is computed without its copies; it names their originals."""
    if not copied:
        return key
    named = "".join(f"\n{KEY}{unit}" for unit in sorted({o.unit for o in copied.values()}))
    return digest([key, [[path, o.path] for path, o in sorted(copied.items())]]) + named


def with_copies_said(result: UnitResult, unit: Unit, copied: Mapping[str, Original]) -> UnitResult:
    """The ``result`` of the other files of ``unit``, and rows of quarantine that name the copies."""
    if not copied:
        return result
    there = {path: copied[path].path for path, *_ in unit.files if path in copied}
    if len(there) == len(unit.files):
        rows = [_row(unit, unit.files[0][0], "the whole unit", ", ".join(there.values()))]
    else:
        rows = [_row(unit, path, "the file", original) for path, original in there.items()]
    tables = {**result.tables, "quarantine": [*result.tables.get("quarantine", ()), *rows]}
    return replace(result, tables=tables, status=status_of(tables))


def _row(unit: Unit, path: str, what: str, originals: str) -> dict:
    return quarantine_row(unit, path, "duplicate", what, f"same bytes as {originals}", "Delete one of them")


def _path_of(content: str, unit: Unit, known: Known) -> str:
    """Where ``unit`` holds a content; its first file where its files were exchanged since it was computed."""
    held = (path for (path, *_), held in zip(unit.files, known.held) if held == content)
    return next(held, unit.files[0][0])


def _folder(name: str) -> str:
    """Turnout and kind of a unit.

    >>> _folder("t1/passage/2026/a.h5")
    't1/passage'
    """
    return "/".join(name.split("/", 2)[:2])
