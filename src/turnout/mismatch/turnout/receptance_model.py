"""Receptances of a track with terms, as hammer tests measure them: its matrices are solved once per position.

Links that are added, or whose values change, change the receptances without another solution. For added links this is
exact, for small changes of values it is exact to first order.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array, lil_array

from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.matrix_cache import FixedLinks, matrices_of
from turnout.mismatch.turnout.priors import RECEPTANCE
from turnout.mismatch.turnout.receptance_observation import SHIFTED_LINES
from turnout.mismatch.turnout.track_parameters import SUPPORT_PARAMETERS
from turnout.physics.term import PhysicsTerm
from turnout.simulate.frequency_response import responses
from turnout.simulate.links import Link, links_of, ports_of, with_links
from turnout.simulate.matrices import link_vector

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterable, Sequence
    from typing import TypeAlias

    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Terms, Values
    from turnout.mismatch.turnout.receptance_observation import FrfPair
    from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity
    from turnout.simulate.force_laws import ForceLaw
    from turnout.simulate.matrices import TrackMatrices
    from turnout.simulate.sensor import Sensor
    from turnout.simulate.track import Track

    # motion of the ends of links under impact and sensor, end, response and term of each link
    LinkResponses: TypeAlias = tuple[tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray, csr_array]


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
    """Receptances of one track with terms at given conditions on ``LINES``."""

    def __init__(self, track: Track, terms: Sequence[PhysicsTerm]):
        self.track, self.terms = track, terms
        self.matrices = linear_matrices(track, terms)
        self.file_shear_share = _file_shear_share(track, terms)
        self.by_position: dict[float | tuple, np.ndarray] = {}
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
        """(n_line, n) displacement of all degrees of freedom under a unit force at a position.

        Parameters
        ----------
        position : float or tuple
            Position on the rail [m], or a degree of freedom of a sleeper.

        Returns
        -------
        (n_line, n) array
            Displacement of all degrees of freedom under a unit force at a position.
        """
        self.solve([position])
        return self.by_position[position]

    def nodal_motion(self, excited: float | tuple, measured: float | tuple) -> np.ndarray:
        """(n_line,) displacement at one position under a unit force at another, from nodal motion alone. [m/N]

        Parameters
        ----------
        excited : float or tuple
            Position of the impact [m], or a degree of freedom of a sleeper.
        measured : float or tuple
            Position of the sensor [m], or a degree of freedom of a sleeper.

        Returns
        -------
        (n_line,) array
            Displacement at one position under a unit force at another, from nodal motion alone. [m/N]
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
            Position of a sensor on the model.
        """
        return sensor.probe(self.track).place

    def receptance(self, excited: float | tuple, measured: float | tuple) -> np.ndarray:
        """(n_line,) complex [m/N].

        Parameters
        ----------
        excited : float or tuple
            Position of the impact [m], or a degree of freedom of a sleeper.
        measured : float or tuple
            Position of the sensor [m], or a degree of freedom of a sleeper.

        Returns
        -------
        (n_line,) array
            Complex [m/N].
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
            Links of ``terms`` on this track or another, followed by the tangents of their ports.
        """
        track = track or self.track
        return [*links_of(terms, track), *tangent_links(terms, track)]


class AddedLinks:
    """Changes of receptances about ``values`` and ``terms`` by each of ``chosen`` [(candidate, start)].

    The response of the added links is computed once for all pairs under the same conditions.
    """

    def __init__(self, predictor: Predictor, values: Values, terms: Terms, chosen: Sequence[tuple[Candidate, int]]):
        self.predictor, self.values, self.terms, self.chosen = predictor, values, terms, chosen
        self._by_conditions: dict[Hashable, LinkResponses] = {}
        self._by_terms: dict[Hashable, LinkResponses] = {}

    def changes(self, pair: FrfPair) -> dict[tuple[str, int], np.ndarray]:
        r"""(key, start) -> (n,) change of the observation of a pair.

        One link w with impedance z changes a receptance by :math:`-z\,u_w v_w / (1 + z\,g_w)`. Here u and v are the
        motion of its ends under unit forces at impact and sensor, g that under unit forces at its own ends. Several
        links of one candidate are treated as independent.

        Parameters
        ----------
        pair : FrfPair
            Pair of impact position and sensor.

        Returns
        -------
        (key, start) dict[tuple[str, int], array]
            -> (n,) change of the observation of a pair.
        """
        predictor, chosen = self.predictor, self.chosen
        if not chosen:
            return {}
        sensitivity = predictor.pair_sensitivity(self.values, self.terms, pair)
        (u, v), index, response, owner = self._responses(sensitivity, pair)
        row = sensitivity.row_of(pair)
        change = -(owner @ (response * (u[row] * v[row])[index])).T
        if predictor.lifting is not None:
            for i, (candidate, k) in enumerate(chosen):
                change[:, i] += predictor.lifting.difference(pair, self.terms, candidate.term(candidate.starts[k]))
        columns = receptance_observation.split_complex(
            receptance_observation.scale_lines(pair, change, predictor.channel_response(self.values, self.terms, pair))
        )
        return {(c.key, k): column for (c, k), column in zip(chosen, columns.T)}

    def _responses(self, sensitivity: ReceptanceSensitivity, pair: FrfPair) -> LinkResponses:
        """Motion of the ends of all links, end of each, z / (1 + z g) of each, and the candidate of each as a matrix.

        Most candidates do not depend on conditions: those that are alike under them share one response.
        """
        if pair.conditions_key not in self._by_conditions:
            terms = [c.term(c.starts[k]).under_conditions(pair.conditions) for c, k in self.chosen]
            alike = id(sensitivity), repr(terms)
            if alike not in self._by_terms:
                ends, *responses_of_links = _link_responses(sensitivity.model, terms)
                self._by_terms[alike] = sensitivity.motions(ends), *responses_of_links
            self._by_conditions[pair.conditions_key] = self._by_terms[alike]
        return self._by_conditions[pair.conditions_key]


def _link_responses(
    model: ReceptanceModel, terms: Sequence[PhysicsTerm]
) -> tuple[csr_array, np.ndarray, np.ndarray, csr_array]:
    """(ends (n_end, n), end of each link, z / (1 + z g) of each (n_link, n_line), term of each link as a matrix).

    The matrix (n_term, n_link) is 1 where a link belongs to a term, else 0.
    """
    omega = 2.0 * np.pi * receptance_observation.SHIFTED_LINES
    end_index: dict[tuple, int] = {}
    link_ends, impedance, owner = [], [], []
    track = with_links(model.track, links_of(model.terms, model.track))
    for i, term in enumerate(terms):
        for ends, z in _impedances(track, term, omega):
            link_ends.append(end_index.setdefault(ends, len(end_index)))
            impedance.append(z)
            owner.append(i)
    weights = lil_array((len(end_index), model.matrices.n))
    end_receptance = np.empty((len(end_index), omega.size), dtype=np.complex128)
    for ends, k in end_index.items():
        motion = np.asarray(sum(weight * model.displacement(name) for name, weight in ends))
        end_receptance[k] = sum(weight * motion[:, model.matrices.index[name]] for name, weight in ends)
        for name, weight in ends:
            weights[k, model.matrices.index[name]] += weight
    index, z = np.array(link_ends, dtype=int), np.array(impedance).reshape(-1, omega.size)
    of_candidate = csr_array((np.ones(index.size), (owner, np.arange(index.size))), shape=(len(terms), index.size))
    return weights.tocsr(), index, z / (1.0 + z * end_receptance[index]), of_candidate


def _impedances(track: Track, term: PhysicsTerm, omega: np.ndarray) -> list[tuple[tuple, np.ndarray]]:
    """(ends, impedance (n_line,)) of every link that a term adds."""
    condensed = term.condensed_links(receptance_observation.SHIFTED_LINES)
    if condensed is not None:
        return condensed
    links = [*term.links(track), *tangent_links((term,), track)]
    return [(tuple(m.ends), m.stiffness + 1j * omega * m.damping - omega**2 * m.mass) for m in links]


LINK_VALUES = ("stiffness", "damping", "mass")


def predict_near(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    new: Terms,
    observations: Sequence[Observation],
    predictions: Sequence[np.ndarray],
) -> list[np.ndarray]:
    """Predictions of a ``Predictor`` with ``new`` terms, a small step from ``terms``.

    Passages are simulated. Receptances follow the links where these differ by their values alone.

    Parameters
    ----------
    predictor : Predictor
        Predicts the recordings of the site.
    values : mapping
        All nuisances of the site, by name.
    terms : sequence of PhysicsTerm
        Effects beside the base model.
    new : sequence of PhysicsTerm
        The terms a small step away.
    observations : sequence of Observation
        Those that are predicted.
    predictions : sequence of (n,) array
        Predictions with ``terms``.

    Returns
    -------
    list of (n,) array
        One per observation.
    """
    predicted: dict[int, np.ndarray] = {}
    if not any(a != b and b.effect_type == "channel" for a, b in zip(terms, new)):
        predicted = _receptances_near(predictor, values, terms, new, observations, predictions)
    for k, o in enumerate(observations):
        if o.name in predictor.aligned_passages:
            aligned = predictor.aligned_passages[o.name]
            predicted[k] = predictor.predict_passage(values, new, aligned, with_probes=False)
    missing = [k for k in range(len(observations)) if k not in predicted]
    predicted |= zip(missing, predictor.predict(values, new, [observations[k] for k in missing]))
    return [predicted[k] for k in range(len(observations))]


def _receptances_near(
    predictor: Predictor,
    values: Values,
    terms: Terms,
    new: Terms,
    observations: Sequence[Observation],
    predictions: Sequence[np.ndarray],
) -> dict[int, np.ndarray]:
    """Predictions of ``predict_near`` of those receptances that differ by values of links alone, by number."""
    near: dict[int, np.ndarray] = {}
    for numbers, samples in predictor.pair_samples(values, terms, observations, new):
        conditions = samples.pairs[0].conditions
        difference = changed_links(samples.sensitivity.model, receptance_observation.track_terms(new, conditions))
        if difference is None:
            continue
        factors = samples.channel_factors(lambda pair: predictor.channel_response(values, terms, pair))
        change = samples.at(receptance_changes(samples.sensitivity, *difference)) * factors
        near |= {k: predictions[k] + d for k, d in zip(numbers, samples.to_observations(change))}
    return near


def changed_links(model: ReceptanceModel, terms: Sequence[PhysicsTerm]) -> tuple[csr_array, np.ndarray] | None:
    """Links by which ``terms`` differ from those of the model.

    Parameters
    ----------
    model : ReceptanceModel
        Model with the old terms.
    terms : sequence of PhysicsTerm
        The new terms.

    Returns
    -------
    ends : (n_link, n) sparse array
        Weights of the degrees of freedom at the ends of each link.
    impedance : (n_link, n_line) array of complex
        Their change. [N/m] The whole is None where more than values differ: another rail, or a link that the model
        has not.
    """
    pairs = list(zip(model.terms, terms))
    if any(type(a) is not type(b) or (a != b and type(b).rail is not PhysicsTerm.rail) for a, b in pairs):
        return None
    old, new = model.links(model.terms), model.links(terms)
    if [k.ends for k in old] != [k.ends for k in new] or any(k.loss_factor for k in (*old, *new)):
        return None
    differs = [(a, b) for a, b in zip(old, new) if a != b]
    values = np.array([[getattr(b, name) - getattr(a, name) for name in LINK_VALUES] for a, b in differs]).reshape(
        -1, 3
    )
    omega = 2.0 * np.pi * receptance_observation.SHIFTED_LINES
    impedance = values @ np.array([np.ones(omega.size), 1j * omega, -(omega**2)])
    vectors = [link_vector(a, model.matrices.index) for a, _ in differs]
    first = np.cumsum([0, *(rows.size for rows, _ in vectors)])
    rows = np.concatenate([np.zeros(0, dtype=int), *(rows for rows, _ in vectors)])
    weights = np.concatenate([np.zeros(0), *(weights for _, weights in vectors)])
    return csr_array((weights, rows, first), shape=(len(differs), model.matrices.n)), impedance


def receptance_changes(sensitivity: ReceptanceSensitivity, ends: csr_array, impedance: np.ndarray) -> np.ndarray:
    r"""Changes of the receptances of all pairs [m/N] by links whose impedance changes by z.

    Each is :math:`-\sum z\,u_w v_w` with u and v the motion of their ends under unit forces at impact and sensor.

    Parameters
    ----------
    sensitivity : ReceptanceSensitivity
        Receptances and their derivatives.
    ends : (n_link, n) sparse array
        Weights of the degrees of freedom at the ends of each link.
    impedance : (n_link, n_line) array of complex
        Change of each link. [N/m]

    Returns
    -------
    (n_pair, n_line) array of complex
        [m/N]
    """
    u, v = sensitivity.motions(ends)
    return -np.einsum("pwl,pwl,wl->pl", u, v, impedance)
