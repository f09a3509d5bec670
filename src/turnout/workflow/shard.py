"""Compute one stage of one shard: units whose key changed are computed, the results of all others stay."""

import logging
import os
import traceback
from collections import Counter
from collections.abc import Callable, Collection, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from turnout.config import Configuration
from turnout.config.merge import digest
from turnout.workflow.batches import UnitResult, read_results
from turnout.workflow.duplicate_files import (
    copies,
    key_without,
    moved_units,
    originals,
    with_copy_rows,
    withdrawal,
    without_copies,
)
from turnout.workflow.guard import compute_guarded, death_rows, memory_rows, unreadable_rows
from turnout.workflow.ledger import Ledger
from turnout.workflow.plan import PlannedUnit, read_plan
from turnout.workflow.pool import LostTask, map_in_order, map_in_processes
from turnout.workflow.progress import Progress
from turnout.workflow.retries import (
    Postponed,
    clear_mark,
    first_postponed,
    mark_started,
    note_postponed,
    read_postponed,
    read_retried,
    started_units,
)
from turnout.workflow.scan import unit_id
from turnout.workflow.state import WITH_ROWS, batch_folder, state_lock
from turnout.workflow.tasks import (
    Stage,
    Task,
    Tasks,
    contents_of,
    file_states,
    key_of,
    load_function,
    readable_contents,
    short_contents,
)

LOG = logging.getLogger("turnout.workflow")
PROCESS_DIED = "the process died that computed it"
CHANGED = "changed while it was computed"
UNREADABLE = "unreadable"  # begins the key of a result without some of the unit's files
# A result, and the stamp and the contents that it was computed from.
Computed = tuple[UnitResult, str, str]


@dataclass(frozen=True)
class Summary:
    """Summary of a shard job, in numbers of units.

    ``stale`` units wait for a new plan, because the configuration changed after it. ``postponed`` ones wait for the
    next run, because of a fault of the machine. ``retried`` ones have quarantine rows about files that the machine
    could not read in two runs; every run tries them again.
    """

    shard: str
    n_known: int = 0
    processed: int = 0
    quarantined: int = 0
    internal_errors: int = 0
    vanished: int = 0
    stale: int = 0
    postponed: int = 0
    retried: int = 0

    def __str__(self) -> str:
        words = f"{self.shard}: {self.n_known} known, {self.processed} processed, {self.quarantined} quarantined"
        more = {
            "internal errors": self.internal_errors, "postponed": self.postponed,
            "vanished": self.vanished, "waiting for a plan": self.stale, "tried again in every run": self.retried,
        }  # fmt: skip
        return words + "".join(f", {n} {what}" for what, n in more.items() if n)


def run_shard(
    plan: Path,
    state: Path,
    stage: Stage,
    configuration: Configuration,
    raw_root: Path,
    *,
    threads: int = 1,
    only: Sequence[str] | None = None,
    strict: bool = False,
    launched: datetime | None = None,
) -> Summary:
    """Update the results of one shard to its plan.

    Parameters
    ----------
    plan, state : path
        work/plan/<shard>.json, read after the lock is acquired, and work/<stage>/<shard>.json, whose batches are in
        work/<stage>/<shard>/. Results count once the state file names their batch. It is written in one step, at every
        checkpoint and at the end, so a kill loses at most the work since the last checkpoint.
    stage : Stage
        The computation.
    configuration : Configuration
        Configuration of all turnouts.
    raw_root : Path
        Folder that the paths of the plan start from.
    threads : int
        Processes; the results do not depend on it.
    only : sequence of str, optional
        Turnouts to compute; the others of the shard stay as they are.
    strict : bool
        Raise faults of the program instead of noting them.
    launched : datetime, optional
        Start of the run that this job belongs to; a further attempt in the same run counts as the first one.

    Returns
    -------
    Summary
        Numbers of units by what became of them.
    """
    with state_lock(state):
        run = _Run(Path(state), stage, configuration, Path(raw_root), threads, strict, launched)
        planned = load_function(stage.gather)(plan, configuration) if stage.gather else read_plan(plan)
        return run.bring_up(list(planned), only)


