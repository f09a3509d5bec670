"""A channel that loses high frequencies: a too short or too low anti-alias filter."""

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

STARTS = ((1 / 500.0,),)  # s


@dataclass(frozen=True)
class LowPass(TransferTerm):
    r"""Second-order Butterworth low-pass :math:`T = 1 / (1 + \sqrt2\, i f T_c - (f T_c)^2)`, :math:`T_c = 1/f_c`."""

    channel_name: str
    period: float

    name = "low_pass"
    left_out = "channel {channel_name} loses what lies above {corner:.0f} Hz"
    message = "Channel {channel} loses high frequencies"
    site_check = "Check filter and cable of this channel"
    site_types = (ChannelSite,)
    column_type = "channel"
    smallest_reportable = 1 / 2000.0
    component = "channel"
    parameters = (
        Parameter("period", "s", 0.0, (0.0, 1 / 200.0), "reciprocal of the frequency at which 3 dB are lost",
                  "Butterworth 1930, On the theory of filter amplifiers"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """A corner at 600 Hz."""
        return cls("A", 1 / 600.0)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """A filter of this channel that is too low."""
        yield Hypothesis(STARTS, {"channel_name": site.name}, site.where, site.n_sites)

    def sentence(self) -> str:
        """Sentence that states what was left out."""
        return self.left_out.format(**vars(self), corner=1.0 / self.period if self.period else np.inf)

    def transfer(self, frequency: ArrayLike) -> np.ndarray:
        """The filter's response."""
        ratio = np.asarray(frequency) * self.period
        return 1.0 / (1.0 + 1j * np.sqrt(2.0) * ratio - ratio**2)
