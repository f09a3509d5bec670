"""A channel that comes late."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter
from turnout.physics.transfer import TransferTerm


@dataclass(frozen=True)
class TimeOffset(TransferTerm):
    r"""One channel lags by the same time at every speed, :math:`T = e^{-2\pi i f \Delta t}`.

    The lag of a sensor at a wrong position is inversely proportional to the speed.
    """

    channel_name: str
    delay: float

    name = "time_offset"
    left_out = "channel {channel_name} comes {delay:.5f} s late"
    frame = "clock"
    parameters = (
        Parameter("delay", "s", 0.0, (-6e-3, 6e-3), "lag behind the other channels",
                  "IEEE 1588:2008 clocks keep 1 µs; unsynchronised recorders lose some ms", (0.0, 2e-3)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """Sensor A lags by 0.4 ms."""
        return cls("A", 4e-4)

    def transfer(self, frequency):
        """A pure delay."""
        return np.exp(-2j * np.pi * np.asarray(frequency) * self.delay)
