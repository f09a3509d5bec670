"""A sensor on a soft mounting."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter
from turnout.physics.transfer import TransferTerm

SOURCE = "ISO 5348:2021, mechanical mounting of accelerometers: magnets and studs resonate from some hundred Hz on"


@dataclass(frozen=True)
class MountResonance(TransferTerm):
    r"""The sensor's mass on its mounting, :math:`T = 1 / (1 - (fT_0)^2 + i f T_0 / Q)`, period :math:`T_0 = 1/f_0`."""

    channel_name: str
    period: float
    quality: float = 10.0

    name = "mount_resonance"
    left_out = "the mounting of channel {channel_name} resonates at {frequency:.0f} Hz with Q {quality:.1f}"
    parameters = (
        Parameter("period", "s", 0.0, (0.0, 1 / 80.0), "period of the mounting's resonance", SOURCE, (0.002, 0.002)),
        Parameter("quality", "-", 10.0, (1.5, 80.0), "sharpness of the resonance", SOURCE),
    )

    @classmethod
    def example(cls):
        """Sensor A resonates at 500 Hz."""
        return cls("A", 1 / 500.0, 8.0)

    def sentence(self):
        """Sentence that states what was left out."""
        frequency = 1.0 / self.period if self.period else np.inf
        return self.left_out.format(**vars(self), frequency=frequency)

    def transfer(self, frequency):
        """Recorded acceleration over acceleration of the rail."""
        ratio = np.asarray(frequency) * self.period
        return 1.0 / (1.0 - ratio**2 + 1j * ratio / self.quality)
