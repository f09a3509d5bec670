"""A measurement whose files were moved counts at its new place alone, in whichever folder or turnout that is."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from turnout.config.settings.fleet import FleetSettings
from turnout.fleet.batches import UnitResult
from turnout.fleet.ledger import Ledger
from turnout.fleet.plan import read_plan
from turnout.fleet.postponed import ask_again
from turnout.fleet.scan import unit_id
from turnout.fleet.state import VANISHED, WITH_ROWS, Known, load_state, locked


def held(units: Mapping[str, Known], wanted: Collection[str]) -> set[str]:
    """Contents of the files from which units that are there have rows."""
    there = (units[name] for name in wanted if name in units)
    return {content for known in there if known.status in WITH_ROWS for content in known.counted}


def moved(units: Mapping[str, Known], wanted: Collection[str], held: Collection[str]) -> list[str]:
    """Units that are gone though all that they held is ``held`` by others."""
    gone = (name for name in units if name not in wanted and units[name].status != VANISHED)
    return [name for name in gone if units[name].counted and all(c in held for c in units[name].counted)]


def withdrawn(name: str, known: Known) -> UnitResult:
    """The empty result that takes the rows of a unit back."""
    turnout, kind, _ = name.split("/", 2)
    return UnitResult(name, turnout, kind, VANISHED, known.algo, VANISHED, {})


def withdraw_moved(work: Path, stages: Iterable[str], shards: Collection[str], limits: FleetSettings) -> int:
    """Withdraw what was moved to a turnout of another shard, once the jobs of all are done; how many units.

    The shard is asked for again, so that the stages which build on its results do without them, too.
    """
    plans = {shard: work / "plan" / f"{shard}.json" for shard in shards}
    wanted = {shard: {unit_id(p.unit) for p in read_plan(plan)} for shard, plan in plans.items() if plan.exists()}
    return sum(_withdraw_of(work / stage, wanted, limits) for stage in stages)


def _withdraw_of(folder: Path, wanted: Mapping[str, set[str]], limits: FleetSettings) -> int:
    """The same for one stage; ``wanted`` are the units that are there, by shard."""
    units = {shard: load_state(folder / f"{shard}.json").units for shard in wanted}
    everywhere = set().union(*(held(units[shard], wanted[shard]) for shard in wanted))
    left = {shard: names for shard in wanted if (names := moved(units[shard], wanted[shard], everywhere))}
    for shard, names in left.items():
        state = folder / f"{shard}.json"
        ask_again(state)  # first: who is killed in between has asked once too often, not once too seldom
        with locked(state):
            ledger = Ledger(state, limits)
            for name in names:
                ledger.keep(withdrawn(name, units[shard][name]), "")
            ledger.checkpoint()
    return sum(map(len, left.values()))
