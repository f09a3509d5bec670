"""When each axle passes each sensor, from that sensor's own record."""

from __future__ import annotations

import numpy as np

from turnout.passage.motion import Motion
from turnout.passage.place import MOST, axle_places
from turnout.passage.stack import Listening


def sensor_times(listening: Listening, motion: Motion, offsets) -> np.ndarray:
    """(n_sensor, n_axle) passing times [s], nan where a sensor puts an axle far from where the others do."""
    rows = []
    for i, x in enumerate(listening.positions):
        places = axle_places(listening.only([i]), motion, offsets)
        moved = np.abs(places - offsets - np.median(places - offsets))
        rows.append(np.where(moved < 0.7 * MOST, motion.passing(places, x), np.nan))
    return np.array(rows)
