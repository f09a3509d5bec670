"""Receptances of a track with terms, as hammer tests measure them: its matrices are solved once per position."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.matrix_cache import FixedLinks, matrices_of
from turnout.mismatch.turnout.priors import RECEPTANCE
from turnout.mismatch.turnout.receptance_observation import SHIFTED_LINES
from turnout.mismatch.turnout.track_parameters import SUPPORT_PARAMETERS
from turnout.physics.term import PhysicsTerm
from turnout.simulate.frequency_response import responses
from turnout.simulate.links import Link, links_of, ports_of
from turnout.simulate.matrices import link_vector

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from turnout.simulate.force_laws import ForceLaw
    from turnout.simulate.matrices import TrackMatrices
    from turnout.simulate.sensor import Sensor
    from turnout.simulate.track import Track


def tangent_links(terms: Sequence[PhysicsTerm], track: Track) -> list[Link]:
    """Links that replace the nonlinear ports of terms: secant stiffness over 1 µm, and damping at the sliding rate.

    Parameters
    ----------
    terms : sequence of PhysicsTerm
        Terms with ports.
    track : Track
        The track.

    Returns
    -------
    list of Link
        One per port.
    """
    links = []
    for port in ports_of(terms, track):
        law, d = port.law, -port.gap
        k = (
            float(law.force(d + RECEPTANCE.tangent_motion, 0.0)) - float(law.force(d - RECEPTANCE.tangent_motion, 0.0))
        ) / (2.0 * RECEPTANCE.tangent_motion)
        rate = RECEPTANCE.stuck_rate + (RECEPTANCE.free_rate - RECEPTANCE.stuck_rate) * np.exp(
            -abs(_friction_force(law, d, RECEPTANCE.free_rate)) / RECEPTANCE.sticking_force
        )
        c = _friction_force(law, d, rate) / rate
        links.append(Link(port.ends, k, c, tag="tangent"))
    return links


def linear_matrices(track: Track, terms: Sequence[PhysicsTerm]) -> TrackMatrices:
    """Matrices of a track with ``terms``, their ports replaced by ``tangent_links``.

    Parameters
    ----------
    track : Track
        The track.
    terms : sequence of PhysicsTerm
        Effects on the track.

    Returns
    -------
    TrackMatrices
    """
    return matrices_of(track, (*terms, FixedLinks(tangent_links(terms, track))))


def _friction_force(law: ForceLaw, d: float, rate: float) -> float:
    """Half the change of a port's force when its rate reverses [N]."""
    return 0.5 * (float(law.force(d, rate)) - float(law.force(d, -rate)))


def _file_shear_share(track: Track, terms: Sequence[PhysicsTerm]) -> float:
    """Share of the file's value in the shear flexibility of the rail; ``terms`` add the rest."""
    if track.rail.beam == "euler":
        return 0.0
    changed = track
    for term in terms:
        changed = term.rail(changed)
    return changed.rail.shear_stiffness / track.rail.shear_stiffness


