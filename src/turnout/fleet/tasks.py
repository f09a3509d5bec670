"""What a shard has to compute: units that are new, and those of which anything changed that they are computed from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from turnout.config import Configuration, TurnoutConfig, with_raw
from turnout.errors import ConfigError
from turnout.fleet.copies import Original, originals_of
from turnout.fleet.keys import contents_of, key_of, short, stamp_of
from turnout.fleet.plan import Planned
from turnout.fleet.scan import unit_id
from turnout.fleet.stage import Stage, Token, named, with_token
from turnout.fleet.state import State


@dataclass(frozen=True)
class Task:
    """A unit to compute and what that takes; of its files those ``copied`` are left out, for they count elsewhere."""

    planned: Planned
    turnout: TurnoutConfig
    stamp: str
    context: object = None
    copied: Mapping[str, Original] = field(default_factory=dict)


class Tasks:
    """Compares a plan with the state of its shard; each turnout's configuration is read once, and when it is needed."""

    def __init__(self, state: State, stage: Stage, configuration: Configuration, raw_root: Path):
        self.state, self.stage, self.configuration, self.raw_root = state, stage, configuration, raw_root
        self._contexts: dict[str, tuple[Token, object]] = {}
        self._turnouts: dict[str, TurnoutConfig | None] = {}

    def due(self, wanted: Mapping[str, Planned], only: Sequence[str] | None) -> tuple[list[Task], int]:
        """Tasks of all units to compute, sorted; and how many units wait for a plan."""
        due, stale = [], 0
        for name in sorted(wanted):
            if only is not None and wanted[name].unit.turnout not in only:
                continue
            if self.is_known(name, wanted) and self._still_a_copy(name, wanted):
                continue
            task = self.task(wanted[name])
            if task is None:
                stale += 1
            elif not self._same_content(task):
                due.append(task)
        return due, stale

    def task(self, planned: Planned) -> Task | None:
        """The task of one unit; None where the configuration is not the one of the plan any more."""
        unit = planned.unit
        turnout = self._turnout(unit.turnout)
        if turnout is None or turnout.hashes[unit.kind] != unit.config_hash:
            return None
        token, value = self._context(unit.turnout)
        planned = with_token(planned, token)
        return Task(planned, turnout, stamp_of(planned), value)

    def is_known(self, name: str, wanted: Mapping[str, Planned]) -> bool:
        """Whether the state holds the result of the unit as it is planned now."""
        known = self.state.units.get(name)
        return known is not None and (known.stamp, known.algo) == (self._stamp(wanted[name]), self.stage.algo)

    def _stamp(self, planned: Planned) -> str:
        return stamp_of(with_token(planned, self._context(planned.unit.turnout)[0]))

    def _still_a_copy(self, name: str, wanted: Mapping[str, Planned]) -> bool:
        """True for what holds no copies, and where their originals are as they were."""
        return all(o in wanted and self.is_known(o, wanted) for o in originals_of(self.state.units[name]))

    def _context(self, turnout: str) -> tuple[Token, object]:
        if turnout not in self._contexts:
            self._contexts[turnout] = self._asked(turnout)
        return self._contexts[turnout]

    def _asked(self, turnout: str) -> tuple[Token, object]:
        if not self.stage.context:
            return "", None
        try:
            settings = self.configuration.turnout(turnout).settings
        except ConfigError:  # its units wait for a plan
            return "", None
        return named(self.stage.context)(turnout, settings)

    def _turnout(self, turnout: str) -> TurnoutConfig | None:
        """Configuration with the notes of the raw folder; None for a turnout that has none any more."""
        if turnout not in self._turnouts:
            try:
                self._turnouts[turnout] = with_raw(self.configuration.turnout(turnout), self.raw_root)
            except ConfigError:
                self._turnouts[turnout] = None
        return self._turnouts[turnout]

    def _same_content(self, task: Task) -> bool:
        """Whether only times changed; the state then notes the new ones."""
        name = unit_id(task.planned.unit)
        known = self.state.units.get(name)
        if known is None or known.algo != self.stage.algo:
            return False
        try:
            contents = contents_of(task.planned, self.raw_root)
        except OSError:  # met again, and told, when it is computed
            return False
        if same := known.key == key_of(task.planned, contents):
            self.state.units[name] = replace(known, stamp=task.stamp, contents=short(contents))
        return same
