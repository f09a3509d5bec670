"""Leaders of a search: fitted to convergence, moved to the best position, restarted where they explain too little."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.joint_problem import cost_at
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.search import Search


def polish(search: Search, fit: Fit, score: Score) -> Score:
    """A leader refitted to convergence, with derivatives of its own: the verdict rests on these.

    Parameters
    ----------
    search : Search
    fit : Fit
        Without the leader.
    score : Score
        The leader.

    Returns
    -------
    Score
    """
    key = search.key_of("polished", score, fit)
    refit = search.stored_fit(key, lambda: search.converge(score.fit), score.fit.candidates)
    assert refit is not None
    return score_of(search, fit, refit, score.candidate)


def at_best_position(search: Search, fit: Fit, score: Score) -> Score:
    """A leader fitted to convergence at the best position that is reached by steps to a better neighbour.

    The position was chosen by the cheap observations, or by columns of one size. It is a parameter like others, but
    with steps of its own: the effect is tried at the next positions, from the leader's size and nuisances.

    Parameters
    ----------
    search : Search
    fit : Fit
        Without the leader.
    score : Score
        The leader, fitted to convergence.

    Returns
    -------
    Score
        The same where no neighbour gains more, and for an effect without a position.
    """
    while True:
        trials = [_score_at(search, fit, score, neighbour) for neighbour in _neighbours(search.case, score.candidate)]
        best = max((s for s in trials if s is not None), key=lambda s: s.gain, default=score)
        if best.gain <= score.gain:
            return score
        score = polish(search, fit, best)


def _score_at(search: Search, fit: Fit, score: Score, neighbour: Candidate) -> Score | None:
    """Score of the effect at a neighbouring position. The fit ends where it does not promise to cost less."""

    def compute() -> Fit | None:
        leader = score.fit
        candidates = (*fit.candidates, neighbour)
        try:
            return search.fit(candidates, leader.psi, leader.values, leader.jacobian, sought_cost=leader.cost)
        except SimulationError:
            return None

    key = search.key_of(f"at {neighbour.key}", score, fit)
    refit = search.stored_fit(key, compute, (*fit.candidates, neighbour))
    return None if refit is None else score_of(search, fit, refit, neighbour)


def _neighbours(case: Case, candidate: Candidate) -> list[Candidate]:
    """The candidates of the same effect at the next position before and behind. [] if it has no position."""
    place = candidate.where.get("place")
    if not isinstance(place, (int, float)):
        return []
    others = [c for c in case.candidates if c.family == candidate.family and c.key != candidate.key]
    before = max((c for c in others if c.where["place"] < place), key=lambda c: c.where["place"], default=None)
    behind = min((c for c in others if c.where["place"] > place), key=lambda c: c.where["place"], default=None)
    return [c for c in (before, behind) if c is not None]


def restart_leader(search: Search, fit: Fit, score: Score) -> Score:
    """The better of a leader that explains too little and its restart. Other leaders stay.

    The restart begins at the least costly of smaller sizes, with all nuisances that can mask an effect at their priors.
    A base fit that imitates a large effect has local minima, and so has an effect that lifts wheels off the rail.

    Parameters
    ----------
    search : Search
    fit : Fit
        Without the leader.
    score : Score
        The leader.

    Returns
    -------
    Score
    """
    if score.explained >= search.settings.explained or not score.candidate.parameters:
        return score
    reset_values = score.fit.values | search.prior_values()

    def compute() -> Fit | None:
        try:
            psi = _cheapest_psi(search.case, score, reset_values)
            return search.converge(search.fit(score.fit.candidates, psi, reset_values))
        except SimulationError:
            return None

    refit = search.stored_fit(search.key_of("again", score, fit), compute, score.fit.candidates)
    restarted = score if refit is None else score_of(search, fit, refit, score.candidate)
    return max(score, restarted, key=lambda s: s.gain)


def _cheapest_psi(case: Case, score: Score, values: dict[str, float]) -> np.ndarray:
    """``psi`` with the first two parameters of the leader at those shares of their values that cost least."""
    candidate, psi_slice = score.candidate, score.fit.part(score.candidate)
    sizes, costs = score.fit.psi[psi_slice], []
    for shares in product(THRESHOLDS.size_factors, repeat=min(2, sizes.size)):
        psi, size = np.array(score.fit.psi), np.array(sizes)
        size[0] = candidate.neutral[0] + shares[0] * (sizes[0] - candidate.neutral[0])
        size[1 : len(shares)] = sizes[1 : len(shares)] * shares[1:]
        psi[psi_slice] = [np.clip(v, *p.bounds) for v, p in zip(size, candidate.parameters)]
        try:
            costs.append((cost_at(case, score.fit.candidates, psi, values), tuple(psi)))
        except SimulationError:
            continue
    if not costs:
        raise SimulationError(f"{candidate.key} cannot be simulated at any size")
    return np.array(min(costs)[1])
