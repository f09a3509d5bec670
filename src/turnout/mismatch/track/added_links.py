"""What links added to a track change in its receptances, exactly and without solving it again."""

import numpy as np
from scipy.sparse import lil_array

from turnout.mismatch.track import blows
from turnout.mismatch.track.blow_model import tangent
from turnout.simulate.links import left, links_of


class AddedLinks:
    """Changes of receptances about a fit by each of ``chosen`` [(candidate, start)]; what these add is asked once for
    all pairs under the same conditions."""

    def __init__(self, case, fit, chosen):
        self.case, self.fit, self.chosen, self.known = case, fit, chosen, {}

    def changes(self, pair):
        r"""(key, start) -> (n,) change of a pair's observation.

        One link w with impedance z changes a receptance by :math:`-z\,u_w v_w / (1 + z\,g_w)`, u and v the motion of
        its ends under the blow and under a force at the sensor, g under a pair of forces at its own ends; several links
        of one candidate are taken as if each were alone.
        """
        case, fit, chosen = self.case, self.fit, self.chosen
        if not chosen:
            return {}
        heard = case.blow_model(fit.values, fit.terms, pair)
        said = tuple(sorted(pair.conditions.items()))
        if said not in self.known:
            self.known[said] = _answers(heard.model, pair.conditions, chosen)
        ends, index, answer, owner = self.known[said]
        u, v = (x.T for x in heard.motion(ends, pair))
        change = np.zeros((blows.LINES.size, len(chosen)), dtype=complex)
        np.add.at(change.T, owner, -(answer * (u * v)[:, index]).T)
        columns = blows.split(blows.scaled(pair, change, case.chain(fit.values, fit.terms, pair)))
        return {(c.key, k): column for (c, k), column in zip(chosen, columns.T)}


def _answers(model, conditions, chosen):
    """(ends (n_end, n), which end each link has, z / (1 + z g) of each (n_line, n_link), candidate of each link)."""
    omega, known, index, impedance, owner = 2.0 * np.pi * blows.SHIFTED, {}, [], [], []
    track = left(model.track, links_of(model.terms, model.track))
    for i, (c, k) in enumerate(chosen):
        for ends, z in _impedances(track, c, c.term(c.starts[k]).under(conditions), omega):
            index.append(known.setdefault(ends, len(known)))
            impedance.append(z)
            owner.append(i)
    weights = lil_array((len(known), model.matrices.n))
    own = np.empty((omega.size, len(known)), dtype=complex)
    for ends, k in known.items():
        pushed = sum(weight * model.displacement(name) for name, weight in ends)
        own[:, k] = sum(weight * pushed[:, model.matrices.index[name]] for name, weight in ends)
        for name, weight in ends:
            weights[k, model.matrices.index[name]] += weight
    index, z = np.array(index, dtype=int), np.array(impedance).reshape(-1, omega.size).T
    return weights.tocsr(), index, z / (1.0 + z * own[:, index]), np.array(owner, dtype=int)


def _impedances(track, candidate, term, omega):
    """(ends, impedance (n_line,)) of every link that a term adds."""
    if candidate.family == "attached_resonator":
        return [(((("rail", candidate.where["sleeper"]), 1.0),), term.dynamic_stiffness(blows.SHIFTED))]
    links = [*term.links(track), *tangent((term,), track)]
    return [(tuple(m.ends), m.stiffness + 1j * omega * m.damping - omega**2 * m.mass) for m in links]
