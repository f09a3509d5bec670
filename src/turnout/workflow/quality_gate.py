"""Check the quality of new results after the registry is published, and fail the run if too many are bad."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from turnout.config import Configuration
from turnout.config.settings.fleet import FleetSettings
from turnout.errors import TurnoutError
from turnout.files import read_json, write_text
from turnout.workflow.batches import read_column
from turnout.workflow.retries import JOB_ENDED, read_postponed, request_rerun, started_units
from turnout.workflow.state import batch_paths, state_of

REPEATED_COMPLAINT = "stated before; it ends when they are fixed, or when enough newer units are usable"
IN_QUARANTINE, FAULTS = ("partly", "quarantined"), ("internal_error",)


@dataclass(frozen=True)
class QualityGate:
    """Result of the check of all units that are new since the last one.

    ``complaints`` is empty if the run passes; ``unsound`` is True if one of them is about units. ``batches`` are all
    batches in the states, ``damaged`` those that cannot be read.
    """

    units: int
    quarantined: int
    internal_errors: int
    complaints: tuple[str, ...]
    batches: tuple[str, ...]
    unsound: bool = False
    damaged: tuple[Path, ...] = ()

    def __str__(self) -> str:
        summary = f"{self.units} units computed, {self.quarantined} with rows in quarantine"
        faults = f", {self.internal_errors} internal errors" if self.internal_errors else ""
        return summary + faults + "".join(f"\n{c}" for c in self.complaints)


def judge(states: Iterable[Path], configuration: Configuration, judged: Iterable[str] = ()) -> QualityGate:
    """Judge the batches of all states.

    Complaints: a batch that cannot be read; an internal error; a unit without a result because of a fault of the
    machine; and, for the fleet or for one line with at least ``quarantine_units`` units, a share in quarantine above
    ``quarantine_share``.

    Parameters
    ----------
    states : iterable of Path
        State files of the shards.
    configuration : Configuration
        Configuration of the fleet: settings of the gate, lines of the turnouts.
    judged : iterable of str
        Batches that are not judged again.

    Returns
    -------
    QualityGate
        Numbers of units and complaints.
    """
    states, before, names = list(states), set(judged), []
    status, lines = {}, {}
    damaged: dict[Path, str] = {}
    for path in batch_paths(states):
        name = f"{path.parent.parent.name}/{path.parent.name}/{path.name}"
        names.append(name)
        for unit, turnout, unit_status in _read(path, damaged) if name not in before else ():
            status[unit] = unit_status
            row = configuration.rows.get(turnout)
            lines[unit] = str(row.values.get("line", "")) if row else ""
    again = "the next run computes its units again"
    complaints = [f"{path} cannot be read ({why}): {again}" for path, why in damaged.items()]
    of_units = [*_faults(status), *_shares(status, lines, configuration.settings["fleet"])]
    complaints += [*_waiting(states), *of_units]
    n_bad, n_fault = (sum(unit_status in group for unit_status in status.values()) for group in (IN_QUARANTINE, FAULTS))
    return QualityGate(len(status), n_bad, n_fault, tuple(complaints), tuple(names), bool(of_units), tuple(damaged))


def _faults(status: Mapping[str, str]) -> Iterator[str]:
    if faults := sorted(unit for unit, unit_status in status.items() if unit_status in FAULTS):
        first = f"{len(faults)} internal errors, first in {faults[0]}"
        yield f"{first}: query the quarantine table for reason_code 'internal_error', report it with the log"


def _waiting(states: Iterable[Path]) -> Iterator[str]:
    waiting: dict[str, str] = {}
    for state in states:
        waiting |= dict.fromkeys(sorted(started_units(state)), JOB_ENDED) | read_postponed(state)[1]
    if waiting:
        first = f"{len(waiting)} units wait for the next run, first {': '.join(next(iter(waiting.items())))}"
        yield f"{first}: look after the disk or the network they lie on, and the memory they take"


def _shares(status: Mapping[str, str], lines: Mapping[str, str], limits: FleetSettings) -> Iterator[str]:
    bad = [unit for unit, unit_status in status.items() if unit_status in IN_QUARANTINE]
    total, wrong = Counter(lines.values()), Counter(lines[unit] for unit in bad)
    groups = [("the fleet", len(status), len(bad))]
    groups += [(f"line {line!r}", total[line], wrong[line]) for line in sorted(total) if line and len(total) > 1]
    for name, n, n_bad in groups:
        if n >= limits.quarantine_units and n_bad > limits.quarantine_share * n:
            share = f"{n_bad} of {n} new units of {name} have rows in quarantine, {100 * n_bad / n:.0f} %"
            yield f"{share}, above the limit of {100 * limits.quarantine_share:.0f} %"


def _read(path: Path, damaged: dict[Path, str]) -> list[tuple]:
    """(unit, turnout, status) of a batch; one that cannot be read is entered in ``damaged``."""
    import pyarrow as pa

    try:
        return read_column(path, "unit", "turnout", "status")
    except (OSError, pa.ArrowException) as error:
        damaged[path] = str(error).splitlines()[0]
        return []


def check_quality(states: Iterable[Path], configuration: Configuration, output: Path) -> QualityGate:
    """Judge the batches that ``output`` does not name yet, and write it.

    Nights with too few units to be judged are added up. Bad units are judged again together with later ones, until
    there are enough newer units to be judged by themselves. Otherwise a small fleet would fail for months, until its
    bad units are a small share of all. A run over some turnouts keeps the state of the others.

    Parameters
    ----------
    states : iterable of Path
        State files of the shards.
    configuration : Configuration
        Configuration of the fleet: settings of the gate, lines of the turnouts.
    output : Path
        File of the judged batches.

    Returns
    -------
    QualityGate
        Numbers of units, without complaints.

    Raises
    ------
    TurnoutError
        If there are complaints; ``output`` is unchanged.
    """
    output, states, min_units = Path(output), list(states), configuration.settings["fleet"].quarantine_units
    doubts = output.with_name("doubts.json")  # not in the output, which Snakemake restores after a failed job
    judged, open_doubts = read_json(output, {"judged": []})["judged"], read_json(doubts, {"told": [], "doubted": []})
    reported, doubted = open_doubts["told"], open_doubts["doubted"]
    gate = newer = judge(states, configuration, [*judged, *reported, *doubted])
    if newer.units >= min_units:
        reported, doubted = [*reported, *doubted], []
    else:
        gate = judge(states, configuration, [*judged, *reported])
    for batch in gate.damaged:
        request_rerun(state_of(batch))
    if gate.complaints:
        again = (
            f"\n{REPEATED_COMPLAINT}: so far there are {newer.units} of {min_units}" if doubted and gate.unsound else ""
        )
        if gate.unsound:
            doubted = doubted or [name for name in gate.batches if name not in {*judged, *reported}]
            write_text(doubts, json.dumps({"told": reported, "doubted": doubted}, indent=1) + "\n")
        raise TurnoutError(f"the registry is up to date, but {gate}{again}")
    here = set(gate.batches)
    still_present = [name for name in [*judged, *reported] if name in here or (output.parent / name).exists()]
    named = list(dict.fromkeys([*still_present, *(gate.batches if gate.units >= min_units else ())]))
    content = {"units": gate.units, "quarantined": gate.quarantined, "judged": named}
    write_text(output, json.dumps(content, indent=1) + "\n")
    doubts.unlink(missing_ok=True)
    return gate
