"""One stage of one shard: compute the units whose key changed, keep the results of all others."""

import logging
import traceback
from collections import Counter
from collections.abc import Collection, Container, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from filelock import FileLock

from turnout.config import Configuration, TurnoutConfig, with_raw
from turnout.errors import ConfigError
from turnout.fleet.batches import UnitResult
from turnout.fleet.copies import copies, copy_result, original_of
from turnout.fleet.guard import guarded
from turnout.fleet.keys import contents_of, key_of, short, stamp_of
from turnout.fleet.ledger import Ledger
from turnout.fleet.machine import passing
from turnout.fleet.plan import Planned, read_plan
from turnout.fleet.pool import in_order
from turnout.fleet.postponed import Postponed, note_postponed, read_postponed
from turnout.fleet.progress import Progress
from turnout.fleet.scan import unit_id
from turnout.fleet.stage import Stage, Token, named, with_token
from turnout.fleet.state import Known

LOG = logging.getLogger("turnout.fleet")


@dataclass(frozen=True)
class Summary:
    """What a shard job did; ``stale`` units wait for a new plan because the configuration changed after it,
    ``postponed`` ones for the next run because the machine failed them."""

    shard: str
    known: int = 0
    processed: int = 0
    quarantined: int = 0
    internal_errors: int = 0
    vanished: int = 0
    stale: int = 0
    postponed: int = 0

    def __str__(self):
        said = f"{self.shard}: {self.known} known, {self.processed} processed, {self.quarantined} quarantined"
        more = {
            "internal errors": self.internal_errors, "postponed": self.postponed,
            "vanished": self.vanished, "waiting for a plan": self.stale,
        }  # fmt: skip
        return said + "".join(f", {n} {what}" for what, n in more.items() if n)


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
) -> Summary:
    """Bring the results of one shard up to its plan.

    Parameters
    ----------
    plan, state : path
        work/plan/<shard>.json, read after the lock is held, and work/<stage>/<shard>.json, whose batches lie in
        work/<stage>/<shard>/. Results count once the state file names their batch; it is written in one step,
        at every checkpoint and at the end, so a kill at any time loses a checkpoint's work and nothing else.
    stage : Stage
        What is computed.
    threads : int
        Processes; the results do not depend on it.
    only : sequence of str, optional
        Turnouts to compute; the others of the shard stay as they are.
    strict : bool
        Raise faults of the program instead of noting them.
    """
    state.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(state.parent / f".{state.stem}.lock"):
        run = _Run(Path(state), stage, configuration, Path(raw_root), threads, strict)
        planned = named(stage.gather)(plan, configuration) if stage.gather else read_plan(plan)
        return run.bring_up(list(planned), only)


