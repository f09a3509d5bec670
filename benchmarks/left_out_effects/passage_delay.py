"""A channel that lags in the passages alone, with 2 % jitter from record to record."""

from dataclasses import replace

import numpy as np

from turnout_blind.effects import time_offset

EFFECT = replace(
    time_offset.EFFECT.in_recordings_of("passage", "passage_delay"), ladder=tuple(np.geomspace(2e-4, 4e-3, 7))
)
