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

Units = Mapping[str, Known]


def moved(units: Units, wanted: Collection[str]) -> list[str]:
    """Units that are gone while others of the same state have rows from all the files that they held."""
    held = _holders({content for name in _gone(units, wanted) for content in units[name].counted}, [(units, wanted)])
    return [name for name in _gone(units, wanted) if all(held[content] for content in units[name].counted)]


def withdrawn(name: str, known: Known) -> UnitResult:
    """The empty result that takes the rows of a unit back."""
    turnout, kind, _ = name.split("/", 2)
    return UnitResult(name, turnout, kind, VANISHED, known.algo, VANISHED, {})


def withdraw_moved(work: Path, stages: Iterable[str], shards: Iterable[str], limits: FleetSettings) -> int:
    """Withdraw what was moved to a turnout of another shard, once the jobs of all are done; how many units.

    The shard is asked for again, so that the stages which build on its results do without them, too. A stage that
    gathers its own units looks at some of them only: one of them has moved when no file of it is left at its turnout.
    """
    plans = {shard: work / "plan" / f"{shard}.json" for shard in shards}
    wanted = {shard: {unit_id(p.unit) for p in read_plan(plan)} for shard, plan in plans.items() if plan.exists()}
    kinds = {_kind(name) for names in wanted.values() for name in names}
    states = [work / stage / f"{shard}.json" for stage in stages for shard in wanted]
    units = {state: load_state(state).units for state in states}
    gone = {state: _gone(units[state], wanted[state.stem]) for state in states}
    asked = {content for state in states for name in gone[state] for content in units[state][name].counted}
    holders = _holders(asked, [(units[state], wanted[state.stem]) for state in states])

    def has_moved(name: str, known: Known) -> bool:
        by = [holders[content] for content in known.counted]
        return all(by) and (_kind(name) in kinds or _turnout(name) not in set().union(*by))

    left = {s: {n: units[s][n] for n in gone[s] if has_moved(n, units[s][n])} for s in states}
    for state in states:
        _withdraw(state, left[state], limits)
    return sum(map(len, left.values()))


def _withdraw(state: Path, left: Units, limits: FleetSettings) -> None:
    if not left:
        return
    ask_again(state)  # first: who is killed in between has asked once too often, not once too seldom
    with locked(state):
        ledger = Ledger(state, limits)
        for name, known in left.items():
            ledger.keep(withdrawn(name, known), "")
        ledger.checkpoint()


def _gone(units: Units, wanted: Collection[str]) -> list[str]:
    return [n for n, known in units.items() if n not in wanted and known.status != VANISHED and known.counted]


def _holders(asked: Collection[str], places: Iterable[tuple[Units, Collection[str]]]) -> dict[str, set[str]]:
    """Content -> turnouts with a unit that is there and has rows from it."""
    holders: dict[str, set[str]] = {content: set() for content in asked}
    for units, wanted in places:
        for name in wanted if asked else ():
            known = units.get(name)
            for content in known.counted if known and known.status in WITH_ROWS else ():
                if content in holders:
                    holders[content].add(_turnout(name))
    return holders


def _turnout(name: str) -> str:
    return name.split("/", 1)[0]


def _kind(name: str) -> str:
    return name.split("/", 2)[1]
