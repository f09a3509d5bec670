"""A channel that loses low frequencies: integrator, charge amplifier, AC coupling."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import ChannelSite, Hypothesis
from turnout.physics.term import Parameter
from turnout.physics.transfer import TransferTerm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

STARTS = ((12.0,),)  # Hz


@dataclass(frozen=True)
class HighPass(TransferTerm):
    r"""First-order high-pass :math:`T = i f / (i f + f_c)`."""

    channel_name: str
    corner: float

    name = "high_pass"
    left_out = "channel {channel_name} loses what lies below {corner:.1f} Hz"
    message = "Channel {channel} loses frequencies below {corner}"
    site_check = "Check the coupling of this channel's amplifier"
    site_types = (ChannelSite,)
    column_type = "channel"
    smallest_reportable = 2.0
    min_significance = 1.0
    parameters = (
        Parameter("corner", "Hz", 0.0, (0.0, 80.0), "frequency at which 3 dB are lost",
                  "ISO 16063-1:1998 and data sheets: 0.1 to 5 Hz; failing coupling more"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """A corner at 15 Hz."""
        return cls("A", 15.0)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """A coupling of this channel with too high a corner."""
        yield Hypothesis(STARTS, {"channel_name": site.name}, site.where, site.n_sites)

    def transfer(self, frequency: ArrayLike) -> np.ndarray:
        """High-pass; 1 at its neutral value, also at 0 Hz."""
        f = np.asarray(frequency)
        if self.corner == 0.0:
            return np.ones(f.shape, dtype=complex)
        return 1j * f / (1j * f + self.corner)
