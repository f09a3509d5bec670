"""Handle copied and moved files.

Files that are twice in a turnout's folder count in one unit; the other unit names the original in its quarantine row. A
measurement whose files were moved counts in the new unit only, also in another turnout, and also if up to half of them
were deleted. A hammer test that was moved and corrected in one night has other bytes: its impacts tell that it is the
same. Nothing tells at which of two turnouts a hammer test was made whose file is at both: it counts at both, with a
remark.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeGuard

from turnout.config.merge import digest
from turnout.config.settings.fleet import FleetSettings
from turnout.records import Unit
from turnout.workflow.batches import UnitResult, read_results
from turnout.workflow.guard import quarantine_row, status_of
from turnout.workflow.ledger import Ledger
from turnout.workflow.plan import PlannedUnit, read_plan
from turnout.workflow.retries import request_rerun
from turnout.workflow.scan import unit_id
from turnout.workflow.state import VANISHED, WITH_ROWS, UnitState, batch_folder, load_state, state_lock

COPY_PREFIX = "copy of "
# Impacts with the same peak force and contact show that two hammer tests are one. Two impacts of different tests agree
# in both once in some thousand, so three do by chance in none.
MIN_SAME_IMPACTS = 3
SAME_IMPACTS_SHARE = 0.5  # of the impacts of the earlier result
MOVED_SHARE = 0.5  # of the files of a missing unit; the others are gone. Less is a misplaced file among deleted ones


@dataclass(frozen=True)
class Original:
    """Original of a copied file: the ``unit`` in which it counts, and its ``path`` there."""

    unit: str
    path: str


def originals_of(entry: UnitState) -> list[str]:
    """Units whose files a unit holds as copies.

    Parameters
    ----------
    entry : UnitState
        State of the unit.

    Returns
    -------
    list of str
        Names of these units; none if it holds no copies.
    """
    return [line.removeprefix(COPY_PREFIX) for line in entry.key.split("\n") if line.startswith(COPY_PREFIX)]


def copies(units: Mapping[str, UnitState]) -> dict[str, dict[str, str]]:
    """Units that hold copies of files, within one turnout and kind.

    A unit is a copy as a whole if another one has all of its files. Of units that share some files, and of two with the
    same files, the first by name keeps them. Files that were already excluded from a unit remain excluded.

    Parameters
    ----------
    units : mapping of str to UnitState
        Unit -> state, of one shard.

    Returns
    -------
    dict of str to dict of str to str
        Unit -> content -> unit in which that file counts; only units with rows take part.

    Examples
    --------
    >>> units = {name: UnitState("", "", "", "ok", "", held) for name, held in
    ...          {"t/passage/b": "1", "t/passage/a": "1 3", "t/passage/c": "2 3", "u/passage/a": "1"}.items()}
    >>> copies(units)
    {'t/passage/b': {'1': 't/passage/a'}, 't/passage/c': {'3': 't/passage/a'}}
    """
    contents_by_unit = {name: frozenset(k.own_contents) for name, k in units.items() if k.status in WITH_ROWS}
    holders: dict[tuple[str, str], set[str]] = {}
    for name, contents in contents_by_unit.items():
        for content in contents:
            holders.setdefault((_folder(name), content), set()).add(name)
    originals_by_copy = _whole_copies(contents_by_unit, holders)
    whole = set(originals_by_copy)
    for (_, content), names in sorted(holders.items()):
        first, *later = sorted(names - whole)
        for name in later:
            originals_by_copy.setdefault(name, {})[content] = first
    for name, counts_in in originals_by_copy.items():
        for content in units[name].contents_elsewhere:
            if holding_units := holders.get((_folder(name), content), set()) - whole:
                counts_in[content] = min(holding_units)
    return originals_by_copy


def _whole_copies(contents_by_unit: Mapping[str, frozenset[str]], holders: Mapping) -> dict[str, dict[str, str]]:
    originals_by_copy = {}
    for name in sorted(name for name in contents_by_unit if contents_by_unit[name]):
        containers = set.intersection(*(holders[_folder(name), content] for content in contents_by_unit[name]))
        originals = [
            o
            for o in sorted(containers)
            if contents_by_unit[name] < contents_by_unit[o]
            or (contents_by_unit[name] == contents_by_unit[o] and o < name)
        ]
        if originals:
            originals_by_copy[name] = dict.fromkeys(sorted(contents_by_unit[name]), originals[0])
    return originals_by_copy


def originals(
    name: str, counts_in: Mapping[str, str], units: Mapping[str, UnitState], wanted: Mapping[str, PlannedUnit]
) -> dict[str, Original]:
    """Originals of the copied files of a unit.

    Parameters
    ----------
    name : str
        The unit with the copies.
    counts_in : mapping of str to str
        Content -> unit in which it counts.
    units : mapping of str to UnitState
        Unit -> state, of one shard.
    wanted : mapping of str to PlannedUnit
        Unit -> planned unit, of the same shard.

    Returns
    -------
    dict of str to Original
        Path -> original.
    """
    return {
        path: Original(original_unit, _path_in_unit(content, wanted[original_unit].unit, units[original_unit]))
        for (path, *_), content in zip(wanted[name].unit.files, units[name].all_contents)
        if (original_unit := counts_in.get(content))
    }


def without_copies(unit: Unit, copied: Mapping[str, Original]) -> Unit:
    """The unit without the files that count in other units.

    Parameters
    ----------
    unit : Unit
        The unit.
    copied : mapping of str to Original
        Path -> original, of the files that count in other units.

    Returns
    -------
    Unit
        The unit with its other files.
    """
    return replace(unit, files=tuple(file for file in unit.files if file[0] not in copied))


def key_without(key: str, copied: Mapping[str, Original]) -> str:
    """The ``key`` of a unit that is computed without its copied files; it names the units of the originals.

    Parameters
    ----------
    key : str
        Key of the unit with all its files.
    copied : mapping of str to Original
        Path -> original, of the files that count in other units.

    Returns
    -------
    str
        The same key without copies, else one that names the units of the originals.
    """
    if not copied:
        return key
    named = "".join(f"\n{COPY_PREFIX}{unit}" for unit in sorted({o.unit for o in copied.values()}))
    return digest([key, [[path, o.path] for path, o in sorted(copied.items())]]) + named


def with_copy_rows(result: UnitResult, unit: Unit, copied: Mapping[str, Original]) -> UnitResult:
    """Add quarantine rows that name the copies to a result.

    Parameters
    ----------
    result : UnitResult
        Result of the other files of the unit.
    unit : Unit
        The unit.
    copied : mapping of str to Original
        Path -> original, of the files that count in other units.

    Returns
    -------
    UnitResult
        The result with these rows; the same one without copies.
    """
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


def _path_in_unit(content: str, unit: Unit, entry: UnitState) -> str:
    """Path of a content in ``unit``; that of its first file if its files have changed since it was computed."""
    match = (path for (path, *_), match in zip(unit.files, entry.all_contents) if match == content)
    return next(match, unit.files[0][0])


def _folder(name: str) -> str:
    """Turnout and kind of a unit.

    >>> _folder("t1/passage/2026/a.h5")
    't1/passage'
    """
    return "/".join(name.split("/", 2)[:2])


Units = Mapping[str, UnitState]


def moved_units(units: Units, wanted: Collection[str]) -> list[str]:
    """Missing units of which half of the files or more have rows in other units of the same state.

    Parameters
    ----------
    units : mapping of str to UnitState
        Unit -> state, of one shard.
    wanted : collection of str
        Units that are planned now.

    Returns
    -------
    list of str
        Names of the units.
    """
    holders = _holders(
        {content for name in _missing_units(units, wanted) for content in units[name].own_contents}, [(units, wanted)]
    )
    return [name for name in _missing_units(units, wanted) if _has_moved(units[name], holders)]


def withdrawal(name: str, entry: UnitState) -> UnitResult:
    """The empty result that supersedes the rows of a unit.

    Parameters
    ----------
    name : str
        The unit.
    entry : UnitState
        Its present state.

    Returns
    -------
    UnitResult
        Result without tables and with the status "vanished".
    """
    turnout, kind, _ = name.split("/", 2)
    return UnitResult(name, turnout, kind, VANISHED, entry.algo, VANISHED, {})


def withdraw_moved(
    work: Path, stages: Iterable[str], shards: Iterable[str], limits: FleetSettings, published: int = 0
) -> int:
    """Withdraw units that were moved to a turnout of another shard, after the jobs of all shards.

    A rerun of the shard is requested, so that stages that use its results omit them, too. A stage that gathers its own
    units plans only some of them: one of these has moved when its turnout holds none of its files.

    Parameters
    ----------
    work : Path
        Folder ``work`` of the workflow.
    stages : iterable of str
        Names of the stages.
    shards : iterable of str
        Names of the shards that took part in the run.
    limits : FleetSettings
        Settings of the checkpoints.
    published : int
        When the registry was last published: results that are newer are compared by their impacts. [ns since 1970]

    Returns
    -------
    int
        Number of withdrawn units.
    """
    plans = {shard: work / "plan" / f"{shard}.json" for shard in shards}
    wanted = {shard: {unit_id(p.unit) for p in read_plan(plan)} for shard, plan in plans.items() if plan.exists()}
    kinds = {_kind(name) for names in wanted.values() for name in names}
    states = [work / stage / f"{shard}.json" for stage in stages for shard in wanted]
    units = {state: load_state(state).units for state in states}
    missing = {state: _missing_units(units[state], wanted[state.stem]) for state in states}
    contents = {content for state in states for name in missing[state] for content in units[state][name].own_contents}
    holders = _holders(contents, [(units[state], wanted[state.stem]) for state in states])

    def has_moved(name: str, entry: UnitState) -> bool:
        by = set().union(*(holders[content] for content in entry.own_contents))
        return _has_moved(entry, holders) and (_kind(name) in kinds or _turnout(name) not in by)

    moved = {s: {n: units[s][n] for n in missing[s] if has_moved(n, units[s][n])} for s in states}
    fresh = _fresh_hammer_tests(units, wanted, published)
    for state in states:
        corrected = [n for n in missing[state] if n not in moved[state] and _is_corrected(n, state, units, fresh)]
        moved[state] |= {name: units[state][name] for name in corrected}
    for state in states:
        _withdraw(state, moved[state], limits)
    return sum(map(len, moved.values()))


def _fresh_hammer_tests(
    units: Mapping[Path, Units], wanted: Mapping[str, Collection[str]], published: int
) -> dict[str, list[tuple[Path, str]]]:
    """Day -> (state, unit) of the planned hammer tests whose results are newer than the published registry."""
    fresh: dict[str, list[tuple[Path, str]]] = {}
    for state, entries in units.items():
        new_batches = {p.name for p in batch_folder(state).glob("batch-*.parquet") if p.stat().st_mtime_ns > published}
        for name in wanted[state.stem]:
            entry = entries.get(name)
            if _kind(name) == "hammer" and _has_rows(entry) and entry.batch in new_batches:
                fresh.setdefault(_day(name), []).append((state, name))
    return fresh


def _is_corrected(
    name: str, state: Path, units: Mapping[Path, Units], fresh: Mapping[str, Collection[tuple[Path, str]]]
) -> bool:
    """Whether the impacts of a missing hammer test are those of a fresh one of the same day at another turnout."""
    if _kind(name) != "hammer" or not _has_rows(units[state][name]):
        return False
    elsewhere = [(s, n) for s, n in fresh.get(_day(name), ()) if _turnout(n) != _turnout(name)]
    if not elsewhere:
        return False
    impacts = _impacts(state, name, units)
    n_same = max(len(impacts & _impacts(other, test, units)) for other, test in elsewhere)
    return n_same >= max(MIN_SAME_IMPACTS, SAME_IMPACTS_SHARE * len(impacts))


def _impacts(state: Path, name: str, units: Mapping[Path, Units]) -> set[tuple[float, float]]:
    """Peak force [0.1 N] and contact [µs] of the impacts of a hammer test; none if its batch is damaged."""
    import pyarrow as pa

    try:
        results = list(read_results(batch_folder(state) / units[state][name].batch, {name}))
    except (OSError, pa.ArrowException):  # named when the batch is registered
        return set()
    rows = [row for result in results for row in result.tables.get("impacts", ())]
    return {(round(row["peak_n"], 1), round(row["contact_ms"], 3)) for row in rows if row["contact_ms"] is not None}


def _withdraw(state: Path, moved: Units, limits: FleetSettings) -> None:
    if not moved:
        return
    request_rerun(state)  # first: a job killed in between then causes one rerun too many, not one too few
    with state_lock(state):
        ledger = Ledger(state, limits)
        for name, entry in moved.items():
            ledger.keep(withdrawal(name, entry), "")
        ledger.checkpoint()


def _missing_units(units: Units, wanted: Collection[str]) -> list[str]:
    return [n for n, entry in units.items() if n not in wanted and entry.status != VANISHED and entry.own_contents]


def _has_moved(entry: UnitState, holders: Mapping[str, Collection[str]]) -> bool:
    """Whether so many files of a missing unit count elsewhere that its measurement would count twice."""
    n_moved = sum(bool(holders[content]) for content in entry.own_contents)
    return n_moved >= MOVED_SHARE * len(entry.own_contents)


def _holders(contents: Collection[str], states: Iterable[tuple[Units, Collection[str]]]) -> dict[str, set[str]]:
    """Content -> turnouts with a planned unit that has rows from it."""
    holders: dict[str, set[str]] = {content: set() for content in contents}
    for units, wanted in states:
        for name in wanted if contents else ():
            entry = units.get(name)
            for content in entry.own_contents if entry and entry.status in WITH_ROWS else ():
                if content in holders:
                    holders[content].add(_turnout(name))
    return holders


def files_at_two_turnouts(work: Path, stages: Sequence[str], shards: Iterable[str]) -> list[dict]:
    """Remarks on hammer files of which another turnout has the same bytes, after the jobs of all shards.

    A passage may be at two turnouts, because one logger may record the train at both.

    Parameters
    ----------
    work : Path
        Folder ``work`` of the workflow.
    stages : sequence of str
        Names of the stages.
    shards : iterable of str
        Names of all shards.

    Returns
    -------
    list of dict
        Rows of ``quarantine``, sorted by path: each names one file of another turnout.
    """
    units_by_content: dict[str, dict[str, Unit]] = {}
    for shard in shards:
        plan = work / "plan" / f"{shard}.json"
        tests = [p.unit for p in read_plan(plan) if p.unit.kind == "hammer"] if plan.exists() else []
        for stage in stages if tests else ():
            states = load_state(work / stage / f"{shard}.json").units
            for unit in tests:
                entry = states.get(unit_id(unit))
                for (path, *_), content in zip(unit.files, entry.all_contents if _has_rows(entry) else ()):
                    units_by_content.setdefault(content, {})[path] = unit
    rows = [
        quarantine_row(unit, path, "other_turnout", "the file", f"same bytes as {other}; it counts at both", REMEDY)
        for units in units_by_content.values()
        for path, unit in units.items()
        if (other := min((p for p, u in units.items() if u.turnout != unit.turnout), default=""))
    ]
    return sorted(rows, key=lambda row: row["path"])


REMEDY = "Delete it at the turnout where it was not measured"


def _has_rows(entry: UnitState | None) -> TypeGuard[UnitState]:
    return entry is not None and entry.status in WITH_ROWS


def _day(name: str) -> str:
    """Day of the campaign in the name of a hammer test.

    >>> _day("t1/hammer/A7/2024-05-13")
    '2024-05-13'
    """
    return name.rsplit("/", 1)[1]


def _turnout(name: str) -> str:
    return name.split("/", 1)[0]


def _kind(name: str) -> str:
    return name.split("/", 2)[1]
