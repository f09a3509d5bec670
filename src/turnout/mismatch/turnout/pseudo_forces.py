"""Linear response of a passage's sensors to small forces at supports (pseudo-forces), without another simulation.

The free track carries the force to the sensors and to the wheels. The wheels respond to the motion of the rail under
them as to a wave of its surface (``wave_response``).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.passage_band import transfer_lines
from turnout.mismatch.turnout.priors import RECEPTANCE, SIMULATION
from turnout.mismatch.turnout.receptance_model import linear_matrices
from turnout.mismatch.turnout.track_parameters import track_with
from turnout.mismatch.turnout.track_under_wheels import track_key
from turnout.mismatch.turnout.wave_response import WaveTransfer
from turnout.mismatch.turnout.wheel_line import blade_rows
from turnout.simulate.frequency_response import responses
from turnout.simulate.run import Probe

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any, TypeAlias

    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Terms, Values
    from turnout.mismatch.turnout.site_model import SiteModel

    Force: TypeAlias = tuple[int, int, np.ndarray]  # support, target, (n,) force at the rate of the simulation [N]

RAIL, SLEEPER, PAD = range(3)  # targets; the force of a pad acts on the rail and reversed on the sleeper


def probes(predictor: SiteModel, values: Values, terms: Terms, aligned: AlignedPassage) -> list[Probe]:
    """Probes of rail and sleeper at every support of the zone, for pseudo-forces, and of sensors moved by
    ``RECEPTANCE.seat_step``.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    aligned : AlignedPassage
        The passage.

    Returns
    -------
    list of Probe
        Rail and sleeper of each support in turn, then the sensors.
    """
    sensors = [predictor.seat(s, values, terms) for s in aligned.sensors]
    track = predictor.track(aligned.passage.route)
    shifted = [replace(s, place=s.place + RECEPTANCE.seat_step).probe(track) for s in sensors]
    return [Probe((layer, j), 0) for j in predictor.zone.supports for layer in ("rail", "sleeper")] + shifted


def support_motion(
    predictor: Predictor, values: Values, terms: Terms, aligned: AlignedPassage
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement of rail and sleeper at the zone's supports, each (n_support, n) at the simulation's rate [m].

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    aligned : AlignedPassage
        The passage.

    Returns
    -------
    rail : (n_support, n) array of float
        Displacement of the rail. [m]
    sleeper : (n_support, n) array of float
        Displacement of the sleepers. [m]
    """
    signals = predictor.signals_with_probes(values, terms, aligned)[len(aligned.sensors) :]
    last = 2 * len(predictor.zone.supports)
    return signals[0:last:2], signals[1:last:2]


def green_functions(
    predictor: Predictor, values: Values, terms: Terms, aligned: AlignedPassage
) -> tuple[np.ndarray, np.ndarray]:
    """Transfer functions from forces on rail seats and sleepers to the acceleration of the sensors.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    aligned : AlignedPassage
        The passage.

    Returns
    -------
    frequency : (m,) array of float
        [Hz]
    g : (m, n_sensor, n_support, 2) array of complex
        Acceleration per force on rail seat and sleeper. [m/s²/N]
    """
    under = [t.under_conditions(aligned.conditions) for t in terms]
    track = track_with(predictor.track(aligned.passage.route, under), predictor.zone, values)
    frequency = transfer_lines()
    positions = tuple(predictor.seat(s, values, terms).probe(track).place for s in aligned.sensors)

    def compute() -> np.ndarray:
        matrices = linear_matrices(track, under)
        rows = [matrices.index[layer, j] for j in predictor.zone.supports for layer in ("rail", "sleeper")]
        h = responses(matrices, frequency, positions, rows)
        omega2 = (2.0 * np.pi * frequency) ** 2
        return -omega2[:, None, None, None] * h.reshape(*h.shape[:2], -1, 2)

    key = "forces", *track_key(predictor, values, aligned, under), positions
    return frequency, predictor.track_transfer(key, compute)


class _StaticDeflection:
    """Static deflection of the nodes of stock rail and blade per force on rail seat and sleeper."""

    def __init__(self, predictor: Predictor, values: Values, terms: Terms, aligned: AlignedPassage):
        under = [t.under_conditions(aligned.conditions) for t in terms]
        track = track_with(predictor.track(aligned.passage.route, under), predictor.zone, values)

        def compute() -> tuple[np.ndarray, np.ndarray]:
            matrices = linear_matrices(track, under)
            names = [(layer, j) for j in predictor.zone.supports for layer in ("rail", "sleeper")]
            rows = np.concatenate([matrices.node_index, blade_rows(matrices)])
            return matrices.node, responses(matrices, [0.0], names, rows)[0].real

        key = "deflection", *track_key(predictor, values, aligned, under)
        self.node, deflections = predictor.track_transfer(key, compute)
        self.stock, self.blade = np.split(deflections, 2, axis=1)

    def at(self, positions: np.ndarray, on_blade: bool = False) -> np.ndarray:
        """(n_x, n_support, 3) deflection at ``positions`` per force on the targets RAIL, SLEEPER and PAD [m/N].

        Parameters
        ----------
        positions : (n_x,) array of float
            [m]
        on_blade : bool
            Of the blade where there is one; else of the stock rail.

        Returns
        -------
        (n_x, n_support, 3) array of float
        """
        rows = self.blade if on_blade else self.stock
        inside = np.array([np.interp(positions, self.node, row) for row in rows])
        inside = inside.reshape(-1, 2, positions.size).transpose(2, 0, 1)
        return np.concatenate([inside, inside[..., :1] - inside[..., 1:]], axis=-1)


