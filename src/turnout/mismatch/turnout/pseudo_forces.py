"""Linear response of a passage's sensors to small forces at supports (pseudo-forces), without another simulation.

The free track carries the force to the sensors and to the wheels. The wheels respond to the motion of the rail under
them as to a wave of its surface (``wave_response``).
"""

from dataclasses import replace

import numpy as np

from turnout.mismatch.turnout import passage_band, passage_model
from turnout.mismatch.turnout.receptance_model import linear
from turnout.mismatch.turnout.track_parameters import track_with
from turnout.mismatch.turnout.wave_response import Carrier
from turnout.simulate.frequency_response import responses
from turnout.simulate.run import Probe

FURTHER = 0.01  # m, step of the derivative by the position of a sensor
RAIL, SLEEPER, PAD = range(3)  # targets; the force of a pad acts on the rail and reversed on the sleeper


def probes(case, values, terms, made):
    """Probes of rail and sleeper at every support of the zone, for pseudo-forces, and of sensors moved by
    ``POSITION_STEP``.
    """
    seated = [case.seat(s, values, terms) for s in made.sensors]
    track = case.track(made.passage.route)
    further = [replace(s, place=s.place + FURTHER).probe(track) for s in seated]
    return [Probe((kind, j), 0) for j in case.zone.supports for kind in ("rail", "sleeper")] + further


def support_forces(case, values, terms, made):
    """Displacement of rail and sleeper at the zone's supports, each (n_support, n) at the simulation's rate [m]."""
    signals = case.marched(values, terms, made)[len(made.sensors) :]
    last = 2 * len(case.zone.supports)
    return signals[0:last:2], signals[1:last:2]


def green(case, values, terms, made):
    """(frequency (m,), G (m, n_sensor, n_support, 2)) acceleration per force on rail seat and sleeper [m/s²/N]."""
    under = [t.under(case.said(made)) for t in terms]
    track = track_with(case.track(made.passage.route, under), case.zone, values)
    matrices = linear(track, under)
    frequency = np.arange(4.0, 1.3 * passage_band.HIGH, 2.0)
    places = [case.seat(s, values, terms).probe(track).place for s in made.sensors]
    rows = [matrices.index[kind, j] for j in case.zone.supports for kind in ("rail", "sleeper")]
    h = responses(matrices, frequency, places, rows)
    omega2 = (2.0 * np.pi * frequency) ** 2
    return frequency, -omega2[:, None, None, None] * h.reshape(*h.shape[:2], -1, 2)


def _sag(case, values, terms, made, way):
    """(n_support, 2, n_x) static deflection of the rail at ``positions`` per force on rail seat and sleeper [m/N]."""
    under = [t.under(case.said(made)) for t in terms]
    track = track_with(case.track(made.passage.route, under), case.zone, values)
    matrices = linear(track, under)
    names = [(kind, j) for j in case.zone.supports for kind in ("rail", "sleeper")]
    h = responses(matrices, [0.0], names, matrices.node_index)[0].real
    inside = [np.interp(way, matrices.node, row) for row in h]
    return np.array(inside).reshape(-1, 2, way.size)


def carried(case, values, terms, made, forces):
    """Response of the sensors to force histories, key -> (n_sensor * n_time,) at the times of the observation.

    ``forces`` maps a key to (support, target, (n,) force at the rate of the simulation), or to a list of such that act
    together.
    """
    carrier = Carrier(case, values, made, terms)
    _, g = green(case, values, terms, made)
    sag = _sag(case, values, terms, made, carrier.way)
    g, sag = (np.concatenate([x, x[..., :1] - x[..., 1:]], axis=-1) for x in (g, sag.transpose(0, 2, 1)))
    acting = [f if isinstance(f, list) else [f] for f in forces.values()]
    first = np.cumsum([0, *(len(f) for f in acting[:-1])])
    each = [f for some in acting for f in some]
    support = np.array([j - case.zone.first for j, _, _ in each])
    kind = np.array([k for _, k, _ in each])
    history = np.array([force for _, _, force in each])
    history = history - history[:, :1]
    clock = (np.arange(history.shape[1]) + 0.5) / case.solver.rate
    paths = np.empty((support.size, carrier.behind.size, carrier.way.size))
    for w in range(carrier.behind.size):
        when = carrier.times(w, passage_model.LEAD)
        for k, force in enumerate(history):
            paths[k, w] = np.interp(when, clock, force, 0.0, 0.0) * sag[support[k], :, kind[k]]
    columns = carrier.pressed(history, g[:, :, support, kind], first)
    columns += carrier.reactions(np.add.reduceat(paths, first, axis=0))
    return dict(zip(forces, columns.T))


def columns_of(case, values, terms, made, histories):
    """Derivatives of a passage by support values.

    By the logarithm of each support's own pad and ballast stiffness, and by the values that all supports have in
    common. Of the latter the contribution of supports beyond the zone is left out.
    """
    rail, sleeper = histories
    track = track_with(case.track(made.passage.route), case.zone, values)
    zone, forces = case.zone.supports, {}
    for k, j in enumerate(zone):
        forces[f"pad_{j}"] = j, PAD, -track.pad_stiffness[j] * (rail[k] - sleeper[k])
        forces[f"ballast_{j}"] = j, SLEEPER, -track.ballast_stiffness[j] * sleeper[k]
    closing, sinking = (np.gradient(x, axis=1) * case.solver.rate for x in (rail - sleeper, sleeper))
    inertia = np.gradient(sinking, axis=1) * case.solver.rate
    for name, kind, moved in (
        ("pad_damping", PAD, closing), ("ballast_damping", SLEEPER, sinking), ("sleeper_mass", SLEEPER, inertia)
    ):  # fmt: skip
        forces[name] = [(j, kind, -getattr(track, name)[j] * moved[k]) for k, j in enumerate(zone)]
    found = carried(case, values, terms, made, forces)
    for name in ("pad", "ballast"):
        found[f"{name}_stiffness"] = sum(found[f"{name}_{j}"] for j in zone)
    return found
