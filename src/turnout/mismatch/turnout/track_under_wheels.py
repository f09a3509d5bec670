"""The linear track under a passage: its responses to forces on the rail that wheels press."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.priors import SIMULATION
from turnout.mismatch.turnout.receptance_model import linear_matrices
from turnout.mismatch.turnout.track_parameters import track_value_key, track_with
from turnout.mismatch.turnout.wheel_line import LoadTransfer, blade_rows, load_transfer, points_of_rows
from turnout.simulate.frequency_response import responses

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from turnout.mismatch.turnout.passage_observation import AlignedPassage
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Terms, Values
    from turnout.simulate.matrices import TrackMatrices
    from turnout.simulate.vehicle import Vehicle


def track_key(predictor: Predictor, values: Values, aligned: AlignedPassage, terms: Terms) -> tuple[Any, ...]:
    """All that the linear track under a passage depends on.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    aligned : AlignedPassage
        The passage.
    terms : sequence of PhysicsTerm
        Effects beside the base model, under the conditions of the passage.

    Returns
    -------
    tuple
    """
    return aligned.passage.route, track_value_key(predictor.zone, values), repr(tuple(terms))


class TrackUnderWheels:
    """The linear track of a passage with the rails that its wheels press.

    ``matrices`` are those of the track, ``load_transfer`` is the change of the wheels to its blade, None without one.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site; it keeps what passages share.
    values : mapping
        All nuisances of the site, by name.
    aligned : AlignedPassage
        The passage.
    terms : sequence of PhysicsTerm
        Effects beside the base model, under the conditions of the passage.
    vehicle : Vehicle
        As ``values`` and ``terms`` have it.
    """

    def __init__(self, predictor: Predictor, values: Values, aligned: AlignedPassage, terms: Terms, vehicle: Vehicle):
        self.predictor, self.terms = predictor, terms
        self.track = track_with(predictor.track(aligned.passage.route, terms), predictor.zone, values)
        self.positions = tuple(predictor.seat(s, values, terms).probe(self.track).place for s in aligned.sensors)
        self.key: tuple[Any, ...] = track_key(predictor, values, aligned, terms)
        self.load_transfer: LoadTransfer | None = None
        if self.track.blade is not None:
            surfaces = predictor.surface.surfaces(aligned.passage.route, values)
            self.key += surfaces, float(np.mean(vehicle.static_loads))
            self.load_transfer = predictor.track_transfer(
                ("change", *self.key), lambda: load_transfer(self.matrices, self.track.blade, surfaces, vehicle)
            )

    @cached_property
    def matrices(self) -> TrackMatrices:
        """Linear matrices of the track with the terms."""
        return linear_matrices(self.track, self.terms)

    @property
    def pair_nodes(self) -> slice:
        """Nodes about the change to the blade."""
        change = self.load_transfer
        assert change is not None
        low, high = sorted((change.start, change.end))
        first = int(np.searchsorted(self.matrices.node, low, side="right")) - 1
        return slice(first, int(np.searchsorted(self.matrices.node, high)) + 1)

    def transfers(
        self, frequency: np.ndarray, beyond: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray]:
        """Responses to forces on the rail that wheels press, at nodes up to ``beyond`` the ends of the waves; cached.

        Parameters
        ----------
        frequency : (m,) array of float
            Lines. [Hz]
        beyond : float
            Length of rail before and behind the free waves. [m]

        Returns
        -------
        to_sensors : (m, n_sensor, n_node) array of complex
            Acceleration of the sensors. [m/s²/N]
        under_wheel : (m, n_node) array of complex
            Receptance of the rail at each node. [m/N]
        pair : (m, n_sensor, n_pair) array of complex or None
            Acceleration of the sensors by opposite forces on blade and stock rail at ``pair_nodes``. [m/s²/N]
        node : (n_node,) array of float
            Positions. [m]
        """
        key = "waves", *self.key, self.positions, beyond
        return self.predictor.track_transfer(key, lambda: self._transfers(frequency, beyond))

    def _transfers(
        self, frequency: np.ndarray, beyond: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray]:
        matrices, waves = self.matrices, self.predictor.waves
        beyond += SIMULATION.node_margin
        near = np.flatnonzero((matrices.node >= waves.start - beyond) & (matrices.node <= waves.end + beyond))
        square = -((2.0 * np.pi * frequency) ** 2)[:, None, None]
        if self.load_transfer is None:
            near = near[:: SIMULATION.node_stride]
            h, under_wheel = rail_receptances(matrices, frequency, near, self.positions)
            return square * h, under_wheel, None, matrices.node[near]
        near = near[near[0] % SIMULATION.node_stride :]  # the node at the toe is not in line with the others
        near = near[:: SIMULATION.node_stride]
        h, under_wheel = self._receptances_under_wheels(frequency, near)
        nodes = self.pair_nodes
        rows = np.concatenate([blade_rows(matrices)[nodes], matrices.node_index[nodes]])
        on_blade, on_stock = np.split(responses(matrices, frequency, self.positions, rows), 2, axis=2)
        return square * h, under_wheel, square * (on_blade - on_stock), matrices.node[near]

    def _receptances_under_wheels(self, frequency: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As ``rail_receptances``, of the rail that wheels press: the stock rail, both or the blade."""
        matrices, node = self.matrices, self.matrices.node[near]
        assert self.load_transfer is not None
        weight = self.load_transfer.mean_blade_weight(node, node[1] - node[0])
        stock, blade = matrices.node_index[near], blade_rows(matrices)[near]
        rows, place = np.unique(np.concatenate([stock, blade]), return_inverse=True)
        on_stock, on_blade = np.split(place, 2)
        h = responses(matrices, frequency, [*self.positions, *points_of_rows(matrices, rows)], rows)
        to_sensors, between = h[:, : len(self.positions)], h[:, len(self.positions) :]
        point = (
            (1.0 - weight) ** 2 * between[:, on_stock, on_stock]
            + 2.0 * weight * (1.0 - weight) * between[:, on_stock, on_blade]
            + weight**2 * between[:, on_blade, on_blade]
        )
        under_wheels = (1.0 - weight) * to_sensors[:, :, on_stock] + weight * to_sensors[:, :, on_blade]
        return under_wheels, point


def rail_receptances(
    matrices: TrackMatrices,
    frequency: np.ndarray,
    near: np.ndarray,
    positions: Sequence[float | tuple],
) -> tuple[np.ndarray, np.ndarray]:
    """Receptances between positions and nodes, and of the rail at these nodes.

    Parameters
    ----------
    matrices : TrackMatrices
        Of the track.
    frequency : (m,) array of float
        Lines. [Hz]
    near : (n,) array of int
        Nodes.
    positions : sequence
        Positions [m] or degrees of freedom.

    Returns
    -------
    h : (m, n_place, n) array of complex
        [m/N]
    under_wheel : (m, n) array of complex
        [m/N]
    """
    node = matrices.node[near]
    h = responses(matrices, frequency, [*positions, *node.tolist()], matrices.node_index[near])
    return h[:, : len(positions)], np.diagonal(h[:, len(positions) :], axis1=1, axis2=2)
