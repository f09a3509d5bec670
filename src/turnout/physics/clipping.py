"""A channel that clips."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter, PhysicsTerm


@dataclass(frozen=True)
class Clipping(PhysicsTerm):
    r"""The channel shows :math:`\mathrm{clip}(y, -L, L)` without a warning."""

    channel_name: str
    limit: float

    name = "clipping"
    left_out = "channel {channel_name} clips at {limit:.3g} m/s²"
    effect_type = "channel"
    frame = "sensor"
    parameters = (
        Parameter("limit", "m/s²", 1e5, (0.01, 1e5), "largest value that is shown",
                  "IEC 61260-1:2014 and data sheets of accelerometers: 50 to 5000 g"),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """Clips at 2 m/s²."""
        return cls("A", 2.0)

    def channel(self, signal, rate, sensor):
        """The clipped signal."""
        self.check()
        return np.clip(signal, -self.limit, self.limit) if sensor.name == self.channel_name else signal