class _Run:
    """One call of ``run_shard``."""

    def __init__(self, path: Path, stage: Stage, configuration: Configuration, raw_root: Path, threads, strict):
        self.path, self.name = path, f"{stage.kind} {path.stem}"
        self.stage, self.configuration, self.raw_root = stage, configuration, raw_root
        self.threads, self.strict = threads, strict
        self.ledger = Ledger(path, configuration.settings["fleet"])
        self.state = self.ledger.state
        self.postponed: dict[str, str] = {}

    def bring_up(self, planned: list[Planned], only: Sequence[str] | None) -> Summary:
        """Compute what is missing, write batches and state."""
        wanted = {unit_id(p.unit): p for p in planned if p.unit.kind == self.stage.kind}
        todo, stale = self._todo(wanted, only)
        if todo:
            # before processes are forked: each of them would import it anew
            self.compute = named(self.stage.compute)
        statuses = self._compute_all(todo)
        self.ledger.checkpoint()
        self._set_copies_aside(wanted)
        vanished = self._withdraw_vanished(wanted)
        n_postponed = self._note_postponed(wanted, {unit_id(planned.unit) for planned, *_ in todo})
        self.ledger.checkpoint()
        done, faults = statuses.total(), statuses["internal_error"]
        return Summary(
            self.name, len(wanted), done, done - statuses["ok"], faults, vanished, stale, n_postponed,
        )  # fmt: skip

    def _todo(self, wanted: dict[str, Planned], only) -> tuple[list[tuple], int]:
        """(planned, turnout, stamp, context) of every unit to compute, sorted; and how many wait for a plan."""
        todo, stale, turnouts = [], 0, {}
        for name in sorted(wanted):
            planned = wanted[name]
            turnout = planned.unit.turnout
            if only is not None and turnout not in only:
                continue
            if turnout not in turnouts:
                turnouts[turnout] = self._context(turnout)
            token, value = turnouts[turnout]
            planned = with_token(planned, token)
            stamp = stamp_of(planned)
            if self._is_known(name, stamp) and self._still_a_copy(name, wanted, token):
                continue
            config = self._turnout(planned, turnouts)
            if config is None:
                stale += 1
            elif not self._same_content(name, planned, stamp, self.state.units.get(name)):
                todo.append((planned, config, stamp, value))
        return todo, stale

    def _is_known(self, name: str, stamp: str) -> bool:
        known = self.state.units.get(name)
        return known is not None and (known.stamp, known.algo) == (stamp, self.stage.algo)

    def _still_a_copy(self, name: str, wanted: dict[str, Planned], token: Token) -> bool:
        """True for what is no copy, and for one whose original is as it was."""
        original = original_of(self.state.units[name])
        return original is None or (
            original in wanted and self._is_known(original, stamp_of(with_token(wanted[original], token)))
        )

    def _context(self, turnout: str) -> tuple[Token, object]:
        if not self.stage.context:
            return "", None
        try:
            settings = self.configuration.turnout(turnout).settings
        except ConfigError:  # its units wait for a plan
            return "", None
        return named(self.stage.context)(turnout, settings)

    def _turnout(self, planned: Planned, cache: dict) -> TurnoutConfig | None:
        """Configuration with the notes of the raw folder; None where it is not the one of the plan any more."""
        unit = planned.unit
        if (unit.turnout, "config") not in cache:
            try:
                config = self.configuration.turnout(unit.turnout)
                cache[unit.turnout, "config"] = with_raw(config, self.raw_root)
            except ConfigError:
                cache[unit.turnout, "config"] = None
        config = cache[unit.turnout, "config"]
        return config if config and config.hashes[unit.kind] == unit.config_hash else None

    def _same_content(self, name: str, planned: Planned, stamp: str, known: Known | None) -> bool:
        """Whether only times changed; the state then notes the new ones."""
        if known is None or known.algo != self.stage.algo:
            return False
        try:
            contents = contents_of(planned, self.raw_root)
        except OSError:  # met again, and told, when it is computed
            return False
        if same := known.key == key_of(planned, contents):
            self.state.units[name] = replace(known, stamp=stamp, contents=short(contents))
        return same

    def _compute_all(self, todo: list[tuple]) -> Counter[str]:
        """Keep every result; how many there are of each status."""
        progress = Progress(self.name, len(todo))
        statuses: Counter[str] = Counter()
        for found in in_order(self._compute, todo, self.threads):
            if isinstance(found, Postponed):
                self.postponed[found.unit] = found.met
                progress.step(False)
                continue
            result, stamp, contents = found
            statuses[result.status] += 1
            progress.step(result.status != "ok")
            self.ledger.keep(result, stamp, contents)
        progress.close()
        return statuses

    def _compute(self, task: tuple) -> tuple[UnitResult, str, str] | Postponed:
        planned, turnout, stamp, value = task
        more = {"context": value} if self.stage.context else {}
        try:
            contents = contents_of(planned, self.raw_root)
            call = partial(guarded, self.compute, planned.unit, turnout, self.raw_root, key_of(planned, contents))
            return call(self.stage.algo, self.strict, **more), stamp, short(contents)
        except (OSError, MemoryError) as error:
            if self.strict or not passing(error):
                raise
            LOG.warning("%s: left for the next run\n%s", unit_id(planned.unit), traceback.format_exc())
            return Postponed(unit_id(planned.unit), f"{type(error).__name__}: {error}")

    def _note_postponed(self, wanted: Container[str], tried: Container[str]) -> int:
        """Note the units that the machine failed, those of turnouts that were not asked for as before; how many."""
        before = read_postponed(self.path)[1]
        left = {unit: met for unit, met in before.items() if unit in wanted and unit not in tried}
        note_postponed(self.path, left | self.postponed)
        return len(self.postponed)

    def _set_copies_aside(self, wanted: dict[str, Planned]) -> None:
        """Rows of a unit whose files all lie in another one of its turnout, too, give way to one that says so."""
        if self.stage.gather:
            return
        present = {name: known for name, known in self.state.units.items() if name in wanted}
        for name, original in copies(present).items():
            there = [path for path, *_ in wanted[original].unit.files]
            result = copy_result(wanted[name].unit, original, there, self.stage.algo)
            self.ledger.keep(result, present[name].stamp, present[name].contents)

    def _withdraw_vanished(self, wanted: Collection[str]) -> int:
        """Count units whose files are all gone. Their rows stay; an empty result takes them back of a unit that only
        ever was in quarantine, for nothing is left to repair, and of one whose files were moved to others, for they
        would count twice. A stage that gathers its own units looks at some of them only: none has vanished for that."""
        gone = [name for name in self.state.units if name not in wanted]
        held = self._held(wanted) if gone and not self.stage.gather else {}
        for name in gone:
            known, (turnout, kind, _) = self.state.units[name], name.split("/", 2)
            contents = set(known.contents.split())
            moved = contents and contents <= held.get(turnout, set())
            if known.status == "quarantined" or (moved and known.status != "vanished"):
                self.ledger.keep(UnitResult(name, turnout, kind, "vanished", known.algo, "vanished", {}), "")
        return 0 if self.stage.gather else len(gone)

    def _held(self, wanted: Collection[str]) -> dict[str, set[str]]:
        """Turnout -> contents of the files from which its units that are there have rows."""
        held: dict[str, set[str]] = {}
        for name in wanted:
            known = self.state.units.get(name)
            if known and known.status in ("ok", "partly"):
                held.setdefault(name.split("/", 1)[0], set()).update(known.contents.split())
        return held
