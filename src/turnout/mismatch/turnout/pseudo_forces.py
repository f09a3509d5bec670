"""Linear response of a passage's sensors to small forces at supports (pseudo-forces), without another simulation.

The free track carries the force to the sensors and to the wheels. The wheels respond to the motion of the rail under
them as to a wave of its surface (``wave_response``).
"""

from dataclasses import replace

import numpy as np

from turnout.mismatch.turnout.passage_band import transfer_lines
from turnout.mismatch.turnout.priors import RECEPTANCE, SIMULATION
from turnout.mismatch.turnout.receptance_model import linear_matrices
from turnout.mismatch.turnout.track_parameters import track_with
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.simulate.frequency_response import responses
from turnout.simulate.run import Probe

RAIL, SLEEPER, PAD = range(3)  # targets; the force of a pad acts on the rail and reversed on the sleeper


def probes(predictor, values, terms, aligned):
    """Probes of rail and sleeper at every support of the zone, for pseudo-forces, and of sensors moved by
    ``RECEPTANCE.seat_step``.
    """
    sensors = [predictor.seat(s, values, terms) for s in aligned.sensors]
    track = predictor.track(aligned.passage.route)
    shifted = [replace(s, place=s.place + RECEPTANCE.seat_step).probe(track) for s in sensors]
    return [Probe((layer, j), 0) for j in predictor.zone.supports for layer in ("rail", "sleeper")] + shifted


def support_motion(predictor, values, terms, aligned):
    """Displacement of rail and sleeper at the zone's supports, each (n_support, n) at the simulation's rate [m]."""
    signals = predictor.signals_with_probes(values, terms, aligned)[len(aligned.sensors) :]
    last = 2 * len(predictor.zone.supports)
    return signals[0:last:2], signals[1:last:2]


def green_functions(predictor, values, terms, aligned):
    """(frequency (m,), G (m, n_sensor, n_support, 2)) acceleration per force on rail seat and sleeper [m/s²/N]."""
    under = [t.under_conditions(aligned.conditions) for t in terms]
    track = track_with(predictor.track(aligned.passage.route, under), predictor.zone, values)
    matrices = linear_matrices(track, under)
    frequency = transfer_lines()
    positions = [predictor.seat(s, values, terms).probe(track).place for s in aligned.sensors]
    rows = [matrices.index[layer, j] for j in predictor.zone.supports for layer in ("rail", "sleeper")]
    h = responses(matrices, frequency, positions, rows)
    omega2 = (2.0 * np.pi * frequency) ** 2
    return frequency, -omega2[:, None, None, None] * h.reshape(*h.shape[:2], -1, 2)


def _static_deflection(predictor, values, terms, aligned, positions):
    """(n_support, 2, n_x) static deflection of the rail at ``positions`` per force on rail seat and sleeper [m/N]."""
    under = [t.under_conditions(aligned.conditions) for t in terms]
    track = track_with(predictor.track(aligned.passage.route, under), predictor.zone, values)
    matrices = linear_matrices(track, under)
    names = [(layer, j) for j in predictor.zone.supports for layer in ("rail", "sleeper")]
    h = responses(matrices, [0.0], names, matrices.node_index)[0].real
    inside = [np.interp(positions, matrices.node, row) for row in h]
    return np.array(inside).reshape(-1, 2, positions.size)


def force_responses(predictor, values, terms, aligned, forces):
    """Response of the sensors to force histories, key -> (n_sensor * n_time,) at the times of the observation.

    ``forces`` maps a key to (support, target, (n,) force at the rate of the simulation), or to a list of such that act
    together.
    """
    transfer = WaveTransfer(predictor, values, aligned, terms)
    _, g = green_functions(predictor, values, terms, aligned)
    deflection = _static_deflection(predictor, values, terms, aligned, transfer.path_grid)
    g, deflection = (np.concatenate([x, x[..., :1] - x[..., 1:]], axis=-1) for x in (g, deflection.transpose(0, 2, 1)))
    groups = [f if isinstance(f, list) else [f] for f in forces.values()]
    first = np.cumsum([0, *(len(f) for f in groups[:-1])])
    force_list = [f for some in groups for f in some]
    support = np.array([j - predictor.zone.first for j, _, _ in force_list])
    target = np.array([k for _, k, _ in force_list])
    history = np.array([force for _, _, force in force_list])
    history = history - history[:, :1]
    clock = (np.arange(history.shape[1]) + 0.5) / predictor.solver.rate
    paths = np.empty((support.size, transfer.wheel_delays.size, transfer.path_grid.size))
    for w in range(transfer.wheel_delays.size):
        when = transfer.times(w, SIMULATION.lead_time)
        for k, force in enumerate(history):
            paths[k, w] = np.interp(when, clock, force, 0.0, 0.0) * deflection[support[k], :, target[k]]
    columns = transfer.force_response(history, g[:, :, support, target], first)
    columns += transfer.reactions(np.add.reduceat(paths, first, axis=0))
    return dict(zip(forces, columns.T))


def support_columns(predictor, values, terms, aligned, histories):
    """Derivatives of a passage by support values.

    By the logarithm of each support's own pad and ballast stiffness, and by the values that all supports have in
    common. Of the latter the contribution of supports beyond the zone is left out.
    """
    rail, sleeper = histories
    track = track_with(predictor.track(aligned.passage.route), predictor.zone, values)
    zone, forces = predictor.zone.supports, {}
    for k, j in enumerate(zone):
        forces[f"pad_{j}"] = j, PAD, -track.pad_stiffness[j] * (rail[k] - sleeper[k])
        forces[f"ballast_{j}"] = j, SLEEPER, -track.ballast_stiffness[j] * sleeper[k]
    closing, sinking = (np.gradient(x, axis=1) * predictor.solver.rate for x in (rail - sleeper, sleeper))
    inertia = np.gradient(sinking, axis=1) * predictor.solver.rate
    for name, target, motion in (
        ("pad_damping", PAD, closing), ("ballast_damping", SLEEPER, sinking), ("sleeper_mass", SLEEPER, inertia)
    ):  # fmt: skip
        forces[name] = [(j, target, -getattr(track, name)[j] * motion[k]) for k, j in enumerate(zone)]
    columns = force_responses(predictor, values, terms, aligned, forces)
    for name in ("pad", "ballast"):
        columns[f"{name}_stiffness"] = sum(columns[f"{name}_{j}"] for j in zone)
    return columns
