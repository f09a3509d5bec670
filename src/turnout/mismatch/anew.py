"""A leader that explains too little, begun again from smaller sizes and an unbent base."""

from itertools import product

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.ends import ended, kept
from turnout.mismatch.joint import cost_at, fit_jointly
from turnout.mismatch.scoring import score_of

SIZES = (1.0, 0.75, 0.5)  # of a leader's first two parameters: its waves turn with both


def begun_anew(case, fit, score, settings, store, effect):
    """A leader that explains too little of what is there, begun again at the least costly of smaller sizes about its
    own, with what the base may have bent at its prior: a base bent to stand for a large effect, and an effect that
    throws wheels off the rail, have valleys beside the one that is deepest. The better of both."""
    if score.explained >= settings.explained or not score.candidate.parameters:
        return score
    unbent = score.fit.values | {n.name: n.mean for n in case.nuisances if n.owner is None and n.bends}
    key = f"{effect}:anew:{score.candidate.key}:{len(fit.candidates)}:{tuple(np.round(score.fit.psi, 12))}"

    def made():
        try:
            psi = _cheapest(case, score, unbent)
            refit = fit_jointly(case, score.fit.candidates, psi, unbent, iterations=settings.iterations)
            return ended(case, refit, settings)
        except SimulationError:
            return None

    refit = kept(store, key, made, score.fit.candidates)
    again = score if refit is None else score_of(case, fit, refit, score.candidate, settings)
    return max(score, again, key=lambda s: s.gain)


def _cheapest(case, score, values):
    """``psi`` with the first two parameters of the leader at the shares of its own that cost least."""
    candidate, mine = score.candidate, score.fit.part(score.candidate)
    own, found = score.fit.psi[mine], []
    for shares in product(SIZES, repeat=min(2, own.size)):
        psi, size = np.array(score.fit.psi), np.array(own)
        size[0] = candidate.neutral[0] + shares[0] * (own[0] - candidate.neutral[0])
        size[1 : len(shares)] = own[1 : len(shares)] * shares[1:]
        psi[mine] = [np.clip(v, *p.bounds) for v, p in zip(size, candidate.parameters)]
        try:
            found.append((cost_at(case, score.fit.candidates, psi, values), tuple(psi)))
        except SimulationError:
            continue
    if not found:
        raise SimulationError(f"{candidate.key} cannot be simulated at any size")
    return np.array(min(found)[1])