class ReceptanceModel:
    """Receptances of one track with terms at given conditions on ``LINES``.

    ``bilinear_changes`` are those of ``bilinear_supports``, by position of the impact and seat of the sensor.
    """

    def __init__(self, track: Track, terms: Sequence[PhysicsTerm]):
        self.track, self.terms = track, terms
        self.matrices = linear_matrices(track, terms)
        self.file_shear_share = _file_shear_share(track, terms)
        self.by_position: dict[float | tuple, np.ndarray] = {}
        self.bilinear_changes: dict[tuple[float, tuple], np.ndarray] = {}
        self.weight: dict[float | tuple, tuple[np.ndarray, np.ndarray]] = {}

    def solve(self, positions: Iterable[float | tuple]) -> None:
        """Compute and keep the displacements under unit forces at these positions, with one factorisation.

        Parameters
        ----------
        positions : iterable of float or tuple
            Positions on the rail [m], or degrees of freedom of sleepers.
        """
        new = [p for p in dict.fromkeys(positions) if p not in self.by_position]
        if new:
            displacements = responses(self.matrices, SHIFTED_LINES, new)
            self.by_position |= {p: displacements[:, k] for k, p in enumerate(new)}

    def displacement(self, position: float | tuple) -> np.ndarray:
        """Displacement of all degrees of freedom under a unit force at a position.

        Parameters
        ----------
        position : float or tuple
            Position on the rail [m], or a degree of freedom of a sleeper.

        Returns
        -------
        (n_line, n) array of complex
            Per unit force. [m/N]
        """
        self.solve([position])
        return self.by_position[position]

    def nodal_motion(self, excited: float | tuple, measured: float | tuple) -> np.ndarray:
        """Displacement at one position under a unit force at another, from nodal motion alone.

        Parameters
        ----------
        excited : float or tuple
            Position of the impact [m], or a degree of freedom of a sleeper.
        measured : float or tuple
            Position of the sensor [m], or a degree of freedom of a sleeper.

        Returns
        -------
        (n_line,) array of complex
            Per unit force. [m/N]
        """
        if measured not in self.weight:
            self.weight[measured] = self.matrices.weights(measured)
        rows, weights = self.weight[measured]
        return self.displacement(excited)[:, rows] @ weights

    def receptances(
        self, displacements: np.ndarray, excited: Sequence[float | tuple], measured: float | tuple
    ) -> np.ndarray:
        """Receptances from several positions to the same sensor.

        Parameters
        ----------
        displacements : (n_excited, n_line, n) array of complex
            ``displacement`` of each position. [m/N]
        excited : sequence of float or tuple
            Positions of the impacts [m], or degrees of freedom of sleepers.
        measured : float or tuple
            Position of the sensor [m], or a degree of freedom of a sleeper.

        Returns
        -------
        (n_excited, n_line) array of complex
            [m/N]
        """
        if measured not in self.weight:
            self.weight[measured] = self.matrices.weights(measured)
        rows, weights = self.weight[measured]
        h = displacements[:, :, rows] @ weights
        for k, position in enumerate(excited):
            h[k] += self._compliance(position, measured)
        return h

    def _compliance(self, excited: float | tuple, measured: float | tuple) -> float:
        """Compliance of the rail between two positions within an element [m/N]; 0 of others and of sleepers."""
        if isinstance(measured, tuple) or isinstance(excited, tuple) or abs(excited - measured) > self._longest_element:
            return 0.0
        return self.matrices.compliance(float(excited), float(measured))

    @cached_property
    def _longest_element(self) -> float:
        return float(np.max(np.diff(self.matrices.node)))

    def position_of(self, sensor: Sensor) -> float | tuple:
        """Position of a sensor on the model.

        Parameters
        ----------
        sensor : Sensor
            A sensor.

        Returns
        -------
        float or tuple
        """
        return sensor.probe(self.track).place

    def receptance(self, excited: float | tuple, measured: float | tuple) -> np.ndarray:
        """Receptance between two positions, with what a rail between two nodes yields locally.

        Parameters
        ----------
        excited : float or tuple
            Position of the impact [m], or a degree of freedom of a sleeper.
        measured : float or tuple
            Position of the sensor [m], or a degree of freedom of a sleeper.

        Returns
        -------
        (n_line,) array of complex
            Receptance. [m/N]
        """
        return self.nodal_motion(excited, measured) + self._compliance(excited, measured)

    @cached_property
    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows of the rail and of the sleeper at every support, each (n_support,)."""
        index, supports = self.matrices.index, range(self.track.support.size)
        rail, sleeper = (np.array([index[layer, j] for j in supports]) for layer in ("rail", "sleeper"))
        return rail, sleeper

    @cached_property
    def following_links(self) -> list[tuple[str, int, np.ndarray, np.ndarray, tuple[float, ...]]]:
        """Links of the terms that depend on a value of their support.

        List of (field, support, rows, weights, (k, c, m) per logarithm of the value). Soft ballast has a share of the
        ballast stiffness and a pad's branch follows the pad, for example; a gap has none.
        """
        if not self.terms:
            return []
        links, before = [], self.links(self.terms)
        for field in dict.fromkeys(o.field for o in SUPPORT_PARAMETERS):
            after = self.links(
                self.terms, self.track.with_(**{field: getattr(self.track, field) * (1.0 + RECEPTANCE.relative_step)})
            )
            for a, b in zip(before, after):
                change = tuple(
                    (getattr(b, name) - getattr(a, name)) / RECEPTANCE.relative_step
                    for name in ("stiffness", "damping", "mass")
                )
                if any(change):
                    links.append((field, a.ends[0][0][1], *link_vector(a, self.matrices.index), change))
        return links

    def links(self, terms: Sequence[PhysicsTerm], track: Track | None = None) -> list[Link]:
        """Links of ``terms`` on this track or another, followed by the tangents of their ports.

        Parameters
        ----------
        terms : sequence of PhysicsTerm
            Physics terms of the effects.
        track : Track or None
            A track; by default that of the case.

        Returns
        -------
        list[Link]
        """
        track = track or self.track
        return [*links_of(terms, track), *tangent_links(terms, track)]
