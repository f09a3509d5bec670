"""Leaders of a search: fitted to convergence, moved to the best position, restarted where they explain too little."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.joint_problem import cost_at
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.candidate_search import RefitTask
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.search import Search


SITE_COORDINATES = ("place", "sleepers")  # along which a site has neighbours: its position [m] and its length


def refit_to_convergence(search: Search, fit: Fit, score: Score) -> Score:
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

    The position was chosen by the hammer tests alone, or by columns of one size. It is a parameter like others, but
    with steps of its own: the effect is tried at the next positions, from the leader's size and nuisances. So are the
    lengths of a stretch, and its two ends. Each site is tried once. Positions whose evidence is hardly smaller are kept
    as ``possible_positions``.

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
        The same where no neighbour gains more or nearly as much, and for an effect without a position.
    """
    gains = {score.candidate.key: score.gain}
    while True:
        trials = _trials_beside(search, fit, score, score.candidate, gains)
        best = max(trials, key=lambda s: s.gain, default=score)
        if best.gain <= score.gain:
            break
        moved = refit_to_convergence(search, fit, best)
        if moved.gain <= score.gain:  # smaller in evidence, though it costs no more
            break
        score = moved
    return _with_possible_positions(search, fit, score, gains)


def _trials_beside(
    search: Search, fit: Fit, score: Score, candidate: Candidate, gains: dict[str, float]
) -> list[Score]:
    """Scores of the leader's effect at the neighbours of a candidate that ``gains`` lacks; it has them afterwards."""
    neighbours = [c for c in _neighbours(search.case, candidate) if c.key not in gains]
    trials = [s for s in (_score_at(search, fit, score, c) for c in neighbours) if s is not None]
    gains.update(dict.fromkeys((c.key for c in neighbours), -np.inf))
    gains.update((s.candidate.key, s.gain) for s in trials)
    return trials


def _with_possible_positions(search: Search, fit: Fit, score: Score, gains: dict[str, float]) -> Score:
    """The score with the first and last position that are possible, sought outwards; the same if there is only one."""
    least_gain = score.gain - THRESHOLDS.position_margin
    possible, outermost = {score.candidate.key: score.candidate}, [score.candidate]
    while outermost:
        candidate = outermost.pop()
        _trials_beside(search, fit, score, candidate, gains)
        close = [c for c in _neighbours(search.case, candidate) if gains[c.key] > least_gain and c.key not in possible]
        possible.update((c.key, c) for c in close)
        outermost += close
    positions = sorted({c.position for c in possible.values() if c.position is not None})
    return replace(score, possible_positions=(positions[0], positions[-1])) if len(positions) > 1 else score


def _score_at(search: Search, fit: Fit, score: Score, neighbour: Candidate) -> Score | None:
    """Score of the effect at a neighbouring position.

    The fit ends where it promises neither to cost less nor to come so close that the position is possible. A cost is
    twice as large as the evidence it stands for.
    """

    def compute() -> Fit | None:
        leader = score.fit
        candidates = (*fit.candidates, neighbour)
        sought_cost = leader.cost + 2.0 * THRESHOLDS.position_margin
        try:
            return search.fit(candidates, leader.psi, leader.values, leader.jacobian, sought_cost=sought_cost)
        except SimulationError:
            return None

    key = search.key_of(f"at {neighbour.key}", score, fit)
    refit = search.stored_fit(key, compute, (*fit.candidates, neighbour))
    return None if refit is None else score_of(search, fit, refit, neighbour)


def _neighbours(case: Case, candidate: Candidate) -> list[Candidate]:
    """The candidates that differ from this one by at most one step of each coordinate; [] if it has no position.

    A stretch whose one end moves has another middle and another length.
    """
    if candidate.position is None:
        return []
    tested = (*case.candidates, *case.finer_candidates(candidate))
    alike = [c for c in tested if c.family == candidate.family and c.position is not None]
    alike = [c for c in alike if _differs_in_coordinates(c, candidate)]
    keys = [key for key in SITE_COORDINATES if key in candidate.where]
    coordinates = {key: sorted({c.where[key] for c in (candidate, *alike)}) for key in keys}

    def largest_step(neighbour: Candidate) -> int:
        return max(abs(v.index(neighbour.where[key]) - v.index(candidate.where[key])) for key, v in coordinates.items())

    return [c for c in alike if largest_step(c) == 1]


def _differs_in_coordinates(first: Candidate, second: Candidate) -> bool:
    """Whether two candidates of one effect have the same coordinates, and differ in these alone or in the sleeper."""
    a, b = ({k: v for k, v in c.where.items() if k not in (*SITE_COORDINATES, "sleeper")} for c in (first, second))
    return a == b and all((key in first.where) == (key in second.where) for key in SITE_COORDINATES)


def start_from_priors(search: Search, fit: Fit, task: RefitTask) -> Score | None:
    """Score of a candidate fitted from the priors of all shared nuisances that can mask it.

    The fit goes on to convergence if it leads to a gain of half a threshold.

    Parameters
    ----------
    search : Search
    fit : Fit
        Without the candidate.
    task : RefitTask
        The candidate and its start. Its nuisance values are not used.

    Returns
    -------
    Score or None
        None if the simulation fails.
    """
    candidates = (*fit.candidates, task.candidate)
    psi = np.concatenate([fit.psi, task.start])
    values, sought_cost = fit.values | search.prior_values(), search.least_cost_of_interest(fit)

    def compute() -> Fit | None:
        try:
            refit = search.fit(candidates, psi, values, sought_cost=sought_cost)
            return search.converge(refit) if refit.cost < sought_cost else refit
        except SimulationError:
            return None

    key = f"{search.label}:priors:{task.candidate.key}:{tuple(np.round(psi, 12))}"
    refit = search.stored_fit(key, compute, candidates)
    return None if refit is None else score_of(search, fit, refit, task.candidate)


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
            psi = _lowest_cost_psi(search.case, score, reset_values)
            return search.converge(search.fit(score.fit.candidates, psi, reset_values))
        except SimulationError:
            return None

    refit = search.stored_fit(search.key_of("again", score, fit), compute, score.fit.candidates)
    restarted = score if refit is None else score_of(search, fit, refit, score.candidate)
    return max(score, restarted, key=lambda s: s.gain)


def _lowest_cost_psi(case: Case, score: Score, values: dict[str, float]) -> np.ndarray:
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
