"""Whether the results that came since the last sound run may be trusted: the breaker, after the registry is out."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from turnout.config import Configuration
from turnout.config.settings.fleet import FleetSettings
from turnout.errors import TurnoutError
from turnout.fleet.atomic import read_json, write_text
from turnout.fleet.batches import read_column
from turnout.fleet.postponed import ask_again, read_postponed
from turnout.fleet.state import batch_paths, state_of

IN_QUARANTINE, FAULTS = ("partly", "quarantined"), ("internal_error",)


@dataclass(frozen=True)
class Verdict:
    """Units that are new since they were last judged; ``complaints`` is empty for a sound run, ``batches`` are all
    that the states name, ``damaged`` those that cannot be read."""

    units: int
    quarantined: int
    internal_errors: int
    complaints: tuple[str, ...]
    batches: tuple[str, ...]
    damaged: tuple[Path, ...] = ()

    def __str__(self):
        said = f"{self.units} units computed, {self.quarantined} with rows in quarantine"
        faults = f", {self.internal_errors} internal errors" if self.internal_errors else ""
        return said + faults + "".join(f"\n{c}" for c in self.complaints)


def judge(states: Iterable[Path], configuration: Configuration, judged: Iterable[str] = ()) -> Verdict:
    """Judge all batches that ``states`` name, those ``judged`` before left out.

    Complaints: a batch that cannot be read; an internal error; a unit that the machine failed; and over the fleet or
    over one line a share of units in quarantine above ``quarantine_share``, where there are ``quarantine_units``.
    """
    states, before, names = list(states), set(judged), []
    status, lines = {}, {}
    damaged: dict[Path, str] = {}
    for path in batch_paths(states):
        name = f"{path.parent.parent.name}/{path.parent.name}/{path.name}"
        names.append(name)
        for unit, turnout, found in _read(path, damaged) if name not in before else ():
            status[unit] = found
            row = configuration.rows.get(turnout)
            lines[unit] = str(row.values.get("line", "")) if row else ""
    again = "the next run computes its units again"
    complaints = [f"{path} cannot be read ({why}): {again}" for path, why in damaged.items()]
    complaints += [*_faults(status), *_waiting(states), *_shares(status, lines, configuration.settings["fleet"])]
    n_bad, n_fault = (sum(found in of for found in status.values()) for of in (IN_QUARANTINE, FAULTS))
    return Verdict(len(status), n_bad, n_fault, tuple(complaints), tuple(names), tuple(damaged))


def _faults(status: Mapping[str, str]) -> Iterator[str]:
    if faults := sorted(unit for unit, found in status.items() if found in FAULTS):
        first = f"{len(faults)} internal errors, first in {faults[0]}"
        yield f"{first}: query the quarantine table for reason_code 'internal_error', report it with the log"


def _waiting(states: Iterable[Path]) -> Iterator[str]:
    if postponed := [met for state in states for met in read_postponed(state)[1].items()]:
        first = f"{len(postponed)} units wait for the next run, first {': '.join(postponed[0])}"
        yield f"{first}: look after the disk or the network they lie on"


def _shares(status: Mapping[str, str], lines: Mapping[str, str], limits: FleetSettings) -> Iterator[str]:
    bad = [unit for unit, found in status.items() if found in IN_QUARANTINE]
    total, wrong = Counter(lines.values()), Counter(lines[unit] for unit in bad)
    groups = [("the fleet", len(status), len(bad))]
    groups += [(f"line {line!r}", total[line], wrong[line]) for line in sorted(total) if line and len(total) > 1]
    for name, n, n_bad in groups:
        if n >= limits.quarantine_units and n_bad > limits.quarantine_share * n:
            share = f"{n_bad} of {n} new units of {name} have rows in quarantine, {100 * n_bad / n:.0f} %"
            yield f"{share}, above the limit of {100 * limits.quarantine_share:.0f} %"


def _read(path: Path, damaged: dict[Path, str]) -> list[tuple]:
    """(unit, turnout, status) of a batch; one that cannot be read is noted in ``damaged``."""
    import pyarrow as pa

    try:
        return read_column(path, "unit", "turnout", "status")
    except (OSError, pa.ArrowException) as error:
        damaged[path] = str(error).splitlines()[0]
        return []


def verdict(states: Iterable[Path], configuration: Configuration, output: Path) -> Verdict:
    """Judge what ``output`` does not name yet, and write it; TurnoutError, nothing written, if unsound.

    Nights with too few units to be judged add up. A run over some turnouts forgets nothing of the others.
    """
    output = Path(output)
    judged = read_json(output, {"judged": []})["judged"]
    found = judge(states, configuration, judged)
    for batch in found.damaged:
        ask_again(state_of(batch))
    if found.complaints:
        raise TurnoutError(f"the registry is up to date, but {found}")
    here = set(found.batches)
    kept = [name for name in judged if name in here or (output.parent / name).exists()]
    enough = found.units >= configuration.settings["fleet"].quarantine_units
    named = list(dict.fromkeys([*kept, *(found.batches if enough else ())]))
    content = {"units": found.units, "quarantined": found.quarantined, "judged": named}
    write_text(output, json.dumps(content, indent=1) + "\n")
    return found
