"""A channel that lags in the hammer tests alone, with 2 % jitter from record to record."""

from turnout_blind.effects import time_offset

EFFECT = time_offset.EFFECT.in_recordings_of("hammer", "hammer_delay")
