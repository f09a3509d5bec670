"""A channel that lags in the passages alone: they are recorded with another logger than the hammer tests."""

from __future__ import annotations

from dataclasses import dataclass

from turnout.physics.one_recording_type import OneRecordingType
from turnout.physics.time_offset import TimeOffset


@dataclass(frozen=True)
class PassageDelay(OneRecordingType, TimeOffset):
    r"""One channel lags by the same time in every passage, :math:`T = e^{-2\pi i f \Delta t}`, and in no hammer test.

    A filter before this channel alone is such a lag. The lag of a clock that runs fast or slow grows during the record.
    """

    name = "passage_delay"
    left_out = "channel {channel_name} comes {delay:.5f} s late in the passages"
    left_out_negative = "channel {channel_name} comes {delay_size:.5f} s early in the passages"
    message = "In the passages channel {channel} lags by {delay}, in the hammer tests it does not"
    message_negative = "In the passages channel {channel} is early by {delay_size}, in the hammer tests it is not"
    site_check = "Check clock and filter of this channel in the logger of the passages"
    recording_types = ("passage",)
    general_form = "time_offset"
