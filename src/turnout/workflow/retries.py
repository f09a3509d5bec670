"""Keep track of started units, postponed units and job attempts, so that interrupted work is done again.

Started units: a mark file beside the state exists while a unit is computed. Marks that a job finds are from a job that
was ended during these units. The cause may be one of them, or a user, a time limit or a power failure. So it computes
them after all others, each in its own process. If that process dies while the job continues, the unit is the cause.
That does not hold in the run that first started the unit, whose jobs may share a lack of memory. A job that is ended as
a whole never blames a unit.

Postponed units have no result because of a fault of the machine. The number in their file is a parameter of the next
job, so that it runs again. A unit with files that the machine could not read in two runs gets quarantine rows, and is
tried again by every further run.

Attempts: Snakemake gives the old output of a failed job a new time and stores its parameters as if it had succeeded, so
nothing would run it again. The number of attempts is one of these parameters. It changes until the job has succeeded.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from turnout.files import changed_at, read_json, write_text
from turnout.workflow.state import batch_folder

MARK_PREFIX = "begun-"
# Complaint about a unit whose job ended while it was computed.
JOB_ENDED = "its job ended while it was computed"


def started_units(state: Path) -> dict[str, str]:
    """Units that were started and have not ended.

    The unit started last comes last, for it is the most probable cause; so the others are not delayed by it.

    Parameters
    ----------
    state : Path
        State file of the shard.

    Returns
    -------
    dict of str to str
        Unit -> run that first started it.
    """
    units = {}
    for mark in sorted(batch_folder(state).glob(f"{MARK_PREFIX}*"), key=changed_at):
        run, unit = _read_mark(mark)
        if mark == _mark_path(state, unit):  # else it is truncated: the unit was not started
            units[unit] = run
    return units


@contextmanager
def mark_started(state: Path, unit: str, run: str) -> Iterator[None]:
    """Mark a unit as started until the block ends, also by an exception; an existing complete mark keeps its run.

    The mark is not flushed to the disk: it is for a process that dies, not for a machine that does.

    Parameters
    ----------
    state : Path
        State file of the shard.
    unit : str
        Name of the unit.
    run : str
        Start time of the run, "" outside a run.
    """
    mark = _mark_path(state, unit)
    if _read_mark(mark)[1] != unit:
        mark.parent.mkdir(parents=True, exist_ok=True)
        mark.write_text(f"{run}\n{unit}", encoding="utf-8")
    else:
        os.utime(mark)
    try:
        yield
    finally:
        clear_mark(state, unit)


def clear_mark(state: Path, unit: str) -> None:
    """Remove the mark of a unit if there is one.

    Parameters
    ----------
    state : Path
        State file of the shard.
    unit : str
        Name of the unit.
    """
    _mark_path(state, unit).unlink(missing_ok=True)


def _read_mark(mark: Path) -> tuple[str, str]:
    """(run, unit) of a mark; empty texts as far as it is missing or truncated."""
    try:
        run, _, unit = mark.read_bytes().decode(errors="replace").partition("\n")
    except FileNotFoundError:  # its unit has ended meanwhile
        return "", ""
    return run, unit


def _mark_path(state: Path, unit: str) -> Path:
    return batch_folder(state) / f"{MARK_PREFIX}{hashlib.sha256(unit.encode()).hexdigest()[:16]}"


@dataclass(frozen=True)
class Postponed:
    """A unit without a result, and the ``fault`` of the machine that caused it."""

    unit: str
    fault: str


def read_postponed(state: Path) -> tuple[int, dict[str, str]]:
    """Postponed units of a shard, and the number of requested reruns.

    The number is a parameter of the job: a higher one makes it run again without a change of the plan.

    Parameters
    ----------
    state : Path
        State file of the shard.

    Returns
    -------
    tuple of (int, dict of str to str)
        Number of reruns; unit -> fault.
    """
    content = read_json(_postponed_path(state), {"jobs": 0, "units": {}})
    return content["jobs"], content["units"]


def read_retried(state: Path) -> dict[str, str]:
    """Units with quarantine rows about files that the machine cannot read; every run tries them again.

    Parameters
    ----------
    state : Path
        State file of the shard.

    Returns
    -------
    dict of str to str
        Unit -> fault.
    """
    return read_json(_postponed_path(state), {}).get("retried", {})


def first_postponed(state: Path) -> dict[str, str]:
    """The run that first postponed each postponed or retried unit.

    Parameters
    ----------
    state : Path
        State file of the shard.

    Returns
    -------
    dict of str to str
        Unit -> start time of the run, "" outside a run.
    """
    content = read_json(_postponed_path(state), {})
    units = (*content.get("units", ()), *content.get("retried", ()))
    return {unit: content.get("runs", {}).get(unit, "") for unit in units}


def note_postponed(
    state: Path, units: Mapping[str, str], run: str = "", retried: Mapping[str, str] | None = None
) -> None:
    """Write the postponed and retried units of a shard; no file if there are none and were none before.

    Parameters
    ----------
    state : Path
        State file of the shard.
    units : mapping of str to str
        Unit -> fault.
    run : str
        Start time of the run, "" outside a run; a unit that was postponed before keeps its run.
    retried : mapping of str to str or None
        Unit with quarantine rows -> fault; None: none.
    """
    jobs, before = read_postponed(state)
    retried = retried or {}
    named = {**units, **retried}
    if named or before or read_retried(state):
        runs = dict.fromkeys(named, run) | {u: r for u, r in first_postponed(state).items() if u in named}
        _write(state, jobs + bool(named), units, runs, retried)


def request_rerun(state: Path) -> None:
    """Make the job of a shard run again without postponed units, for instance because a batch is damaged.

    Parameters
    ----------
    state : Path
        State file of the shard.
    """
    jobs, units = read_postponed(state)
    _write(state, jobs + 1, units, first_postponed(state), read_retried(state))


def _write(
    state: Path, jobs: int, units: Mapping[str, str], runs: Mapping[str, str], retried: Mapping[str, str]
) -> None:
    content: dict[str, Any] = {"jobs": jobs, "units": dict(units), "runs": dict(runs)}
    if retried:  # an earlier version of the program does not know it
        content["retried"] = dict(retried)
    write_text(_postponed_path(state), json.dumps(content, indent=1) + "\n")


def _postponed_path(state: Path) -> Path:
    return batch_folder(state) / "postponed.json"


ATTEMPTS_FOLDER = Path("work/attempts")


def attempts(job: str) -> int:
    """Number of unfinished attempts of ``job``; -1, a new value, where the file is truncated.

    Parameters
    ----------
    job : str
        Name of the job.

    Returns
    -------
    int
        0 if the job has not failed.
    """
    try:
        return int((ATTEMPTS_FOLDER / job).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return 0
    except ValueError:
        return -1


@contextmanager
def attempt(job: str, before: int) -> Iterator[None]:
    """Count one more attempt than ``before`` until the block ends without an exception.

    Parameters
    ----------
    job : str
        Name of the job.
    before : int
        Number of unfinished attempts so far.
    """
    write_text(ATTEMPTS_FOLDER / job, str(before + 1))
    yield
    write_text(ATTEMPTS_FOLDER / job, str(before))
