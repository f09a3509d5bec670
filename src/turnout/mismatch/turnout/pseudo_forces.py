"""Linear columns from pseudo-forces: what a small force at a support does to a passage's sensors.

The free track carries the force to the sensors and to the wheels; these answer to the motion of the rail under them as
to a wave of its surface (``rolled_waves``).
"""

from dataclasses import replace

import numpy as np

from turnout.mismatch.turnout import passage_band, passage_model
from turnout.mismatch.turnout.receptance_model import linear
from turnout.mismatch.turnout.track_parameters import track_with
from turnout.mismatch.turnout.wave_response import Carrier
from turnout.simulate.frequency_response import responses
from turnout.simulate.run import Probe

FURTHER = 0.01  # way over which a derivative by a sensor's place is taken [m]
RAIL, SLEEPER, PAD = range(3)  # a pad's force presses the rail and lifts the sleeper


def probes(case, values, terms, made):
    """Displacements of rail and sleeper at every support of the zone, of which pseudo-forces are made; then each
    sensor a little further along."""
    seated = [case.seat(s, values, terms) for s in made.sensors]
    track = case.track(made.passage.route)
    further = [replace(s, place=s.place + FURTHER).probe(track) for s in seated]
    return [Probe((kind, j), 0) for j in case.zone.supports for kind in ("rail", "sleeper")] + further


def support_forces(case, values, terms, made):
    """Histories at the zone's supports on the simulation's clock: rail and sleeper displacement (n_support, n) [m]."""
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
    """(n_support, 2, n_x) static motion of the rail at ``way`` per force on rail seat and sleeper [m/N]."""
    under = [t.under(case.said(made)) for t in terms]
    track = track_with(case.track(made.passage.route, under), case.zone, values)
    matrices = linear(track, under)
    names = [(kind, j) for j in case.zone.supports for kind in ("rail", "sleeper")]
    h = responses(matrices, [0.0], names, matrices.node_index)[0].real
    inside = [np.interp(way, matrices.node, row) for row in h]
    return np.array(inside).reshape(-1, 2, way.size)


def carried(case, values, terms, made, forces):
    """Sensors' response to force histories, dict key -> (support, kind, (n,) force on the simulation's clock), or to a
    list of such that act together.

    Returns key -> (n_sensor * n_time,) on the observation's clock.
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
    """Derivatives of a passage by the logarithm of each support's own pad and ballast stiffness, and by what all
    supports have in common: what those beyond the zone add to it is left out."""
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
