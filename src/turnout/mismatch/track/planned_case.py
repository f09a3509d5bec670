"""A planned campaign as a case: its data are what the base model predicts, its sigma what such recordings have."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.track import bands, blows, roll, rolling
from turnout.mismatch.track.campaign import LOAD_SD
from turnout.mismatch.track.library import library
from turnout.mismatch.track.rough_wheels import wheel_modes
from turnout.mismatch.track.track_case import TrackCase

NOISE = 0.02  # of a sensor over its own rms


@dataclass(frozen=True)
class Planned:
    """A passage or test that has not taken place."""

    name: str
    vehicle: object = None
    speed: float = 0.0
    train: str = ""
    direction: str = "facing"
    route: str = "main"
    conditions: object = None
    place: float = 0.0
    visit: str = ""
    load_sd: float = LOAD_SD


class PlannedCase(TrackCase):
    """``TrackCase`` of a ``Plan`` of ``turnout.mismatch.track.planned``; nothing is measured, nothing is fitted."""

    def __init__(self, plan, settings=None, families=None, solver=None):
        self.plan = plan
        self._prepare(_Intended(plan), settings or MismatchSettings(), solver or roll.Track1D())
        for k, (place, temperature) in enumerate(plan.blows):
            test = Planned(f"blows {k + 1}", place=place, visit=f"{temperature:.0f} °C")
            for sensor in plan.sensors:
                name, noted = f"{test.name}:{sensor.name}", {"rail_temperature": temperature}
                ones = np.ones(blows.LINES.size)
                self.pairs[name] = blows.Pair(name, test, sensor.name, sensor, blows.LINES, ones, noted)
        for k, train in enumerate(plan.trains):
            noted = {} if train.temperature is None else {"rail_temperature": train.temperature}
            passage = Planned(f"{train.name} {k + 1}", train.vehicle, train.speed, train.name, conditions=noted)
            stop = rolling.duration_of(passage, train.speed, plan.sensors) + 0.45 + roll.EDGE
            time = np.arange(0.45 - roll.EDGE, stop, 1.0 / bands.clock_of(train.speed))
            self.rollings[passage.name] = rolling.Rolling(passage.name, passage, plan.sensors, time, 0.45, train.speed)
        self.nuisances = tuple(self.listed())
        self.observations = tuple(self._expected())
        self.candidates, self.families = library(self, families), ()

    def highest(self, channel):
        """What a channel shows in the band: nothing else is simulated of a campaign to come. [m/s²]"""
        return self.peak(channel)

    def _expected(self):
        values = {n.name: n.mean for n in self.nuisances}
        for pair in list(self.pairs.values()):
            h = self._receptance(values, (), pair, self.blow_model(values, (), pair))
            h = h[: blows.LINES.size] + 1j * h[blows.LINES.size :]
            self.pairs[pair.name] = pair = blows.sized(pair, np.abs(h))
            yield blows.observed(pair, h, NOISE * np.abs(h), self.settings.pair_tolerance)
        for made in self.rollings.values():
            data = self.passage_of(values, (), made).reshape(len(made.sensors), -1)
            planned = rolling.observed(made, data, NOISE * np.std(data, axis=1), self.settings.materiality)
            yield replace(planned, modes=wheel_modes(self, values, made, planned.sigma))


class _Intended:
    """What ``TrackCase`` asks a campaign for."""

    def __init__(self, plan):
        self.turnout, self.sensors, self.hammer, self.reserved = plan.turnout, plan.sensors, (), ()
        self.passages = tuple(Planned(t.name, t.vehicle, t.speed, t.name) for t in plan.trains)
        self._blows = plan.blows

    def places(self):
        """Places of sensors and blows [m]."""
        return [s.place for s in self.sensors] + [x for x, _ in self._blows]
