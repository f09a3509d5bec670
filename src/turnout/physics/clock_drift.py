"""A channel whose clock runs fast or slow."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.physics.term import Parameter, PhysicsTerm


@dataclass(frozen=True)
class ClockDrift(PhysicsTerm):
    r"""The channel shows :math:`y(t(1+\epsilon))`: its lag grows during the record.

    A hammer test is too short to show it.

    ``start`` is the time from the start of the record to the first sample of the signal [s].
    """

    channel_name: str
    drift: float
    start: float = 0.0

    name = "clock_drift"
    left_out = "the clock of channel {channel_name} is off by a share of {drift:.2e}"
    effect_type = "channel"
    frame = "clock"
    parameters = (
        Parameter("drift", "-", 0.0, (-5e-3, 5e-3), "relative error of the sampling rate",
                  "IEEE 1139:2008, quartz oscillators: 1e-4 to 1e-6; failing ones more", (0.0, 1e-3)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """A drift of one in a thousand."""
        return cls("A", 1e-3)

    def under_conditions(self, conditions):
        """The term with the start time of the signal of this recording."""
        return replace(self, start=float(conditions.get("start", 0.0)))

    def channel(self, signal, rate, sensor):
        """The signal at the wrong times, by cubic interpolation."""
        self.check()
        if sensor.name != self.channel_name or self.drift == 0.0:
            return signal
        from scipy.interpolate import CubicSpline

        t = np.arange(np.size(signal))
        return CubicSpline(t, signal)(np.clip(t + self.drift * (self.start * rate + t), 0.0, t[-1]))
