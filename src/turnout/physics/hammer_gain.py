"""A channel with a wrong sensitivity in the hammer tests alone: they are recorded with another logger."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from turnout.physics.hypothesis import ChannelSite, Hypothesis
from turnout.physics.requirement import IMPACTS, PASSAGES
from turnout.physics.sensor_gain import STARTS, SensorGain


@dataclass(frozen=True)
class HammerGain(SensorGain):
    r"""One channel shows :math:`g` times the true signal in every hammer test, and the true one in passages.

    A negative g is a wrong polarity.
    """

    name = "hammer_gain"
    left_out = "channel {channel_name} shows {gain:.3f} times the true signal in the hammer tests"
    message = "In the hammer tests channel {channel} reads {gain} times the true value, in the passages it does not"
    message_negative = (
        "In the hammer tests channel {channel} has the wrong polarity, it reads {gain} times the true value; in the "
        "passages it does not"
    )
    site_check = "Check range and sensitivity of this channel in the logger of the hammer tests"
    recording_types = ("hammer",)
    general_form = "sensor_gain"
    requirements = (IMPACTS, PASSAGES)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """Another gain of this channel in the hammer tests; its passages show the true one."""
        if site.has_passages and site.hammer_pairs:
            yield Hypothesis(STARTS, {"channel_name": site.name}, site.where, site.n_sites)
