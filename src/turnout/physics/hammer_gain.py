"""A channel with a wrong sensitivity in the hammer tests alone: they are recorded with another logger."""

from __future__ import annotations

from dataclasses import dataclass

from turnout.physics.one_recording_type import OneRecordingType
from turnout.physics.sensor_gain import SensorGain


@dataclass(frozen=True)
class HammerGain(OneRecordingType, SensorGain):
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
