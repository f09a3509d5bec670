"""Units that are being computed: a note beside the state from the moment one is begun until it has come to its end.

A job that finds notes follows one that was ended in the midst of these units. Which of them ended it, or whether all
are innocent of what a user, a time limit or a power failure did, nobody knows: it computes them after all others, each
in a process of its own. Where that dies while the job lives on, and not in the run that had begun it first (whose jobs
may all have met the same shortage), the unit is what it died of. A job that is ended as a whole condemns no unit,
however often.
"""

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from turnout.fleet.state import batch_folder

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
