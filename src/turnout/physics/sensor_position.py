"""A sensor that sits elsewhere than its description says."""

from dataclasses import dataclass, replace

from turnout.physics.term import Parameter, PhysicsTerm


@dataclass(frozen=True)
class SensorPosition(PhysicsTerm):
    r"""The sensor is :math:`\Delta x` further along the track; wheels reach it :math:`\Delta x / v` later."""

    channel_name: str
    shift: float

    name = "sensor_position"
    left_out = "channel {channel_name} sits {shift:+.2f} m from where its description says"
    effect_type = "channel"
    frame = "sensor"
    parameters = (
        Parameter("shift", "m", 0.0, (-1.2, 1.2), "true place minus described place",
                  "EN 13848-1:2019, position along the track known to 10 m by trains, to 0.1 m by tape", (0.0, 0.3)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """Sensor A is 0.3 m further along."""
        return cls("A", 0.3)

    def sensor(self, sensor):
        """The sensor at its true position."""
        self.check()
        return replace(sensor, place=sensor.place + self.shift) if sensor.name == self.channel_name else sensor
