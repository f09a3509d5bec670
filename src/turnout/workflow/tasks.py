"""Find the units of a shard to compute: new ones, and those whose inputs or code have changed.

A change is first looked for in names, sizes and times of files, then confirmed by their content. ``Stage`` describes
the computation: its function, the version of its code, and what it uses of other stages.
"""

import os
import sys
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from turnout.config import Configuration, TurnoutConfig, with_raw
from turnout.config.merge import digest
from turnout.content import sha256_of
from turnout.errors import ConfigError
from turnout.files import special_kind
from turnout.records import Unit
from turnout.workflow.duplicate_files import Original, originals_of
from turnout.workflow.plan import PlannedUnit
from turnout.workflow.scan import unit_id
from turnout.workflow.state import ELSEWHERE_MARK, State


def stamp_of(planned: PlannedUnit) -> str:
    """Digest of configuration, notes, and name, size and time of each file; no file is opened.

    Parameters
    ----------
    planned : PlannedUnit
        The unit with its notes.

    Returns
    -------
    str
        32 hexadecimal digits.
    """
    unit = planned.unit
    return digest([unit.config_hash, planned.note, unit.files])


def contents_of(planned: PlannedUnit, raw_root: Path) -> list[str | None]:
    """Hashes of the files of a unit.

    Parameters
    ----------
    planned : PlannedUnit
        The unit with its notes.
    raw_root : Path
        The raw root.

    Returns
    -------
    list of str or None
        sha256 of each file in the order of the unit, None for a missing one.

    Raises
    ------
    OSError
        If a file cannot be read.
    """
    return [_content(os.path.join(raw_root, path)) for path, *_ in planned.unit.files]


def file_states(planned: PlannedUnit, raw_root: Path) -> list[tuple[int, int, int] | None]:
    """Size, time of change and number of each file of a unit: another list says that a file was replaced or written.

    Parameters
    ----------
    planned : PlannedUnit
        The unit with its notes.
    raw_root : Path
        The raw root.

    Returns
    -------
    list of tuple of (int, int, int) or None
        None for a file that is gone or whose folder cannot be read.
    """
    states: list[tuple[int, int, int] | None] = []
    for path, *_ in planned.unit.files:
        try:
            status = os.stat(os.path.join(raw_root, path))
        except OSError:
            states.append(None)
        else:
            states.append((status.st_size, status.st_mtime_ns, status.st_ino))
    return states


def readable_contents(planned: PlannedUnit, raw_root: Path) -> tuple[list[str | None], dict[str, str]]:
    """Hashes of the files of a unit as far as they can be read, and the faults of the others.

    Parameters
    ----------
    planned : PlannedUnit
        The unit with its notes.
    raw_root : Path
        The raw root.

    Returns
    -------
    tuple of (list of str or None, dict of str to str)
        sha256 of each file, None for a missing or unreadable one; path -> fault of each unreadable one.
    """
    contents: list[str | None] = []
    faults: dict[str, str] = {}
    for path, *_ in planned.unit.files:
        try:
            contents.append(_content(os.path.join(raw_root, path)))
        except OSError as error:
            contents.append(None)
            faults[path] = f"{type(error).__name__}: [Errno {error.errno}] {error.strerror}"
    return contents, faults


def key_of(planned: PlannedUnit, contents: Sequence[str | None]) -> str:
    """Digest of configuration, notes, and name and content of each file.

    Parameters
    ----------
    planned : PlannedUnit
        The unit with its notes.
    contents : sequence of str or None
        sha256 of each file, None for a missing one.

    Returns
    -------
    str
        32 hexadecimal digits.
    """
    unit = planned.unit
    files = [[path, content] for (path, *_), content in zip(unit.files, contents, strict=True)]
    return digest([unit.config_hash, planned.note, files])


def short_contents(contents: Sequence[str | None], elsewhere: Container[int] = ()) -> str:
    """Text of the contents for a state: the first 16 digits of each hash.

    Parameters
    ----------
    contents : sequence of str or None
        sha256 of each file, None for a missing one.
    elsewhere : container of int
        Indices of files that count in other units.

    Returns
    -------
    str
        The text; "" if a file is missing.

    Examples
    --------
    >>> short_contents(["e3b0c44298fc1c149afbf4c8996fb924", "0123456789abcdef0123456789abcdef"], {1})
    'e3b0c44298fc1c14 -0123456789abcdef'
    """
    marks = [ELSEWHERE_MARK if k in elsewhere else "" for k in range(len(contents))]
    return " ".join(mark + c[:16] for mark, c in zip(marks, contents) if c) if all(contents) else ""


def _content(path: str) -> str | None:
    """sha256 of a file; None if it is gone or was replaced by something that is no regular file."""
    try:
        return None if special_kind(os.stat(path).st_mode) else sha256_of(path)
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return None


Token = str | Callable[[Unit], str]


@dataclass(frozen=True)
class Stage:
    """A stage computes units of ``kind`` by ``compute(unit, turnout, raw_root, algo=...)``.

    ``algo`` is the version of its code, part of every key. ``context(turnout_id, settings)``, if given, returns (token,
    value). The token is text, or a function of the unit that returns text; that text is part of the key. The value is
    passed to ``compute`` as ``context=``. ``settings`` are those of the turnout, by part. ``gather(plan,
    configuration)``, if given, makes the units of the stage from a plan file; otherwise they are those of the plan. All
    three may be names, "package.module:function", which are imported when there is something to compute.
    """

    kind: str
    compute: Callable | str
    algo: str
    context: Callable[[str, Mapping], tuple[Token, Any]] | str | None = None
    gather: Callable[[Path, Configuration], Iterable[PlannedUnit]] | str | None = None


