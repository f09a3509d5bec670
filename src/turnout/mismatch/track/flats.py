"""Wheels with a flat, sought in the residual: which wheel of which train, and where on the rail it strikes each time.

A flat is a short drop once a turn. Its length is common to all passages of the train, the angle at which the wheel
comes is not: every passage has a phase of its own, and the evidence pays for having chosen it.
"""

import numpy as np

from turnout import physics
from turnout.mismatch.case import Candidate
from turnout.mismatch.track.rolled_waves import Carrier

NOMINAL = 0.06  # length of the flat that the columns stand for [m]
PHASES = 24  # places tried within a turn
APART = 0.15  # phases closer than this look alike in the band [m]
AMOUNTS = np.geomspace(0.2, 12.0, 25)  # of the nominal flat's area
NAMED = 2  # wheels offered


def flats(case, fit):
    """Candidates of the wheels that most likely carry a flat."""
    white = {o.name: (o, w) for o, w in zip(case.observations, fit.white) if o.name in case.rollings}
    ranked = []
    for train in case.trains:
        names = [n for n in white if case.said(case.rollings[n])["train"] == train]
        if not names:
            continue
        vehicle = case.rollings[names[0]].passage.vehicle
        turn = 2.0 * np.pi * vehicle.radius
        carriers = [(Carrier(case, fit.values, case.rollings[n]), *white[n], n) for n in names]
        for wheel in range(len(vehicle.wheels)):
            gain, amount, phases = _of_wheel(fit, carriers, wheel, turn, vehicle.radius)
            ranked.append((gain - len(names) * np.log(turn / APART), train, wheel, amount, phases, vehicle.radius))
    ranked.sort(key=lambda entry: -entry[0])
    return tuple(_candidate(*entry[1:], len(ranked)) for entry in ranked[:NAMED] if entry[0] > 0.0)


def _of_wheel(fit, carriers, wheel, turn, radius):
    """(nats, area over the nominal flat's, ((recording, phase), ...)) of one wheel."""
    along, power, found = [], [], []
    for carrier, o, white, name in carriers:
        phases = np.arange(PHASES) * turn / PHASES
        columns = o.whitened(carrier.alone(wheel, _drops(carrier.way, phases, turn, radius)))
        weight = o.effective / fit.scale[o.kind]
        along.append(weight * (columns.T @ white))
        power.append(weight * np.sum(columns**2, axis=0))
        found.append((name, phases))
    gains = [sum(np.max(a * b - 0.5 * a * a * c) for b, c in zip(along, power)) for a in AMOUNTS]
    best = int(np.argmax(gains))
    a = AMOUNTS[best]
    chosen = tuple(
        (name, float(phases[np.argmax(a * b - 0.5 * a * a * c)])) for (name, phases), b, c in zip(found, along, power)
    )
    return float(gains[best]), float(a), chosen


def _drops(way, phases, turn, radius):
    """(n_phase, n_x) drops of the nominal flat, their area shared by the two places beside them [m]."""
    step, area = way[1] - way[0], NOMINAL**3 / (32.0 * radius)
    rows = np.zeros((phases.size, way.size))
    for row, phase in zip(rows, phases):
        for x in np.arange(phase + turn * np.ceil((way[0] - phase) / turn), way[-1], turn):
            row += np.clip(1.0 - np.abs(way - x) / step, 0.0, None) * area / step
    return rows


def _candidate(train, wheel, amount, phases, radius, scanned):
    def make(p):
        return physics.WheelFlat(wheel, radius=radius, train=train, phases=phases, **p)

    length = min(NOMINAL * amount ** (1.0 / 3.0), 0.149)
    places = scanned * (2.0 * np.pi * radius / APART) ** len(phases)
    where = {"train": train, "axle": wheel + 1}
    return Candidate("wheel_flat", physics.WheelFlat.parameters, make, ((length,),), where, "wheel", places)
