"""What each wheel meets at a nose, a blade or a joint: errors of a passage's own, integrated out.

The file has one path for all wheels. Where one leaves the wing and how deep it falls hangs on its profile, new or worn
hollow (Palsson and Nielsen 2012, Vehicle System Dynamics 50), and no shape of a file is that of the rail.
"""

import numpy as np

DEPTH, LENGTH = 0.2, 0.15  # of a part's own: standard deviations from wheel to wheel
PLACE = 0.03  # m
SHARP = 0.5  # of what a law of the power 1.5 differs by from one of the power 2
FAR = 1.0  # m: no nose is longer on either side
LEAST = 1e-6  # m: a part that is nowhere deeper is not there


def profile_modes(case, values, made, carrier):
    """(n_sensor * n_time, n_mode) signals of one standard deviation of each wheel's way over each part of the file."""
    way = carrier.course
    paths = [path for part in _parts(case, values, made) for path in _otherwise(part, way)]
    if not paths:
        return np.zeros((len(made.sensors) * made.time.size, 0))
    return np.concatenate([carrier.alone(w, np.array(paths)) for w in range(carrier.behind.size)], axis=1)


def _parts(case, values, made):
    """All parts of a passage's route that are met once: waves of a rail are the same to all wheels."""
    parts = [part for parts in case.surface.surfaces(made.passage.route, values) for part in parts]
    return [part for part in parts if not hasattr(part, "wavelength")]


def _otherwise(part, way):
    """Standard deviations of a part of the surface at ``way`` (n,) [m]: deeper, further, longer, sharper; a step from
    one of its ends to the other is no wheel's."""
    ends = getattr(part, "places", way)[0], getattr(part, "places", way)[-1]
    inside = (way >= ends[0]) & (way <= ends[1])
    dip = np.where(inside, part(way, 0) - np.interp(way, ends, part(np.array(ends), 0)), 0.0)
    deepest = np.max(np.abs(dip))
    if deepest < LEAST:
        return []
    slope = np.gradient(dip, way)
    from_middle = np.clip(way - way[np.argmax(np.abs(dip))], -FAR, FAR)
    share = np.abs(dip) / deepest
    sharper = np.sign(dip) * deepest * (share**0.75 - share)
    return [DEPTH * dip, PLACE * slope, LENGTH * from_middle * slope, SHARP * sharper]
