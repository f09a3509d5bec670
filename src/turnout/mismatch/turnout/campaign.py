"""What was measured at one turnout, and the models it is held against."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.errors import SimulationError
from turnout.records import Recording
from turnout.simulate.sensor import Sensor

LOAD_SD = 0.05  # of all that is sprung, where its load was measured or noted


@dataclass(frozen=True)
class HammerTest:
    """Blows at one place [m]: ``force`` is the hammer's channel, all accelerations are responses. ``conditions``
    such as rail_temperature [°C]; ``judged`` says how its blows are found and judged, by default as everywhere."""

    name: str
    place: float
    recordings: tuple[Recording, ...]
    force: str = "hammer"
    visit: str = ""
    conditions: Mapping = field(default_factory=dict)
    judged: ReceptanceSettings | None = None


@dataclass(frozen=True)
class Passage:
    """One train: ``vehicle`` of ``turnout.simulate``, ``speed`` [m/s] as noted, ``train`` its type or number;
    ``load_sd`` is the standard deviation of its sprung mass, as a share of the vehicle's."""

    name: str
    recording: Recording
    vehicle: object
    speed: float
    train: str = ""
    direction: str = "facing"
    route: str = "main"
    conditions: Mapping = field(default_factory=dict)
    load_sd: float = LOAD_SD


@dataclass(frozen=True)
class Campaign:
    """``turnout`` a TurnoutTrack; ``sensors`` by name with place and mounting; ``reserved`` names of tests and
    passages that no fit reads: they may withdraw a name, and verify it."""

    turnout: object
    sensors: tuple[Sensor, ...]
    hammer: tuple[HammerTest, ...] = ()
    passages: tuple[Passage, ...] = ()
    reserved: tuple[str, ...] = ()

    def __post_init__(self):
        if not self.hammer and not self.passages:
            raise SimulationError("nothing to diagnose: neither a hammer test nor a passage was given.")
        names = [item.name for item in (*self.hammer, *self.passages)]
        if len(set(names)) < len(names):
            twice = next(n for n in names if names.count(n) > 1)
            raise SimulationError(f"the name {twice!r} stands for two recordings; give each its own.")
        lengths: dict[str, int] = {}
        for p in self.passages:
            n = len(p.vehicle.wheels)
            if p.train and lengths.setdefault(p.train, n) != n:
                said = f"train {p.train!r} has {lengths[p.train]} and {n} wheels"
                raise SimulationError(f"{said}: wheels are counted from the front, give each length a name of its own.")
        for name in self.reserved:
            if name not in names:
                raise SimulationError(f"reserved {name!r} is no recording; there are {', '.join(names)}.")

    def sensors_of(self, passage):
        """The sensors that recorded a passage."""
        names = {c.name for c in passage.recording.channels}
        return tuple(s for s in self.sensors if s.name in names)

    def places(self):
        """Places of sensors and blows [m]."""
        return [s.place for s in self.sensors] + [t.place for t in self.hammer]
