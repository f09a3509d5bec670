"""Where blade, nose and joints lie: a rough search, without which straight steps do not find them.

A nose that lies 0.3 m further is met 7 ms later at 44 m/s: three quarters of a period at 112 Hz, and no fit gets from
there to the truth; at 30 Hz it is a fifth. So the numbers are moved, one by one, to where a few passages look most like
the simulation below 30 Hz.
"""

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.track import alignment
from turnout.mismatch.track.running_surface import PLACES

TRIED = 3  # passages that fits read, those of the shortest trains: each is simulated twenty times a number, or more
APART, FAR = 0.15, 2.0  # m between places tried, and how far, in standard deviations of the file's
FACTORS = (-1.0, -0.5, 0.5, 1.0)  # standard deviations by which another number is moved
FINER, AROUND = 4, 3  # steps of places in the second round, and how many of them to each side
SAMPLES = 20.0  # independent ones of a passage below 30 Hz, about: what its likeness counts for against the file
HIGHEST = 0.999  # likeness: beyond, it says nothing of the surface


def seated(case, values):
    """Nuisances of the running surface as a few passages have it, dict name -> value; {} where nothing is unsure."""
    heard = [p for p in case.campaign.passages if case.campaign.sensors_of(p)]
    heard = [p for p in heard if p.name not in case.campaign.reserved] or heard
    passages = sorted(heard, key=lambda p: len(p.vehicle.wheels))[:TRIED]
    known = {n.name: n for n in case.surface.nuisances()}
    found = dict.fromkeys(known, 0.0)
    best = _score(case, {**values, **found}, passages) if known else 0.0
    for again in (False, True):
        for u in sorted(case.surface.unsure, key=lambda u: u.field not in PLACES):
            centre, prior = found[u.name], known[u.name]
            for by in _moves(u.field, prior.sd, again):
                moved = {**found, u.name: float(np.clip(centre + by, *prior.bounds))}
                score = _score(case, {**values, **moved}, passages)
                if score > best:
                    best, found = score, moved
    return found


def _moves(field, sd, again):
    if field not in PLACES:
        return [f * sd * (0.5 if again else 1.0) for f in FACTORS]
    if again:
        return [APART * k / FINER for k in range(-AROUND, AROUND + 1) if k]
    step = min(APART, sd)
    n = int(FAR * sd / step)
    return [step * k for k in range(-n, n + 1) if k]


def _score(case, values, passages):
    """Twice the logarithm of the likelihood of ``passages``, of which the simulation explains the square of their
    likeness, less the squares by which the numbers of the surface leave the file's."""
    away = sum((values[u.name] / u.nuisance.sd) ** 2 for u in case.surface.unsure)
    return -away - SAMPLES * sum(np.log(1.0 - min(_likeness(case, values, p), HIGHEST) ** 2) for p in passages)


def _likeness(case, values, passage):
    try:
        return aligned(case, values, passage)[2]
    except SimulationError:
        return 0.0


def aligned(case, values, passage):
    """``alignment.align`` of a passage with its simulation at ``values``; SimulationError where there is none."""
    sensors, surfaces = case.campaign.sensors_of(passage), case.surface.surfaces(passage.route, values)
    roll = case.roll(values, (), passage)
    signals = roll(passage, passage.vehicle, passage.speed, sensors, surfaces=surfaces)
    if passage.name not in case.slow:
        case.slow[passage.name] = alignment.slow(passage.recording, sensors)
    return alignment.align(passage, case.slow[passage.name], signals, case.solver.rate)
