"""Receptances with parameters of terms moved a little: exact to first order, and nothing is solved again."""

import numpy as np
from scipy.sparse import csr_array

from turnout.mismatch.track import blows
from turnout.physics.term import PhysicsTerm
from turnout.simulate.matrices import link_vector

WHAT = ("stiffness", "damping", "mass")


def moved(case, values, terms, new, observations, predictions):
    """Predictions of a track case with ``new`` terms, a small step from ``terms``: passages are simulated, receptances
    follow the links where these differ by their values alone."""
    found, heard_by, known = [], case.blow_models(values, terms), {}
    anew = any(a != b and b.kind == "channel" for a, b in zip(terms, new))
    for o, old in zip(observations, predictions):
        if o.name in case.pairs and not anew:
            pair = case.pairs[o.name]
            heard, said = heard_by(pair), tuple(sorted(pair.conditions.items()))
            if said not in known:
                known[said] = nudged(heard.model, blows.shown(new, pair.conditions))
            if known[said] is not None:
                change = changed(heard, pair, *known[said])
                found.append(old + blows.split(blows.scaled(pair, change, case.chain(values, terms, pair))))
                continue
        found += case.predict(values, new, [o])
    return found


def nudged(model, terms):
    """Ends (n_link, n) and impedances (n_link, n_line) by which the links of ``terms`` differ from the model's own;
    None where they differ by more than values: another rail, a link that was not there."""
    pairs = list(zip(model.terms, terms))
    if any(type(a) is not type(b) or (a != b and type(b).rail is not PhysicsTerm.rail) for a, b in pairs):
        return None
    old, new = model.links(model.terms), model.links(terms)
    if [k.ends for k in old] != [k.ends for k in new] or any(k.loss_factor for k in (*old, *new)):
        return None
    differs = [(a, b) for a, b in zip(old, new) if a != b]
    values = np.array([[getattr(b, w) - getattr(a, w) for w in WHAT] for a, b in differs]).reshape(-1, 3)
    omega = 2.0 * np.pi * blows.SHIFTED
    impedance = values @ np.array([np.ones(omega.size), 1j * omega, -(omega**2)])
    vectors = [link_vector(a, model.matrices.index) for a, _ in differs]
    first = np.cumsum([0, *(rows.size for rows, _ in vectors)])
    rows = np.concatenate([np.zeros(0, dtype=int), *(rows for rows, _ in vectors)])
    weights = np.concatenate([np.zeros(0), *(weights for _, weights in vectors)])
    return csr_array((weights, rows, first), shape=(len(differs), model.matrices.n)), impedance


def changed(heard, pair, ends, impedance):
    r"""(n_line,) complex change of a pair's receptance [m/N] by links whose impedance changes by z:
    :math:`-\sum z\,u_w v_w`, u and v the motion of their ends under unit forces at blow and sensor."""
    u, v = heard.motion(ends, pair)
    return -np.sum(impedance * u * v, axis=0)