def force_responses(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    aligned: AlignedPassage,
    forces: Mapping[Any, Force | list[Force]],
) -> dict[Any, np.ndarray]:
    """Response of the sensors to force histories, key -> (n_sensor * n_time,) at the times of the observation.

    ``forces`` maps a key to (support, target, (n,) force at the rate of the simulation), or to a list of such that act
    together.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    aligned : AlignedPassage
        The passage.
    forces : mapping
        Key -> (support, target, (n,) force [N]), or a list of such.

    Returns
    -------
    dict
        Key -> (n_sensor * n_time,) [m/s²].
    """
    transfer = WaveTransfer(predictor, values, aligned, terms)
    _, g = green_functions(predictor, values, terms, aligned)
    g = np.concatenate([g, g[..., :1] - g[..., 1:]], axis=-1)
    static = _StaticDeflection(predictor, values, terms, aligned)
    groups = [f if isinstance(f, list) else [f] for f in forces.values()]
    first = np.cumsum([0, *(len(f) for f in groups[:-1])])
    force_list = [f for some in groups for f in some]
    support = np.array([j - predictor.zone.first for j, _, _ in force_list])
    target = np.array([k for _, k, _ in force_list])
    history = np.array([force for _, _, force in force_list])
    history = history - history[:, :1]
    clock = (np.arange(history.shape[1]) + 0.5) / predictor.solver.rate

    def under_wheels(x: np.ndarray, deflection: np.ndarray) -> np.ndarray:
        """(n_key, n_wheel, n_x) deflection under each wheel when it is at x, by the forces that act then."""
        share = deflection[:, support, target].T
        total = np.empty((support.size, transfer.wheel_delays.size, x.size))
        for w in range(transfer.wheel_delays.size):
            when = transfer.times(w, SIMULATION.lead_time, x)
            for k, force in enumerate(history):
                total[k, w] = np.interp(when, clock, force, 0.0, 0.0) * share[k]
        return np.add.reduceat(total, first, axis=0)

    grid, change = transfer.path_grid, transfer.load_transfer
    deflection = static.at(grid)
    if change is not None:
        weight = change.mean_blade_weight(grid, grid[1] - grid[0])[:, None, None]
        deflection = (1.0 - weight) * deflection + weight * static.at(grid, on_blade=True)
    columns = transfer.force_response(history, g[:, :, support, target], first)
    columns += transfer.reactions(under_wheels(grid, deflection))
    if change is not None:
        x, _ = change.positions()
        columns += transfer.pair_response(under_wheels(x, static.at(x) - static.at(x, on_blade=True)))
    return dict(zip(forces, columns.T))


def support_columns(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    aligned: AlignedPassage,
    histories: tuple[np.ndarray, np.ndarray],
) -> dict[str, np.ndarray]:
    """Derivatives of a passage by support values.

    By the logarithms of each support's own pad and ballast, stiffness and damping, and by the sleeper mass and pad
    damping that all supports have in common. Of the latter the contribution of supports beyond the zone is left out.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    aligned : AlignedPassage
        The passage.
    histories : tuple of (n_support, n) array of float
        Those of ``support_motion``. [m]

    Returns
    -------
    dict
        Nuisance -> (n_sensor * n_time,) per unit of the logarithm. [m/s²]
    """
    rail, sleeper = histories
    track = track_with(predictor.track(aligned.passage.route), predictor.zone, values)
    zone = predictor.zone.supports
    forces: dict[str, Force | list[Force]] = {}
    closing, sinking = (np.gradient(x, axis=1) * predictor.solver.rate for x in (rail - sleeper, sleeper))
    inertia = np.gradient(sinking, axis=1) * predictor.solver.rate
    for k, j in enumerate(zone):
        forces[f"pad_{j}"] = j, PAD, -track.pad_stiffness[j] * (rail[k] - sleeper[k])
        forces[f"ballast_{j}"] = j, SLEEPER, -track.ballast_stiffness[j] * sleeper[k]
        forces[f"pad_damper_{j}"] = j, PAD, -track.pad_damping[j] * closing[k]
        forces[f"ballast_damper_{j}"] = j, SLEEPER, -track.ballast_damping[j] * sinking[k]
    forces["sleeper_mass"] = [(j, SLEEPER, -track.sleeper_mass[j] * inertia[k]) for k, j in enumerate(zone)]
    columns = force_responses(predictor, values, terms, aligned, forces)
    columns["pad_damping"] = np.asarray(sum(columns[f"pad_damper_{j}"] for j in zone))
    return columns