class _Run:
    """One call of ``run_shard``."""

    def __init__(
        self,
        path: Path,
        stage: Stage,
        configuration: Configuration,
        raw_root: Path,
        threads: int,
        strict: bool,
        launched: datetime | None,
    ) -> None:
        self.path, self.name = path, f"{stage.kind} {path.stem}"
        self.stage, self.raw_root = stage, raw_root
        self.threads, self.strict, self.launched = threads, strict, launched.isoformat() if launched else ""
        self.ledger = Ledger(path, configuration.settings["fleet"])
        self.state = self.ledger.state
        self.tasks = Tasks(self.state, stage, configuration, raw_root)
        self.postponed: dict[str, str] = {}
        self.retried: dict[str, str] = {}
        self.faults_before = read_postponed(path)[1] | read_retried(path)
        self.postponed_since = first_postponed(path)
        self.unfinished = started_units(path)

    def bring_up(self, planned: list[PlannedUnit], only: Sequence[str] | None) -> Summary:
        """Compute missing units, write batches and state."""
        wanted = {unit_id(p.unit): p for p in planned if p.unit.kind == self.stage.kind}
        due, stale = self.tasks.due(wanted, only)
        self._clear_notes(due, only)
        statuses = self._compute_all(due)
        self._set_copies_aside(wanted, only)
        vanished = self._withdraw_vanished(wanted)
        n_postponed = self._note_postponed(wanted, {_name(task) for task in due})
        self.ledger.checkpoint()
        n_done, faults = statuses.total(), statuses["internal_error"]
        return Summary(
            self.name, len(wanted), n_done, n_done - statuses["ok"], faults, vanished, stale, n_postponed,
            len(self.retried),
        )  # fmt: skip

    def _clear_notes(self, due: list[Task], only: Sequence[str] | None) -> None:
        """Clear the marks of started units that need no computation any more."""
        requested = {name for name in self.unfinished if only is None or name.split("/", 1)[0] in only}
        for name in requested - {_name(task) for task in due}:
            clear_mark(self.path, name)
            del self.unfinished[name]

    def _compute_all(self, tasks: list[Task]) -> Counter[str]:
        """Compute the tasks and store every result; returns the number of units by status."""
        if tasks:
            # import it before processes are forked, or each of them would import it again
            self.compute = load_function(self.stage.compute)
        self.progress, self.statuses = Progress(self.name, len(tasks)), Counter[str]()
        tasks_by_name = {_name(task): task for task in tasks}
        tasks_alone = [tasks_by_name[name] for name in self.unfinished if name in tasks_by_name]
        map_tasks = (
            map_in_processes if tasks_alone else map_in_order
        )  # a process that has computed may have threads, no fork then
        try:
            for computed in map_tasks(
                self._compute, [t for t in tasks if _name(t) not in self.unfinished], self.threads
            ):
                if isinstance(computed, LostTask):
                    tasks_alone.append(computed.task)
                else:
                    self._keep(self._after_second_night(computed, tasks_by_name))
            self.ledger.checkpoint()
            for task in tasks_alone:
                self._compute_alone(task)
                self.ledger.checkpoint()
        finally:
            self.progress.close()
            self.ledger.checkpoint()
        return self.statuses

    def _compute_alone(self, task: Task) -> None:
        """Compute a task that may have ended a process or an earlier job, in its own process.

        If that dies as well, and not in the run that first started the unit, the unit gets a quarantine row.
        """
        name = _name(task)
        LOG.warning("%s: a process or a job died while it was computed: it is computed by itself", name)
        (computed,) = map_in_processes(self._compute, [task], 1)
        if not isinstance(computed, LostTask):
            self._keep(self._after_second_night(computed, {name: task}))
        elif self.strict:
            raise RuntimeError(f"{name}: {PROCESS_DIED}")
        elif name not in self.unfinished or (self.launched and self.unfinished[name] == self.launched):
            self._keep(Postponed(name, PROCESS_DIED))
        else:
            self._keep(computed := _provisional(self._compute_with_guard(task, death_rows)))
            self.ledger.checkpoint()  # before its mark is cleared
            if not isinstance(computed, Postponed):
                clear_mark(self.path, name)

    def _after_second_night(
        self, computed: Computed | Postponed, tasks: Mapping[str, Task]
    ) -> Computed | Postponed | None:
        """``computed``, or quarantine rows for a unit that an earlier run postponed for a fault of the same kind.

        None if these rows are there already.
        """
        if not isinstance(computed, Postponed):
            return computed
        unit = computed.unit
        first_run, kind = self.postponed_since.get(unit), _kind_of_fault(computed.fault)
        if first_run is None or (self.launched and first_run == self.launched):
            return computed
        if kind is None or _kind_of_fault(self.faults_before.get(unit, "")) != kind:
            return computed
        if kind is MemoryError:
            return _provisional(self._compute_with_guard(tasks[unit], memory_rows))
        self.retried[unit] = computed.fault
        return self._compute_readable(tasks[unit], computed.fault)

    def _compute_readable(self, task: Task, fault: str) -> Computed | None:
        """Result of a unit of which files cannot be read, with a quarantine row for each of them.

        The rows of a result of all its files stay, under the version of the program that computed them, until all
        files can be read again. A unit without such a result is computed from its readable files. Its stamp is empty,
        so that the next run tries it again. None if the state has this result.
        """
        name, unit = _name(task), task.planned.unit
        contents, faults = readable_contents(task.planned, self.raw_root)
        key = f"{UNREADABLE} {digest([key_of(task.planned, contents), sorted(faults)])}"
        entry = self.state.units.get(name)
        # a result without some of the files has contents only if its rows are those of all files, kept from before
        is_whole = bool(entry and (not entry.key.startswith(UNREADABLE) or entry.contents))
        is_kept = bool(entry and entry.status in WITH_ROWS and is_whole)
        algo = entry.algo if entry and is_kept else self.stage.algo
        if entry and (entry.key, entry.algo) == (key, algo):
            return None
        excluded = {*faults, *task.copied}
        readable = replace(unit, files=tuple(file for file in unit.files if file[0] not in excluded))
        compute = self.compute if faults and readable.files else _no_rows
        kept_contents = ""
        if entry and is_kept:
            tables = self._tables_of(name, entry.batch)
            tables["quarantine"] = [q for q in tables.get("quarantine", ()) if q["reason_code"] != "read_fault"]
            compute, kept_contents = (lambda *_, **__: tables), entry.contents
        faults = faults or {"": fault.replace(f"{self.raw_root}{os.sep}", "")}

        def with_rows(*args: Any, **more: Any) -> dict[str, list[dict]]:
            tables = compute(*args, **more)
            return {**tables, "quarantine": [*tables.get("quarantine", ()), *unreadable_rows(unit, faults)]}

        extra = {"context": task.context} if self.stage.context else {}
        try:
            result = compute_guarded(with_rows, readable, task.turnout, self.raw_root, key, algo, self.strict, **extra)
        except (OSError, MemoryError):
            compute = _no_rows
            result = compute_guarded(with_rows, readable, task.turnout, self.raw_root, key, algo, self.strict)
        return with_copy_rows(result, unit, task.copied), "", kept_contents

    def _tables_of(self, name: str, batch: str) -> dict[str, list[dict]]:
        """Rows of a unit in a batch of this shard."""
        (result,) = read_results(batch_folder(self.path) / batch, {name})
        return result.tables

    def _keep(self, computed: Computed | Postponed | None) -> None:
        if computed is None:
            self.progress.step(False)
            return
        if isinstance(computed, Postponed):
            self.postponed[computed.unit] = computed.fault
            self.progress.step(False)
            return
        result, stamp, contents = computed
        self.statuses[result.status] += 1
        self.progress.step(result.status != "ok")
        self.ledger.keep(result, stamp, contents)

    def _compute(self, task: Task) -> Computed | Postponed:
        with mark_started(self.path, _name(task), self.launched):
            return self._compute_with_guard(task, self.compute)

    def _compute_with_guard(self, task: Task, compute: Callable) -> Computed | Postponed:
        planned, unit = task.planned, task.planned.unit
        extra = {"context": task.context} if self.stage.context else {}
        before = file_states(planned, self.raw_root)
        try:
            contents = contents_of(planned, self.raw_root)
            key = key_without(key_of(planned, contents), task.copied)
            own_unit = without_copies(unit, task.copied)
            compute = compute if own_unit.files else _no_rows
            result = compute_guarded(
                compute, own_unit, task.turnout, self.raw_root, key, self.stage.algo, self.strict, **extra
            )
        except (OSError, MemoryError) as error:
            if self.strict:
                raise
            LOG.warning("%s: left for the next run\n%s", unit_id(unit), traceback.format_exc())
            return Postponed(unit_id(unit), f"{type(error).__name__}: {error}")
        elsewhere = {k for k, (path, *_) in enumerate(unit.files) if path in task.copied}
        stamp = task.stamp if all(contents) else ""  # a file that was gone may come back with the planned size and time
        computed = with_copy_rows(result, unit, task.copied), stamp, short_contents(contents, elsewhere)
        is_as_planned = all(state is None or state[:2] == file[1:] for state, file in zip(before, unit.files))
        if is_as_planned and file_states(planned, self.raw_root) == before:
            return computed
        LOG.warning("%s: its files changed while it was computed: the next run computes it again", unit_id(unit))
        return _provisional(computed, CHANGED)

    def _note_postponed(self, wanted: Container[str], tried: Container[str]) -> int:
        """Write the postponed units and return their number; those of turnouts that did not take part stay."""
        before = read_postponed(self.path)[1]
        postponed = {unit: fault for unit, fault in before.items() if unit in wanted and unit not in tried}
        retried = {u: fault for u, fault in read_retried(self.path).items() if u in wanted and u not in tried}
        note_postponed(self.path, postponed | self.postponed, self.launched, retried | self.retried)
        return len(self.postponed)

    def _set_copies_aside(self, wanted: dict[str, PlannedUnit], only: Sequence[str] | None) -> None:
        """Compute units again that contain copies of files of other units of their turnout, without these files."""
        if self.stage.gather:
            return
        requested = {name for name, p in wanted.items() if only is None or p.unit.turnout in only}
        units = {name: entry for name, entry in self.state.units.items() if name in requested}
        tasks = []
        for name, counts_in in copies(units).items():
            if self.tasks.is_known(name, wanted) and (task := self.tasks.task(wanted[name])):
                tasks.append(replace(task, copied=originals(name, counts_in, units, wanted)))
        self._compute_all(tasks)

    def _withdraw_vanished(self, wanted: Collection[str]) -> int:
        """Number of units whose files are all gone; their rows stay.

        An empty result withdraws the rows of a unit that was only in quarantine, as there is nothing left to repair. It
        also withdraws those of a unit whose files were moved to other units, as they would count twice. A stage that
        gathers its own units plans only some of them, so none of its units counts as vanished. Units of a turnout
        that is left out for an error in its configuration stay as they are.
        """
        units = self.state.units
        is_left_out = self.tasks.configuration.is_left_out
        missing = [name for name in units if name not in wanted and not is_left_out(name.split("/", 1)[0])]
        to_withdraw = {name for name in missing if units[name].status == "quarantined"}
        if missing and not self.stage.gather:
            to_withdraw.update(moved_units(units, wanted))
        for name in sorted(to_withdraw):
            self.ledger.keep(withdrawal(name, units[name]), "")
        return 0 if self.stage.gather else len(missing)


def _provisional(computed: Computed | Postponed, why: str = PROCESS_DIED) -> Computed | Postponed:
    """A result whose key matches no content, so that touching a file repeats it, perhaps on another machine."""
    if isinstance(computed, Postponed):
        return computed
    stamp = "" if why == CHANGED else computed[1]
    return replace(computed[0], key=f"{why} {computed[0].key}"), stamp, computed[2]


def _kind_of_fault(fault: str) -> type[Exception] | None:
    """Kind of the fault for which a unit was postponed; None if its process died, or for no fault."""
    if not fault or fault == PROCESS_DIED:
        return None
    return MemoryError if fault.startswith(MemoryError.__name__) else OSError


def _name(task: Task) -> str:
    return unit_id(task.planned.unit)


def _no_rows(*_: Any, **__: Any) -> dict[str, list[dict]]:
    """Rows of a unit with no other files than copies: none."""
    return {}
