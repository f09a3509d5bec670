"""A sensor with a wrong sensitivity."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import ChannelSite, Hypothesis, Masking
from turnout.physics.term import ACCURATE, Parameter
from turnout.physics.transfer import TransferTerm

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

STARTS = ((0.8,), (1.25,), (-1.0,))  # -1: wrong polarity
MASKING_SD = 0.3  # of the gain less one


@dataclass(frozen=True)
class SensorGain(TransferTerm):
    r"""One channel shows :math:`g` times the true signal at every frequency, in passages and in hammer tests.

    A negative g is a wrong polarity.
    """

    channel_name: str
    gain: float

    name = "sensor_gain"
    left_out = "channel {channel_name} shows {gain:.3f} times the true signal"
    message = "Sensor {channel} reads {gain} times the true value"
    message_negative = "Sensor {channel} has the wrong polarity: it reads {gain} times the true value"
    site_check = "Calibrate this sensor, check its polarity, exchange it with its neighbour"
    site_types = (ChannelSite,)
    column_type = "channel"
    smallest_reportable = 0.04
    model_error_share = ACCURATE
    exact = True
    parameters = (
        Parameter("gain", "-", 1.0, (-5.0, 5.0), "shown signal over true signal",
                  "ISO 16063-21:2003, comparison calibration: 1 to 5 % when new", (1.0, 0.5)),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """Sensor A shows 20 % too much."""
        return cls("A", 1.2)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """Another gain of this channel in all its recordings, which its hammer tests must not contradict."""
        masking = Masking(f"gain_{site.name}", MASKING_SD, lambda gain: 1.0 + gain, same_quantity=True)
        yield Hypothesis(
            STARTS,
            {"channel_name": site.name},
            site.where,
            site.n_sites,
            masking=masking,
            must_not_oppose=site.hammer_pairs,
        )

    def transfer(self, frequency: ArrayLike) -> np.ndarray:
        """The gain."""
        return np.full(np.shape(frequency), self.gain, dtype=complex)
