"""List what a run would compute: units per stage, new, changed or left out. Changes nothing.

A unit is new if it was never computed. It is changed if its files, its settings, the notes of its campaign or the code
of its stage differ from those of its result. A file with only a new time counts as changed here; the run then compares
its content and computes nothing. Files that have vanished since the last run are listed, with whether the next run will
stop because of them.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from turnout.cli.option_types import at_least_one
from turnout.cli.options import RAW_HELP, add_configuration, add_raw, add_result, add_turnouts, add_use, add_work
from turnout.counts import count_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path
    from typing import Any

    from turnout.config import Configuration, TurnoutConfig
    from turnout.records import Unit
    from turnout.workflow.plan import PlannedUnit

GROUP = "Run"
HELP = "list what is new, without computing"
STAGES = {
    "hammer": ("turnout.stages.hammer", None),
    "passage": ("turnout.stages.passage", "turnout.stages.passage_context:passage_context"),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Folders of configuration, raw files and results, the turnouts, and the number of shards.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the command.
    """
    add_configuration(parser)
    add_raw(parser, help=f"{RAW_HELP} (raw)", default=None)
    add_work(parser, "folder of the results of earlier runs (%(default)s)")
    parser.add_argument(
        "--shards", type=at_least_one, help="number of shards of those runs, instead of that in config.yaml"
    )
    add_turnouts(parser, "only these turnouts")


def run(args: argparse.Namespace) -> int:
    """Print the new and changed units and the files left out, with the count of units.

    Parameters
    ----------
    args : argparse.Namespace
        Options of the command.

    Returns
    -------
    int
        Exit code.

    Raises
    ------
    ConfigError
        The number of shards is out of its range, or the raw folder is absent.
    """
    from pathlib import Path

    from turnout.config import load_configuration
    from turnout.config.settings.fleet import MAX_SHARDS
    from turnout.errors import ConfigError

    configuration = load_configuration(args.configuration)
    shards = configuration.settings["fleet"].shards if args.shards is None else args.shards
    if not 1 <= shards <= MAX_SHARDS:
        remedy = f"Write the number of shards of the runs, 1 to {MAX_SHARDS}"
        raise ConfigError("--shards", "number", str(shards), remedy)
    if args.raw and not Path(args.raw).is_dir():
        raise ConfigError(
            args.raw, "--raw", "no such folder", "Write the folder that holds the folders of the turnouts"
        )
    counts = dict.fromkeys(("all", "new", "changed"), 0)
    earlier = _EarlierResults(Path(args.work), shards)
    n_left_out = 0
    for turnout in map(configuration.turnout, args.turnouts or configuration.ids):
        n_left_out += _print_changes(turnout, Path(args.raw or "raw"), earlier, counts)
    add_result(args, counts)
    add_use(args, counts["all"], n_left_out)
    print(f"{count_of(counts['all'], 'unit')}, {counts['new']} never computed, {counts['changed']} changed since.")
    _print_gone(configuration, Path(args.raw or "raw"), Path(args.work) / "plan", shards, args.turnouts)
    return 0


def _print_gone(
    configuration: Configuration, raw: Path, plans: Path, shards: int, turnouts: Sequence[str] | None
) -> None:
    """Print which files of the last run are missing, and the error that stops the next run, if any."""
    from turnout.workflow.plan import missing_files, stop_error

    gone = missing_files(configuration, raw, plans, shards, turnouts)
    if error := stop_error(configuration, raw, plans, gone):
        print(f"the next run will stop: {error}")
    elif len(gone.files) == 1:
        print(f"{gone}, {gone.files[0]}: what it gave stays in the registry.")
    elif gone.files:
        print(f"{gone}, first {gone.files[0]}: what they gave stays in the registry.")


def _print_changes(turnout: TurnoutConfig, raw: Path, earlier: _EarlierResults, counts: dict[str, int]) -> int:
    """Print and count the new and changed units of one turnout; print the files left out and return their number."""
    from turnout.config.campaign_notes import read_notes
    from turnout.workflow.notes import notes_of
    from turnout.workflow.plan import PlannedUnit
    from turnout.workflow.scan import scan, unit_id

    scanned = scan(turnout, raw)
    noted_turnout, note_errors = read_notes(turnout, raw)
    for unit, note in zip(scanned.units, notes_of(noted_turnout, scanned.units)):
        change = earlier.change_of(PlannedUnit(unit, note), turnout.settings)
        counts["all"] += 1
        if change:
            counts[change] += 1
            print(f"{change:<8} {unit_id(unit)}: {count_of(len(unit.files), 'file')}")
    for problem in (*scanned.problems, *note_errors):
        print(f"left out {problem}")
    return len(scanned.problems)


class _EarlierResults:
    """Results of earlier runs, read when a shard is first needed."""

    def __init__(self, work: Path, shards: int) -> None:
        self.work, self.shards = work, shards
        self.states: dict = {}
        self.tokens: dict = {}
        self.algo: dict[str, str] = {}

    def change_of(self, planned: PlannedUnit, settings: Mapping[str, Any]) -> str:
        """ "new", "changed", or "" if its result is current."""
        from turnout.fingerprint import fingerprint
        from turnout.workflow.plan import shard_of
        from turnout.workflow.scan import unit_id
        from turnout.workflow.state import load_state
        from turnout.workflow.tasks import stamp_of, with_token

        unit = planned.unit
        module, _ = STAGES[unit.kind]
        path = self.work / unit.kind / f"{shard_of(unit.turnout, self.shards)}.json"
        if path not in self.states:
            self.states[path] = load_state(path).units
        before = self.states[path].get(unit_id(unit))
        if before is None:
            return "new"
        if unit.kind not in self.algo:
            self.algo[unit.kind] = fingerprint(module)
        planned = with_token(planned, self._token(unit, settings))
        return "" if (before.stamp, before.algo) == (stamp_of(planned), self.algo[unit.kind]) else "changed"

    def _token(self, unit: Unit, settings: Mapping[str, Any]) -> str:
        """Token of what a stage takes from another one, such as the models that passages are fitted with."""
        from turnout.workflow.tasks import load_function

        context = STAGES[unit.kind][1]
        if context and (unit.kind, unit.turnout) not in self.tokens:
            self.tokens[unit.kind, unit.turnout] = load_function(context)(unit.turnout, settings, work=self.work)[0]
        return self.tokens.get((unit.kind, unit.turnout), "")
