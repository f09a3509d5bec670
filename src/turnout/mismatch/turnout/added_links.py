"""Changes of receptances by links that candidates add: exact for one link, without another solution of the track."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array, lil_array

from turnout.mismatch.turnout import receptance_observation
from turnout.mismatch.turnout.receptance_model import tangent_links
from turnout.simulate.links import links_of, with_links

if TYPE_CHECKING:
    from collections.abc import Hashable, Sequence
    from typing import TypeAlias

    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.turnout.prediction import Predictor
    from turnout.mismatch.turnout.predictions import Terms, Values
    from turnout.mismatch.turnout.receptance_model import ReceptanceModel
    from turnout.mismatch.turnout.receptance_observation import FrfPair
    from turnout.mismatch.turnout.receptance_sensitivity import ReceptanceSensitivity
    from turnout.physics.term import PhysicsTerm
    from turnout.simulate.track import Track

    # motion of the ends of links under impact and sensor, end, response and term of each link
    LinkResponses: TypeAlias = tuple[tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray, csr_array]


class AddedLinks:
    """Changes of receptances about ``values`` and ``terms`` by each of ``chosen`` [(candidate, start)].

    The response of the added links is computed once for all pairs under the same conditions.
    """

    def __init__(self, predictor: Predictor, values: Values, terms: Terms, chosen: Sequence[tuple[Candidate, int]]):
        self.predictor, self.values, self.terms, self.chosen = predictor, values, terms, chosen
        self._by_conditions: dict[Hashable, LinkResponses] = {}
        self._by_terms: dict[Hashable, LinkResponses] = {}

    def changes(self, pair: FrfPair) -> dict[tuple[str, int], np.ndarray]:
        r"""Change of the observation of a pair by each candidate at each of its starts.

        One link w with impedance z changes a receptance by :math:`-z\,u_w v_w / (1 + z\,g_w)`. Here u and v are the
        motion of its ends under unit forces at impact and sensor, g that under unit forces at its own ends. Several
        links of one candidate are treated as independent.

        Parameters
        ----------
        pair : FrfPair
            Pair of impact position and sensor.

        Returns
        -------
        dict of (str, int) to (n,) array of float
            (key, start) -> change.
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
    condensed = term.condensed_links(track, receptance_observation.SHIFTED_LINES)
    if condensed is not None:
        return condensed
    links = [*term.links(track), *tangent_links((term,), track)]
    return [(tuple(m.ends), m.stiffness + 1j * omega * m.damping - omega**2 * m.mass) for m in links]
