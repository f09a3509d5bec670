"""A channel with a delay."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from turnout.physics.hypothesis import ChannelSite, Hypothesis
from turnout.physics.requirement import IMPACTS, Requirement
from turnout.physics.term import ACCURATE, Parameter
from turnout.physics.transfer import TransferTerm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

DELAYS = (1e-4, 2.5e-4, *np.arange(5e-4, 5.6e-3, 5e-4))  # s, a quarter period at 500 Hz apart
STARTS = tuple((sign * d,) for d in DELAYS for sign in (1.0, -1.0))


@dataclass(frozen=True)
class TimeOffset(TransferTerm):
    r"""One channel lags by the same time at every speed, :math:`T = e^{-2\pi i f \Delta t}`.

    The lag of a sensor at a wrong position is inversely proportional to the speed.
    """

    channel_name: str
    delay: float

    name = "time_offset"
    left_out = "channel {channel_name} comes {delay:.5f} s late"
    left_out_negative = "channel {channel_name} comes {delay_size:.5f} s early"
    message = "Channel {channel} lags by {delay}"
    message_negative = "Channel {channel} is early by {delay_size}"
    site_check = "Check the clock of this channel"
    separating_test = "passages at another speed"
    frame = "clock"
    site_types = (ChannelSite,)
    requirements: ClassVar[tuple[Requirement, ...]] = (IMPACTS,)
    column_type = "channel"
    smallest_reportable = 5e-5
    model_error_share = ACCURATE
    exact = True
    component = "channel"
    nonlinear_in_size = True
    parameters = (
        Parameter("delay", "s", 0.0, (-6e-3, 6e-3), "lag behind the other channels",
                  "IEEE 1588:2008 clocks keep 1 µs; unsynchronised recorders lose some ms", (0.0, 2e-3)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """Sensor A lags by 0.4 ms."""
        return cls("A", 4e-4)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """A lag or lead of this channel."""
        yield Hypothesis(STARTS, {"channel_name": site.name}, site.where, site.n_sites)

    def transfer(self, frequency: ArrayLike) -> np.ndarray:
        """A pure delay."""
        return np.exp(-2j * np.pi * np.asarray(frequency) * self.delay)
