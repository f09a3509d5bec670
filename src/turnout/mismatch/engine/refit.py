"""Joint refits of the shortlisted candidates on top of a fit: starts, convergence, and the score of each.

Fits are stored by key.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate_search import Entry, RefitTask, prescreened_entries, shortlist
from turnout.mismatch.engine.cross_validation import gain_where_unmasked, held_out_score
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.joint_problem import JointProblem, cost_at
from turnout.mismatch.engine.leaders import at_best_position, refit_to_convergence, restart_leader, start_from_priors
from turnout.mismatch.engine.single_source import single_sensor, single_source
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.search import Search


def score_candidates(search: Search, fit: Fit, promising: Collection[str] | None = ()) -> tuple[tuple[Score, ...], Fit]:
    """Best score of each family, all refitted jointly on top of ``fit``.

    If ``fit`` proves to have stopped a threshold before its optimum, it is continued from the leader's nuisances, and
    all candidates are scored again on top of it.

    Parameters
    ----------
    search : Search
    fit : Fit
        Without the candidates.
    promising : collection of str or None
        Families that are tried on the hammer tests on top of a first effect. None: all.

    Returns
    -------
    scores : tuple of Score
        The largest gain first.
    fit : Fit
        The fit on top of which they were scored.
    """
    prescreened = prescreened_entries(search, fit, promising)
    ranked = _rank_families(search, fit, prescreened)
    continued = _base_from_leader(search, fit, ranked)
    if continued is not None and continued.evidence - fit.evidence > search.settings.threshold:
        fit, search = continued, search.with_label(f"{search.label}:again")
        ranked = _rank_families(search, fit, prescreened)
        continued = _base_from_leader(search, fit, ranked)
    if continued is not None:  # the shortfall of the base fit is no evidence
        shortfall = max(0.0, continued.evidence - fit.evidence)
        ranked = [replace(s, gain=s.gain - shortfall) for s in ranked]
    if search.case.is_large and ranked:
        ranked = correct_for_leader(search, fit, ranked)
    return tuple(_with_condition_gains(search, fit, s) for s in ranked), fit


def _rank_families(search: Search, fit: Fit, prescreened: Sequence[Entry]) -> list[Score]:
    """Best score of each family on top of ``fit``, leaders fitted to convergence."""
    tasks = shortlist(search, fit, prescreened)
    scores: dict[str, Score] = {}
    best_gain, min_gain = -np.inf, THRESHOLDS.min_component_gain * search.settings.threshold
    for index, task in enumerate(tasks):
        if task.rival:
            if best_gain < min_gain:
                continue
            task = _start_like_component(task, scores.values())
        score = _score_task(search, fit, task, best_gain)
        search.report(index + 1, len(tasks), task.candidate.key)
        if score is None:
            continue
        best_gain, previous = max(best_gain, score.gain), scores.get(score.family)
        if previous is None or score.gain > previous.gain:
            scores[score.family] = score
    for score in _restart_unkept_promises(search, fit, tasks, scores):
        if score.family not in scores or score.gain > scores[score.family].gain:
            scores[score.family] = score
    ranked = sorted(scores.values(), key=lambda s: -s.gain)
    return _refine_leaders(search, fit, ranked) if search.case.is_large and ranked else ranked


def _restart_unkept_promises(
    search: Search, fit: Fit, tasks: Sequence[RefitTask], scores: Mapping[str, Score]
) -> list[Score]:
    """Scores of the tasks that promised a name while their family gained none, fitted again from the priors.

    A base fit that imitates an effect has local minima. [] if any refit gains a name, or beside another effect. The
    best one moves along the track.
    """
    threshold = search.settings.threshold
    gains = {s.family: s.gain for s in scores.values()}
    has_name = any(s.is_reportable and s.gain > threshold for s in scores.values())
    if not search.case.is_large or fit.candidates or has_name:
        return []
    without_gain = [t for t in tasks if not t.rival and t.promise > threshold >= gains.get(t.candidate.family, -np.inf)]
    restarted = [s for s in (start_from_priors(search, fit, task) for task in without_gain) if s is not None]
    if not restarted:
        return []
    best, *others = sorted(restarted, key=lambda s: -s.gain)
    return [at_best_position(search, fit, best), *(replace(s, fit=s.fit.without_jacobian()) for s in others)]


def _refine_leaders(search: Search, fit: Fit, ranked: list[Score]) -> list[Score]:
    """The scores of a large case, with leaders fitted to convergence and forms of one effect compared."""
    settings = search.settings
    ranked = _refit_equivalent_forms(search, fit, ranked)
    reportable = [s for s in ranked if s.is_reportable][:2]
    min_close_gain = (
        min(reportable[0].gain - settings.margin, THRESHOLDS.min_held_share * reportable[0].gain) if reportable else 0.0
    )
    leaders = [s for s in reportable if s.gain > max(THRESHOLDS.min_leader_gain * settings.threshold, min_close_gain)]
    converged = [at_best_position(search, fit, refit_to_convergence(search, fit, s)) for s in leaders]
    if converged and not fit.candidates:  # beside another effect the residual is also an error in its shape
        converged[0] = restart_leader(search, fit, converged[0])
    return sorted([*converged, *(s for s in ranked if all(s is not x for x in leaders))], key=lambda s: -s.gain)


def _base_from_leader(search: Search, fit: Fit, ranked: Sequence[Score]) -> Fit | None:
    """``fit`` computed again from the leader's nuisances, to convergence.

    If the leader is far above the threshold, the fit ends where it does not lead a threshold below ``fit``. None if
    nobody leads, the case is small, or the simulation fails.
    """
    if not search.case.is_large or not ranked or ranked[0].gain <= search.settings.threshold:
        return None
    leader, threshold = ranked[0], search.settings.threshold
    is_strong = leader.gain > THRESHOLDS.far_start_gain * threshold  # a small shortfall is none of its evidence
    sought_cost = fit.cost - 2.0 * threshold if is_strong else np.inf

    def compute() -> Fit | None:
        try:
            refit = search.fit(
                fit.candidates, fit.psi, leader.fit.values, stall=THRESHOLDS.fine_stall, sought_cost=sought_cost
            )
            return search.converge(refit) if refit.cost < sought_cost else refit
        except SimulationError:
            return None

    return search.stored_fit(search.key_of("back", leader, fit), compute, fit.candidates)


def _refit_equivalent_forms(search: Search, fit: Fit, ranked: list[Score]) -> list[Score]:
    """The scores, with equivalent families refitted from the leader's nuisances, which suit them as well.

    Equivalent are families that cannot be distinguished from the leader as fitted: its ``limit_form`` and
    ``simpler_form``. A limit form equals the leader at its largest sizes, where its own fit may never have been: its
    refit begins at the least costly of its estimate and its starts.
    """
    leader = ranked[0]
    for k, score in enumerate(ranked[1:], 1):
        is_equivalent = score.is_limit_of(leader) or score.is_simpler_form_of(leader)
        if leader.gain > search.settings.threshold and is_equivalent:
            task = RefitTask(score.candidate, score.estimates[0], leader.fit.values)
            refitted = _score_task(search.with_label(f"{search.label}:beside"), fit, task)
            if refitted is not None and refitted.gain > score.gain:
                ranked[k] = refitted
    return sorted(ranked, key=lambda s: -s.gain)


def correct_for_leader(search: Search, fit: Fit, ranked: list[Score]) -> list[Score]:
    """The scores, with the best reportable one reduced to its gain on top of the leader.

    This applies if a leader that is not reportable leads by more than the margin. An effect of the whole track that is
    too small to matter may be what another effect took for itself.

    Parameters
    ----------
    search : Search
    fit : Fit
        Without the candidates.
    ranked : list of Score
        The largest gain first.

    Returns
    -------
    list of Score
        The largest gain first.
    """
    settings, leader, rival = search.settings, ranked[0], next((s for s in ranked if s.is_reportable), None)
    if rival is None or leader.gain - rival.gain <= settings.margin or rival.gain <= settings.threshold:
        return ranked
    leader_fit, rival_psi = leader.fit, rival.fit.psi[fit.psi.size :]
    neutral_psi = np.concatenate([fit.psi, leader.candidate.neutral])
    optima = ((leader_fit.psi, leader_fit.values), (neutral_psi, rival.fit.values))  # of either
    fits, candidates = [], (*leader_fit.candidates, rival.candidate)
    for psi, values in optima:
        try:
            fits.append(search.fit(candidates, np.concatenate([psi, rival_psi]), values))
        except SimulationError:
            continue
    if not fits:
        return ranked
    gain_left = (
        max(f.evidence for f in fits)
        - leader_fit.evidence
        + rival.candidate.naming.external_evidence
        - np.log(rival.candidate.site.n_scanned)
    )
    return sorted((replace(s, gain=min(s.gain, gain_left)) if s is rival else s for s in ranked), key=lambda s: -s.gain)


def _start_like_component(task: RefitTask, scores: Iterable[Score]) -> RefitTask:
    """The rival with the nuisances of the best effect of its component: they nearly suit it."""
    relatives = [s for s in scores if s.candidate.part == task.candidate.part]
    return replace(task, values=max(relatives, key=lambda s: s.gain).fit.values) if relatives else task


def _score_task(search: Search, fit: Fit, task: RefitTask, best_gain: float = 0.0) -> Score | None:
    """Score of a task of the shortlist after its joint refit. None if the simulation fails.

    A refit that gains less than its promise is continued. A fault of a channel starts with derivatives of its own if it
    promises much. It is continued only if ``best_gain`` so far is within its reach.
    """
    threshold, candidate, is_channel = search.settings.threshold, task.candidate, task.candidate.frame == "sensor"
    accepted = "+".join(c.key for c in fit.candidates)
    key = f"{search.label}:{accepted}:{candidate.key}:{tuple(np.round(task.start, 12))}"
    is_far = is_channel and task.hammer_gain > THRESHOLDS.far_start_gain * threshold
    refit = search.stored_fit(key, lambda: _refit(search, fit, task, is_far), (*fit.candidates, candidate))
    if refit is None:
        return None
    score = score_of(search, fit, refit, candidate)
    if not search.case.is_large:
        return score
    min_hammer_gain = max(threshold, THRESHOLDS.min_held_share * best_gain if is_channel else 0.0)
    if score.gain < THRESHOLDS.min_held_share * task.hammer_gain and task.hammer_gain > min_hammer_gain:
        return refit_to_convergence(search, fit, score)
    return score


def _with_condition_gains(search: Search, fit: Fit, score: Score) -> Score:
    """A leader of a large case, with its gain condition by condition, each left out in turn."""
    case = search.case
    if not case.is_large or not score.fit.jacobian:
        return score
    with_candidate, without_candidate = held_out_score(case, score.fit), held_out_score(case, fit)
    by_condition = {c: with_candidate[c] - without_candidate[c] for c in without_candidate}
    source = ""
    if score.is_reportable:
        source = single_source(search, score.fit, score.candidate, score.gain, by_condition)
        source = source or single_sensor(search, fit, score)
    worst_gain, unmasked_gain = min(by_condition.values(), default=0.0), gain_where_unmasked(case, fit, by_condition)
    return replace(
        score, worst_gain=worst_gain, by_condition=by_condition, single_source=source, unmasked_gain=unmasked_gain
    )


def _refit(search: Search, fit: Fit, task: RefitTask, is_far: bool) -> Fit | None:
    """Joint refit of a task. None if the simulation fails."""
    case, candidate = search.case, task.candidate
    psi = np.concatenate([fit.psi, task.start])
    candidates = (*fit.candidates, candidate)
    values = {**fit.values, **task.values}
    if not candidate.refit.from_base and not task.values:  # nuisances that can mask an effect return to their priors
        values |= search.prior_values()
    try:
        psi = _best_start(case, candidates, psi, values)
        if candidate.refit.from_base and not task.values:
            psi = _backtrack(case, candidates, psi, fit)
        jacobian = _start_jacobian(case, fit, candidates, psi, values, is_far)
        refit = search.fit(candidates, psi, values, jacobian, sought_cost=search.least_cost_of_interest(fit))
    except SimulationError:
        return None
    return refit.without_jacobian() if case.is_large else refit


def _start_jacobian(
    case: Case,
    fit: Fit,
    candidates: tuple[Candidate, ...],
    psi: np.ndarray,
    values: dict[str, float],
    is_far: bool,
) -> list[np.ndarray] | None:
    """Derivatives from which a refit of a large case starts: those of ``fit``, new ones if ``is_far``."""
    if not case.is_large or not is_far:
        return fit.jacobian if case.is_large else None
    joint = JointProblem(case, candidates)
    theta = np.concatenate([[values.get(n.name, n.mean) for n in case.nuisances], psi])
    return joint.jacobian(theta, joint.predict(theta))


def _best_start(case: Case, candidates: tuple[Candidate, ...], psi: np.ndarray, values: dict[str, float]) -> np.ndarray:
    """``psi`` or the last candidate's own starts, whichever costs least.

    The passages decide what the hammer tests do not show.
    """
    candidate = candidates[-1]
    if candidate.refit.from_base and not candidate.refit.sign_ambiguous:
        return psi
    n, costs = psi.size - len(candidate.parameters), []
    alternatives = (candidate.mirror_image(psi[n:]),) if candidate.refit.sign_ambiguous else candidate.starts
    for start in (psi[n:], *alternatives):
        trial = np.concatenate([psi[:n], np.asarray(start, dtype=float)])
        try:
            costs.append((cost_at(case, candidates, trial, values), tuple(trial)))
        except SimulationError:
            continue
    return np.array(min(costs)[1]) if costs else psi


def _backtrack(case: Case, candidates: tuple[Candidate, ...], psi: np.ndarray, fit: Fit) -> np.ndarray:
    """``psi`` with the last candidate nearer to neutral, by halves, until it costs no more than ``fit`` without it.

    The promise of a column need not hold at a large size.
    """
    n, psi = len(candidates[-1].parameters), np.array(psi, dtype=float)
    neutral = candidates[-1].parameters[0].neutral
    for _ in range(THRESHOLDS.max_halvings):
        try:
            if cost_at(case, candidates, psi, fit.values) <= fit.cost:
                break
        except SimulationError:
            pass
        psi[-n] = neutral + 0.5 * (psi[-n] - neutral)
    return psi
