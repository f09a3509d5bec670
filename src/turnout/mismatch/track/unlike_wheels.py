"""What each wheel meets at a nose, a blade or a joint: errors of a passage's own, integrated out.

The file has one path for all wheels. Where one leaves the wing and how deep it falls hangs on its profile, new or worn
hollow (Palsson and Nielsen 2012, Vehicle System Dynamics 50), and no shape of a file is that of the rail.
"""

import numpy as np

DEPTH, LENGTH = 0.2, 0.15  # of a part's own: standard deviations from wheel to wheel
PLACE = 0.03  # m
SHARP = 0.5  # of what a law of the power 1.5 differs by from one of the power 2
LEAST = 1e-6  # m: a part that is nowhere deeper is not there


def profile_modes(case, values, made, carrier):
    """(n_sensor * n_time, n_mode) signals of one standard deviation of each wheel's way over each part of the file."""
    way = carrier.course
    paths = [path for part in _parts(case, values, made) for path in _otherwise(part(way, 0), way)]
    if not paths:
        return np.zeros((len(made.sensors) * made.time.size, 0))
    return np.concatenate([carrier.alone(w, np.array(paths)) for w in range(carrier.behind.size)], axis=1)


def _parts(case, values, made):
    """All parts of the running surface of a passage's route."""
    return [part for parts in case.surface.surfaces(made.passage.route, values) for part in parts]


def _otherwise(dip, way):
    """Standard deviations of a ``dip`` (n,) at ``way`` [m]: deeper, further, longer, sharper."""
    deepest = np.max(np.abs(dip))
    if deepest < LEAST:
        return []
    slope = np.gradient(dip, way)
    middle = way[np.argmax(np.abs(dip))]
    share = np.abs(dip) / deepest
    sharper = np.sign(dip) * deepest * (share**0.75 - share)
    return [DEPTH * dip, PLACE * slope, LENGTH * (way - middle) * slope, SHARP * sharper]
