"""Units that met a fault of the machine have no result; the file that notes them asks for the shard's next job."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from turnout.files import read_json, write_text
from turnout.fleet.state import batch_folder


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
