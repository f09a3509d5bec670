"""A sensor with a wrong sensitivity."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter
from turnout.physics.transfer import TransferTerm


@dataclass(frozen=True)
class SensorGain(TransferTerm):
    r"""One channel shows :math:`g` times the true signal at every frequency, in passages and in hammer tests.

    A negative g is a wrong polarity.
    """

    channel_name: str
    gain: float

    name = "sensor_gain"
    left_out = "channel {channel_name} shows {gain:.3f} times the true signal"
    parameters = (
        Parameter("gain", "-", 1.0, (-5.0, 5.0), "shown signal over true signal",
                  "ISO 16063-21:2003, comparison calibration: 1 to 5 % when new", (1.0, 0.5)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """Sensor A shows 20 % too much."""
        return cls("A", 1.2)

    def transfer(self, frequency):
        """The gain."""
        return np.full(np.shape(frequency), self.gain, dtype=complex)
