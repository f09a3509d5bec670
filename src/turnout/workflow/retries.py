"""Units that are being computed: a note beside the state from the moment one is begun until it has come to its end.

A job that finds notes follows one that was ended in the midst of these units. Which of them ended it, or whether all
are innocent of what a user, a time limit or a power failure did, nobody knows: it computes them after all others, each
in a process of its own. Where that dies while the job lives on, and not in the run that had begun it first (whose jobs
may all have met the same shortage), the unit is what it died of. A job that is ended as a whole condemns no unit,
however often.

Units that met a fault of the machine have no result; the file that notes them asks for the shard's next job.

A job that was begun and did not come to its end is asked for again.

Snakemake gives the old output of a failed job the time of now and notes its parameters as if it had been made: nothing
would run it again. The number of this file is one of those parameters; it is another one until the job has ended.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from turnout.files import read_json, write_text
from turnout.workflow.state import batch_folder

PREFIX = "begun-"
# What the verdict says of a unit that such a job left.
LEFT = "its job ended while it was computed"


def begun(state: Path) -> dict[str, str]:
    """Units that were begun and have not ended, and the run that began each first; ``state`` is their shard's file.

    That which was begun last is the last: who ends every job keeps none waiting that was only begun beside it.
    """
    found = {}
    for note in sorted(batch_folder(state).glob(f"{PREFIX}*"), key=_changed_at):
        run, unit = _said(note)
        if note == _note(state, unit):  # else it is cut: the unit was not even begun
            found[unit] = run
    return found


@contextmanager
def noted(state: Path, unit: str, run: str) -> Iterator[None]:
    """Note a unit until the block has come to its end, by an exception, too; a whole note that is there keeps its run.

    The note is not flushed to the disk: it tells of a process that died, not of a machine that did.
    """
    note = _note(state, unit)
    if _said(note)[1] != unit:
        note.parent.mkdir(parents=True, exist_ok=True)
        note.write_text(f"{run}\n{unit}", encoding="utf-8")
    else:
        os.utime(note)
    try:
        yield
    finally:
        forget(state, unit)


def forget(state: Path, unit: str) -> None:
    """Take the note of a unit away, where there is one."""
    _note(state, unit).unlink(missing_ok=True)


def _said(note: Path) -> tuple[str, str]:
    """(run, unit) of a note, as far as it is there and whole."""
    try:
        run, _, unit = note.read_bytes().decode(errors="replace").partition("\n")
    except FileNotFoundError:  # its unit has ended meanwhile
        return "", ""
    return run, unit


def _changed_at(note: Path) -> int:
    try:
        return note.stat().st_mtime_ns
    except FileNotFoundError:
        return 0


def _note(state: Path, unit: str) -> Path:
    return batch_folder(state) / f"{PREFIX}{hashlib.sha256(unit.encode()).hexdigest()[:16]}"


@dataclass(frozen=True)
class Postponed:
    """A unit, and the fault that it ``met``."""

    unit: str
    met: str


def read_postponed(state: Path) -> tuple[int, dict[str, str]]:
    """(how often the next job of a shard was asked for, {unit: what it met}); ``state`` is its state file.

    The number is a parameter of that job: one more makes it run again, though no plan has changed.
    """
    content = read_json(_path(state), {"jobs": 0, "units": {}})
    return content["jobs"], content["units"]


def note_postponed(state: Path, units: Mapping[str, str]) -> None:
    """Note the ``units`` that the job of a shard leaves; without any, and none before, there is no file."""
    jobs, before = read_postponed(state)
    if units or before:
        _write(state, jobs + bool(units), units)


def ask_again(state: Path) -> None:
    """Let the job of a shard run again, though no unit of it was left: one of its batches is damaged."""
    jobs, units = read_postponed(state)
    _write(state, jobs + 1, units)


def _write(state: Path, jobs: int, units: Mapping[str, str]) -> None:
    write_text(_path(state), json.dumps({"jobs": jobs, "units": dict(units)}, indent=1) + "\n")


def _path(state: Path) -> Path:
    return batch_folder(state) / "postponed.json"


FOLDER = Path("work/attempts")


def attempts(job: str) -> int:
    """How often ``job`` was begun without coming to its end; a number it never was where the file is cut."""
    try:
        return int((FOLDER / job).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return 0
    except ValueError:
        return -1


@contextmanager
def attempt(job: str, before: int) -> Iterator[None]:
    """One more attempt until the block has come to its end without an exception; ``before`` it was begun so often."""
    write_text(FOLDER / job, str(before + 1))
    yield
    write_text(FOLDER / job, str(before))
