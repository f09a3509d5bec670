"""A sensor that is not at its described position."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from turnout.physics.hypothesis import ChannelSite, Hypothesis, Masking
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.sensor import Sensor

STARTS = ((0.15,), (-0.15,), (0.4,), (-0.4,))  # m
MASKING_SD = 0.3  # m


@dataclass(frozen=True)
class SensorPosition(PhysicsTerm):
    r"""The sensor is :math:`\Delta x` further along the track; wheels reach it :math:`\Delta x / v` later."""

    channel_name: str
    shift: float

    name = "sensor_position"
    left_out = "channel {channel_name} is {shift:+z.2f} m from its described position"
    message = "Sensor {channel} is {shift} from its position in the layout"
    site_check = "Measure the position of this sensor"
    separating_test = "passages at another speed"
    effect_type = "channel"
    frame = "sensor"
    site_types = (ChannelSite,)
    column_type = "channel"
    smallest_reportable = 0.05
    exact = True
    sign_ambiguous = True
    parameters = (
        Parameter("shift", "m", 0.0, (-1.2, 1.2), "true position minus described position",
                  "EN 13848-1:2019, position along the track known to 10 m by trains, to 0.1 m by tape", (0.0, 0.3)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """Sensor A is 0.3 m further along."""
        return cls("A", 0.3)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """This sensor is elsewhere on the track."""
        masking = Masking(f"seat_{site.name}", MASKING_SD, float, same_quantity=True)
        yield Hypothesis(STARTS, {"channel_name": site.name}, site.where, site.n_sites, masking=masking)

    def sensor(self, sensor: Sensor) -> Sensor:
        """The sensor at its true position."""
        self.check()
        return replace(sensor, place=sensor.place + self.shift) if sensor.name == self.channel_name else sensor
