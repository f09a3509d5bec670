"""Input data of one turnout: hammer tests, train passages, sensors and the nominal model they are compared with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from turnout.config.settings.receptance import ReceptanceSettings
from turnout.errors import SimulationError
from turnout.hammer_test import find_impacts
from turnout.mismatch.turnout.priors import TRACK
from turnout.records import Impact, Recording
from turnout.simulate.sensor import Sensor
from turnout.simulate.turnout_track import TurnoutTrack
from turnout.simulate.vehicle import Vehicle


@dataclass(frozen=True)
class HammerInput:
    """A hammer test at the position ``place`` [m].

    ``force`` names the channel of the hammer; every channel of acceleration is a response. ``conditions`` hold values
    such as ``rail_temperature`` [°C]. ``impact_settings`` control how impacts are detected and checked; None: the
    defaults.
    """

    name: str
    place: float
    recordings: tuple[Recording, ...]
    force: str = "hammer"
    visit: str = ""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    impact_settings: ReceptanceSettings | None = None

    def accepted_impacts(self, response: str) -> list[Impact]:
        """Accepted impacts of the recordings that have the channel ``response``; none where no recording has it.

        Parameters
        ----------
        response : str
            Name of a channel of acceleration.

        Returns
        -------
        list of Impact
            In the order of the recordings.
        """
        return [i for i in self.impacts(response) if i.accepted]

    def impacts(self, response: str) -> Sequence[Impact]:
        """All impacts of the recordings that have the channel ``response``, also rejected ones.

        Parameters
        ----------
        response : str
            Name of a channel of acceleration.

        Returns
        -------
        sequence of Impact
            In the order of the recordings.
        """
        recordings = [r for r in self.recordings if response in [c.name for c in r.channels]]
        return find_impacts(recordings, self.force, response, self.impact_settings)


@dataclass(frozen=True)
class PassageInput:
    """One train passage.

    ``vehicle`` is a model of ``turnout.simulate``, ``speed`` [m/s] the recorded speed, ``train`` its type or number.
    ``load_sd`` is the standard deviation of the sprung mass, as a share of the mass of the vehicle.
    """

    name: str
    recording: Recording
    vehicle: Vehicle
    speed: float
    train: str = ""
    direction: str = "facing"
    route: str = "main"
    conditions: Mapping[str, Any] = field(default_factory=dict)
    load_sd: float = TRACK.load_sd


@dataclass(frozen=True)
class CampaignInput:
    """``turnout`` is a TurnoutTrack; ``sensors`` have names, positions and mountings.

    ``reserved`` names the tests and passages that no fit reads. They may confirm a named effect or withdraw it.
    ``contradicted_trains`` has the train of each passage that was left out, as its axles contradict the vehicle file.
    """

    turnout: TurnoutTrack
    sensors: tuple[Sensor, ...]
    hammer: tuple[HammerInput, ...] = ()
    passages: tuple[PassageInput, ...] = ()
    reserved: tuple[str, ...] = ()
    contradicted_trains: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.hammer and not self.passages:
            raise SimulationError("nothing to diagnose: neither a hammer test nor a passage was given.")
        names = [test.name for test in self.hammer] + [passage.name for passage in self.passages]
        if len(set(names)) < len(names):
            twice = next(n for n in names if names.count(n) > 1)
            raise SimulationError(f"the name {twice!r} stands for two recordings; give each its own.")
        lengths: dict[str, int] = {}
        for p in self.passages:
            n = len(p.vehicle.wheels)
            if p.train and lengths.setdefault(p.train, n) != n:
                message = f"train {p.train!r} has {lengths[p.train]} and {n} wheels"
                raise SimulationError(
                    f"{message}: wheels are counted from the front, give each length a name of its own."
                )
        for name in self.reserved:
            if name not in names:
                raise SimulationError(f"reserved {name!r} is no recording; there are {', '.join(names)}.")

    def with_recordings(self, recording_type: str, change: Callable[[Recording], Recording]) -> CampaignInput:
        """The campaign with all recordings of one type changed.

        Parameters
        ----------
        recording_type : str
            "passages" or "hammer tests".
        change : callable
            Recording -> recording in its place.

        Returns
        -------
        CampaignInput
        """
        if recording_type == "passages":
            return replace(self, passages=tuple(replace(p, recording=change(p.recording)) for p in self.passages))
        tests = (replace(t, recordings=tuple(map(change, t.recordings))) for t in self.hammer)
        return replace(self, hammer=tuple(tests))

    def sensors_of(self, passage: PassageInput) -> tuple[Sensor, ...]:
        """The sensors that recorded a passage.

        Parameters
        ----------
        passage : PassageInput
            A train passage.

        Returns
        -------
        tuple[Sensor, ...]
        """
        names = {c.name for c in passage.recording.channels}
        return tuple(s for s in self.sensors if s.name in names)

    def positions(self) -> list[float]:
        """Positions of sensors and impacts [m]."""
        return [s.place for s in self.sensors] + [t.place for t in self.hammer]
