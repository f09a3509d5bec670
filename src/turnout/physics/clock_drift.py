"""A channel whose clock runs fast or slow."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.physics.term import Parameter, PhysicsTerm


@dataclass(frozen=True)
class ClockDrift(PhysicsTerm):
    r"""The channel shows :math:`y(t(1+\epsilon))`: its lag grows through the record. A hammer test is too short.

    ``start`` is the time of the signal's first sample since the record's start [s].
    """

    channel_name: str
    drift: float
    start: float = 0.0

    name = "clock_drift"
    left_out = "the clock of channel {channel_name} is off by a share of {drift:.2e}"
    kind = "channel"
    frame = "clock"
    parameters = (
        Parameter("drift", "-", 0.0, (-5e-3, 5e-3), "relative error of the sampling rate",
                  "IEEE 1139:2008, quartz oscillators: 1e-4 to 1e-6; failing ones more", (0.0, 1e-3)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """One in a thousand."""
        return cls("A", 1e-3)

    def under(self, conditions):
        """With the time at which this recording's signal starts."""
        return replace(self, start=float(conditions.get("start", 0.0)))

    def channel(self, signal, rate, sensor):
        """The signal read at the wrong times, cubic between samples."""
        self.check()
        if sensor.name != self.channel_name or self.drift == 0.0:
            return signal
        from scipy.interpolate import CubicSpline

        t = np.arange(np.size(signal))
        return CubicSpline(t, signal)(np.clip(t + self.drift * (self.start * rate + t), 0.0, t[-1]))
