"""A channel with a wrong sensitivity in the passages alone: they are recorded with another logger."""

from __future__ import annotations

from dataclasses import dataclass

from turnout.physics.one_recording_type import OneRecordingType
from turnout.physics.sensor_gain import SensorGain


@dataclass(frozen=True)
class PassageGain(OneRecordingType, SensorGain):
    r"""One channel shows :math:`g` times the true signal in every passage, and the true one in hammer tests.

    A negative g is a wrong polarity.
    """

    name = "passage_gain"
    left_out = "channel {channel_name} shows {gain:.3f} times the true signal in the passages"
    message = "In the passages channel {channel} reads {gain} times the true value, in the hammer tests it does not"
    message_negative = (
        "In the passages channel {channel} has the wrong polarity, it reads {gain} times the true value; in the hammer "
        "tests it does not"
    )
    site_check = "Check range and sensitivity of this channel in the logger of the passages"
    recording_types = ("passage",)
    general_form = "sensor_gain"
