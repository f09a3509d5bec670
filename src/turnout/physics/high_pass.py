"""A channel that loses its low end: integrator, charge amplifier, AC coupling."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter
from turnout.physics.transfer import TransferTerm


@dataclass(frozen=True)
class HighPass(TransferTerm):
    r"""First-order high-pass :math:`T = i f / (i f + f_c)`."""

    channel_name: str
    corner: float

    name = "high_pass"
    left_out = "channel {channel_name} loses what lies below {corner:.1f} Hz"
    parameters = (
        Parameter("corner", "Hz", 0.0, (0.0, 80.0), "frequency of 3 dB loss",
                  "ISO 16063-1:1998 and data sheets: 0.1 to 5 Hz; failing coupling more"),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """A corner at 15 Hz."""
        return cls("A", 15.0)

    def transfer(self, frequency):
        """High-pass; 1 at its neutral value, also at 0 Hz."""
        f = np.asarray(frequency)
        if self.corner == 0.0:
            return np.ones(f.shape, dtype=complex)
        return 1j * f / (1j * f + self.corner)
