"""Wheels with a flat: found by their blows in the loudness of passages, then sized by their signal in the band.

A flat's length is common to all passages of the train, the angle at which the wheel comes is not: every passage has a
phase of its own. The blows tell it to some centimetres; the simulation, with loss of contact, tells the rest.
"""

import numpy as np

from turnout import physics
from turnout.errors import SimulationError
from turnout.mismatch.candidate import Candidate
from turnout.mismatch.track.strikes import strikes

NAMED, CLOSE = 2, 3.0  # wheels offered, and nats of the blows that the second may be behind the first
LEAST = 3.0  # nats of the blows, less the logarithm of the wheels, below which nobody looks closer
ABOUT, APART = np.arange(-0.24, 0.25, 0.06), 0.15  # m: phases tried about that of the blows; closer ones look alike
NEAR = (-0.03, 0.0, 0.03)  # m: and about the best of them
MIDDLING, LENGTHS = 0.05, (0.025, 0.035, 0.045, 0.055, 0.07, 0.09)  # m


def flats(case, fit):
    """Candidates of the wheels that most likely carry a flat."""
    found, known = strikes(case), {c.where.get("train") for c in fit.candidates if "axle" in c.where}
    loud = [s for s in found if s.nats > LEAST + np.log(len(found)) and s.train not in known]
    loud = [s for s in loud if s.nats > loud[0].nats - CLOSE]
    return tuple(_candidate(case, fit, s, len(found)) for s in loud[:NAMED])


def _candidate(case, fit, struck, wheels):
    length, phases, gain = _sized(case, fit, struck)

    def make(p):
        return physics.WheelFlat(struck.wheel, radius=struck.radius, train=struck.train, phases=phases, **p)

    where = {"train": struck.train, "axle": struck.wheel + 1}
    scanned = wheels * (1.0 + np.ptp(ABOUT) / APART) ** len(phases)
    return Candidate(
        "wheel_flat", physics.WheelFlat.parameters, make, ((length,),), where, "wheel", scanned,
        promise=float(gain + struck.nats - np.log(scanned)), aside=struck.nats, sounding=True,
    )  # fmt: skip


def _sized(case, fit, struck):
    """(length [m], phases, nats) at which the simulated flat explains most of the band, loss of contact included."""
    phases = _turned(case, fit, struck, struck.phases, ABOUT, MIDDLING)
    length, gain = _longest(case, fit, struck, phases)
    if gain > 0.0:  # else none of any length explains anything
        phases = _turned(case, fit, struck, phases, NEAR, length)
        length, gain = _longest(case, fit, struck, phases)
    return length, phases, max(gain, 0.0)


def _turned(case, fit, struck, phases, about, length):
    """The phases moved to where a flat of this length explains most."""
    found = []
    for name, phase in phases:
        tried = [(_gain(case, fit, struck, name, phase + more, length), float(phase + more)) for more in about]
        found.append((name, max(tried)[1]))
    return tuple(found)


def _longest(case, fit, struck, phases):
    """(length, nats) of the length that explains most at these phases."""
    sizes = [(sum(_gain(case, fit, struck, *at, length) for at in phases), length) for length in LENGTHS]
    gain, length = max(sizes)
    return length, gain


def _gain(case, fit, struck, name, phase, length):
    """Nats that a flat explains of one passage, all else as fitted."""
    k = next(i for i, o in enumerate(case.observations) if o.name == name)
    o = case.observations[k]
    term = physics.WheelFlat(struck.wheel, length, struck.radius, phase, struck.train)
    try:
        (predicted,) = case.predict(fit.values, (*fit.terms, term), [o])
    except SimulationError:
        return -np.inf
    before, after = (float(np.sum(o.whitened(o.data - p) ** 2)) for p in (fit.predictions[k], predicted))
    return 0.5 * o.effective / fit.scale[o.kind] * (before - after)
