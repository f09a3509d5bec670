"""A channel that lags in the hammer tests alone: they are recorded with another logger than the passages."""

from __future__ import annotations

from dataclasses import dataclass

from turnout.physics.one_recording_type import OneRecordingType
from turnout.physics.time_offset import TimeOffset


@dataclass(frozen=True)
class HammerDelay(OneRecordingType, TimeOffset):
    r"""One channel lags by the same time in hammer tests, :math:`T = e^{-2\pi i f \Delta t}`, and in no passage."""

    name = "hammer_delay"
    left_out = "channel {channel_name} comes {delay:.5f} s late in the hammer tests"
    left_out_negative = "channel {channel_name} comes {delay_size:.5f} s early in the hammer tests"
    message = "In the hammer tests channel {channel} lags by {delay}, in the passages it does not"
    message_negative = "In the hammer tests channel {channel} is early by {delay_size}, in the passages it is not"
    site_check = "Check clock and filter of this channel in the logger of the hammer tests"
    recording_types = ("hammer",)
    general_form = "time_offset"