def load_function(function: Callable | str) -> Callable:
    """Function from its name; a user's own module must be in the folder of the run.

    Parameters
    ----------
    function : callable or str
        "package.module:name", or the function itself.

    Returns
    -------
    callable
        The function.

    Raises
    ------
    ImportError
        If there is no such module.
    """
    if callable(function):
        return function
    module, _, name = function.partition(":")
    if module.partition(".")[0] != "turnout" and os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    return getattr(import_module(module), name)


def with_token(planned: PlannedUnit, token: Token) -> PlannedUnit:
    """The planned unit, with the token of the stage's context appended to its note.

    Parameters
    ----------
    planned : PlannedUnit
        The unit with its notes.
    token : str or callable
        Text, or function of the unit that returns text.

    Returns
    -------
    PlannedUnit
        A copy with the longer note.
    """
    return replace(planned, note=planned.note + (token if isinstance(token, str) else token(planned.unit)))


@dataclass(frozen=True)
class Task:
    """A unit to compute with its inputs; files in ``copied`` are excluded, because they count in other units."""

    planned: PlannedUnit
    turnout: TurnoutConfig
    stamp: str
    context: Any = None  # what the function ``context`` of its stage returns for the turnout
    copied: Mapping[str, Original] = field(default_factory=dict)


class Tasks:
    """Compares a plan with the state of its shard; the configuration of each turnout is read once, when needed.

    Parameters
    ----------
    state : State
        State of the shard; stamps of unchanged units are brought up to date in it.
    stage : Stage
        The computation.
    configuration : Configuration
        Configuration of the fleet.
    raw_root : Path
        The raw root.
    """

    def __init__(self, state: State, stage: Stage, configuration: Configuration, raw_root: Path) -> None:
        self.state, self.stage, self.configuration, self.raw_root = state, stage, configuration, raw_root
        self._contexts: dict[str, tuple[Token, Any]] = {}
        self._turnouts: dict[str, TurnoutConfig | None] = {}

    def due(self, wanted: Mapping[str, PlannedUnit], only: Sequence[str] | None) -> tuple[list[Task], int]:
        """Find all units to compute.

        Parameters
        ----------
        wanted : mapping of str to PlannedUnit
            Unit -> planned unit.
        only : sequence of str or None
            Only units of these turnouts; None: all.

        Returns
        -------
        tuple of (list of Task, int)
            Tasks sorted by unit, and the number of units that wait for a new plan.
        """
        due, stale = [], 0
        for name in sorted(wanted):
            if only is not None and wanted[name].unit.turnout not in only:
                continue
            if self.is_known(name, wanted) and self._has_same_originals(name, wanted):
                continue
            task = self.task(wanted[name])
            if task is None:
                stale += 1
            elif not self._has_same_content(task):
                due.append(task)
        return due, stale

    def task(self, planned: PlannedUnit) -> Task | None:
        """The task of one unit.

        Parameters
        ----------
        planned : PlannedUnit
            The unit with its notes.

        Returns
        -------
        Task or None
            The task; None if the configuration has changed since the plan.
        """
        unit = planned.unit
        turnout = self._turnout(unit.turnout)
        if turnout is None or turnout.hashes[unit.kind] != unit.config_hash:
            return None
        token, value = self._context(unit.turnout)
        planned = with_token(planned, token)
        return Task(planned, turnout, stamp_of(planned), value)

    def is_known(self, name: str, wanted: Mapping[str, PlannedUnit]) -> bool:
        """Whether the state has the result of the unit as it is planned now.

        Parameters
        ----------
        name : str
            The unit.
        wanted : mapping of str to PlannedUnit
            Unit -> planned unit.

        Returns
        -------
        bool
            False if its stamp or the version of the code differs.
        """
        entry = self.state.units.get(name)
        return entry is not None and (entry.stamp, entry.algo) == (self._stamp(wanted[name]), self.stage.algo)

    def _stamp(self, planned: PlannedUnit) -> str:
        return stamp_of(with_token(planned, self._context(planned.unit.turnout)[0]))

    def _has_same_originals(self, name: str, wanted: Mapping[str, PlannedUnit]) -> bool:
        """True for a unit without copies, and for one whose originals have not changed."""
        return all(o in wanted and self.is_known(o, wanted) for o in originals_of(self.state.units[name]))

    def _context(self, turnout: str) -> tuple[Token, Any]:
        if turnout not in self._contexts:
            self._contexts[turnout] = self._compute_context(turnout)
        return self._contexts[turnout]

    def _compute_context(self, turnout: str) -> tuple[Token, Any]:
        if not self.stage.context:
            return "", None
        try:
            settings = self.configuration.turnout(turnout).settings
        except ConfigError:  # its units wait for a plan
            return "", None
        return load_function(self.stage.context)(turnout, settings)

    def _turnout(self, turnout: str) -> TurnoutConfig | None:
        """Configuration with the notes of the raw folder; None for a turnout that is no longer configured."""
        if turnout not in self._turnouts:
            try:
                self._turnouts[turnout] = with_raw(self.configuration.turnout(turnout), self.raw_root)
            except ConfigError:
                self._turnouts[turnout] = None
        return self._turnouts[turnout]

    def _has_same_content(self, task: Task) -> bool:
        """Whether only file times changed; the state then gets the new stamp."""
        name = unit_id(task.planned.unit)
        entry = self.state.units.get(name)
        if entry is None or entry.algo != self.stage.algo:
            return False
        try:
            contents = contents_of(task.planned, self.raw_root)
        except OSError:  # reported when the unit is computed
            return False
        if same := entry.key == key_of(task.planned, contents):
            stamp = task.stamp if all(contents) else ""
            self.state.units[name] = replace(entry, stamp=stamp, contents=short_contents(contents))
        return same
