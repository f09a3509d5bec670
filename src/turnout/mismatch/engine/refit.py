"""Joint refits of the shortlisted candidates on top of a fit: starts, convergence, and the score of each.

A leader that explains too little is restarted from smaller sizes. Fits are cached by key.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate_search import RefitTask, shortlist
from turnout.mismatch.engine.cross_validation import gain_where_unmasked, held_out_score, single_witness
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.map_fit import FINE_STALL, STALL, JointProblem, cost_at, fit_jointly

MAX_ROUNDS = 3  # rounds of steps for a leader; one that still gains afterwards is far from any optimum


def converge(case, fit, settings):
    """The fit, continued until a round of steps gains less than a name needs. Each round computes new derivatives."""
    for _ in range(MAX_ROUNDS):
        try:
            before, fit = fit, continue_fit(case, fit, settings, FINE_STALL)
        except SimulationError:
            break
        if fit.evidence - before.evidence < settings.threshold:
            break
    return fit


def continue_fit(case, fit, settings, stall=STALL):
    """The fit continued from where it is, with new derivatives."""
    return fit_jointly(case, fit.candidates, fit.psi, fit.values, iterations=settings.iterations, stall=stall)


def with_jacobian(case, fit, settings):
    """The fit, continued if it has no Jacobian; unchanged if the simulation fails close to it."""
    try:
        return fit if fit.jacobian else continue_fit(case, fit, settings)
    except SimulationError:
        return fit


def cached_fit(store, key, compute, candidates=()):
    """A fit by its key, computed if the store lacks it; stores hold fits without their candidates' functions."""
    if key not in store:
        fit = compute()
        store[key] = fit.with_candidates(()) if fit is not None else None
    fit = store[key]
    return None if fit is None else fit.with_candidates(candidates)


SIZE_FACTORS = (1.0, 0.75, 0.5)  # shares of a leader's first two parameters: its response is nonlinear in both


def restart_leader(case, fit, score, settings, store, effect):
    """The better of a leader that explains too little and its restart. Other leaders stay.

    The restart begins at the least costly of smaller sizes, with all nuisances that can mask an effect at their priors.
    A base fit that imitates a large effect has local minima, and so has an effect that lifts wheels off the rail.
    """
    if score.explained >= settings.explained or not score.candidate.parameters:
        return score
    reset_values = score.fit.values | {n.name: n.mean for n in case.nuisances if n.owner is None and n.can_mask}
    key = f"{effect}:anew:{score.candidate.key}:{len(fit.candidates)}:{tuple(np.round(score.fit.psi, 12))}"

    def compute():
        try:
            psi = _cheapest_psi(case, score, reset_values)
            refit = fit_jointly(case, score.fit.candidates, psi, reset_values, iterations=settings.iterations)
            return converge(case, refit, settings)
        except SimulationError:
            return None

    refit = cached_fit(store, key, compute, score.fit.candidates)
    restarted = score if refit is None else score_of(case, fit, refit, score.candidate, settings)
    return max(score, restarted, key=lambda s: s.gain)


def _cheapest_psi(case, score, values):
    """``psi`` with the first two parameters of the leader at those shares of their values that cost least."""
    candidate, psi_slice = score.candidate, score.fit.part(score.candidate)
    sizes, costs = score.fit.psi[psi_slice], []
    for shares in product(SIZE_FACTORS, repeat=min(2, sizes.size)):
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


MIN_HELD_SHARE = 0.5  # share of the gain from the cheap observations; a refit that gains less has not converged
MIN_COMPONENT_GAIN = 0.5  # thresholds that an effect of a component must gain before its other effects are refitted
MIN_LEADER_GAIN = 0.5  # thresholds of gain from which a leader is fitted to convergence
# Thresholds promised by the cheap observations beyond which a start needs derivatives of its own.
FAR_START_GAIN = 4.0
# Multiple of the promised size from which an effect that gained too little is restarted: the base fit masks part of it.
OVERSHOOT_FACTOR = 2.0
MAX_HALVINGS = 4  # halvings of a start that costs more than no effect; a sixteenth of it is linear


def score_candidates(case, fit, settings, report, store, effect, promising):
    """(best Score of each family, ``fit``), all refitted jointly on top of ``fit``.

    If ``fit`` proves to have stopped a threshold before its optimum, it is continued from the leader's nuisances, and
    all candidates are scored again on top of it.
    """
    ranked = _rank_families(case, fit, settings, report, store, effect, promising)
    continued = _base_from_leader(case, fit, ranked, settings, store, effect)
    if continued is not None and continued.evidence - fit.evidence > settings.threshold:
        fit, effect = continued, f"{effect}:again"
        ranked = _rank_families(case, fit, settings, report, store, effect, promising)
        continued = _base_from_leader(case, fit, ranked, settings, store, effect)
    if continued is not None:  # the shortfall of the base fit is no evidence
        shortfall = max(0.0, continued.evidence - fit.evidence)
        ranked = [replace(s, gain=s.gain - shortfall) for s in ranked]
    if case.expensive and ranked:
        ranked = correct_for_leader(case, fit, ranked, settings)
    return tuple(_with_condition_gains(case, fit, s, settings) for s in ranked), fit


def _rank_families(case, fit, settings, report, store, effect, promising):
    """Best Score of each family on top of ``fit``, leaders fitted to convergence."""
    tasks = shortlist(case, fit, settings, promising)
    scores, best_gain = {}, -np.inf
    for index, task in enumerate(tasks):
        if task.rival:
            if best_gain < MIN_COMPONENT_GAIN * settings.threshold:
                continue
            task = _start_like_component(task, scores)
        score = _score_task(case, fit, task, settings, store, effect, best_gain)
        report(index + 1, len(tasks), task.candidate.key)
        if score is None:
            continue
        best_gain, previous = max(best_gain, score.gain), scores.get(score.family)
        if previous is None or score.gain > previous.gain:
            scores[score.family] = score
    ranked = sorted(scores.values(), key=lambda s: -s.gain)
    if case.expensive and ranked:
        ranked = _refit_equivalent_forms(case, fit, ranked, settings, store, effect)
        material = [s for s in ranked if s.is_reportable][:2]
        min_close_gain = min(material[0].gain - settings.margin, MIN_HELD_SHARE * material[0].gain) if material else 0.0
        leaders = [s for s in material if s.gain > max(MIN_LEADER_GAIN * settings.threshold, min_close_gain)]
        polished = [_polish(case, fit, s, settings, store, effect) for s in leaders]
        if polished and not fit.candidates:  # beside another effect the residual is also an error in its shape
            polished[0] = restart_leader(case, fit, polished[0], settings, store, effect)
        ranked = sorted([*polished, *(s for s in ranked if all(s is not x for x in leaders))], key=lambda s: -s.gain)
    return ranked


def _base_from_leader(case, fit, ranked, settings, store, effect):
    """``fit`` computed again from the leader's nuisances, to convergence.

    None if nobody leads, the case is not expensive, or the simulation fails.
    """
    if not case.expensive or not ranked or ranked[0].gain <= settings.threshold:
        return None
    leader = ranked[0]
    key = f"{effect}:back:{leader.candidate.key}:{len(fit.candidates)}:{tuple(np.round(leader.fit.psi, 12))}"
    return cached_fit(store, key, lambda: _refit_base(case, fit, leader.fit.values, settings), fit.candidates)


def _refit_base(case, fit, values, settings):
    try:
        start = fit_jointly(case, fit.candidates, fit.psi, values, iterations=settings.iterations, stall=FINE_STALL)
        return converge(case, start, settings)
    except SimulationError:
        return None


def _refit_equivalent_forms(case, fit, ranked, settings, store, effect):
    """The scores, with equivalent families refitted from the leader's nuisances, which suit them as well.

    Equivalent are families that cannot be distinguished from the leader as fitted: its ``limit_form`` and
    ``simpler_form``.
    """
    leader = ranked[0]
    for k, score in enumerate(ranked[1:], 1):
        is_equivalent = score.is_limit_of(leader) or score.is_simpler_form_of(leader)
        if leader.gain > settings.threshold and is_equivalent:
            task = RefitTask(score.candidate, score.estimates[0], leader.fit.values)
            refitted = _score_task(case, fit, task, settings, store, f"{effect}:beside")
            if refitted is not None and refitted.gain > score.gain:
                ranked[k] = refitted
    return sorted(ranked, key=lambda s: -s.gain)


def correct_for_leader(case, fit, ranked, settings):
    """The scores, with the best reportable one reduced to its gain on top of the leader.

    This applies if a leader that is not reportable leads by more than the margin. An effect of the whole track that is
    too small to matter may be what another effect took for itself.
    """
    leader, rival = ranked[0], next((s for s in ranked if s.is_reportable), None)
    if rival is None or leader.gain - rival.gain <= settings.margin or rival.gain <= settings.threshold:
        return ranked
    leader_fit, rival_psi = leader.fit, rival.fit.psi[fit.psi.size :]
    neutral_psi = np.concatenate([fit.psi, leader.candidate.neutral])
    fits, candidates = [], (*leader_fit.candidates, rival.candidate)
    for psi, values in (
        (leader_fit.psi, leader_fit.values),
        (neutral_psi, rival.fit.values),
    ):  # from the optimum of either
        start = np.concatenate([psi, rival_psi])
        try:
            fits.append(fit_jointly(case, candidates, start, values, iterations=settings.iterations))
        except SimulationError:
            continue
    if not fits:
        return ranked
    gain_left = (
        max(f.evidence for f in fits)
        - leader_fit.evidence
        + rival.candidate.external_evidence
        - np.log(rival.candidate.n_scanned)
    )
    return sorted((replace(s, gain=min(s.gain, gain_left)) if s is rival else s for s in ranked), key=lambda s: -s.gain)


def _start_like_component(task, scores):
    """The rival with the nuisances of the best effect of its component: they nearly suit it."""
    candidate = task.candidate
    relatives = [s for s in scores.values() if s.candidate.part == candidate.part]
    return replace(task, values=max(relatives, key=lambda s: s.gain).fit.values) if relatives else task


def _score_task(case, fit, task, settings, store, effect, best_gain=0.0):
    """Score of a task of the shortlist after its joint refit. None if the simulation fails.

    A refit that gains less than its promise is continued. A fault of a channel starts with derivatives of its own if it
    promises much. It is continued only if ``best_gain`` so far is within its reach.
    """
    candidate, start, is_channel = task.candidate, task.start, task.candidate.frame == "sensor"
    key = f"{effect}:{'+'.join(c.key for c in fit.candidates)}:{candidate.key}:{tuple(np.round(start, 12))}"
    candidates, is_far = (
        (*fit.candidates, candidate),
        is_channel and task.cheap_gain > FAR_START_GAIN * settings.threshold,
    )
    refit = cached_fit(
        store, key, lambda: _refit(case, fit, candidate, start, task.values, is_far, settings), candidates
    )
    if refit is None:
        return None
    score = score_of(case, fit, refit, candidate, settings)
    whole_track = candidate.n_scanned == 1 and candidate.start_from_base
    if case.expensive and whole_track and score.gain < settings.threshold:
        score = max(score, _score_from_farther(case, fit, task, score, settings, store, key), key=lambda s: s.gain)
    min_cheap_gain = max(settings.threshold, MIN_HELD_SHARE * best_gain if is_channel else 0.0)
    if case.expensive and score.gain < MIN_HELD_SHARE * task.cheap_gain and task.cheap_gain > min_cheap_gain:
        return _polish(case, fit, score, settings, store, effect)
    return score


def _score_from_farther(case, fit, task, score, settings, store, key):
    """Best Score of a task restarted at more than its promised size, once also with maskable nuisances at their priors.

    If common values of the base fit have absorbed part of an effect of the whole track, a small size gains nothing and
    a large one costs more, until these values return. If the waves of the rail absorbed it, they return on no straight
    path. ``score`` if no restart is better, or the simulation fails.
    """
    candidate = task.candidate
    first, start = candidate.parameters[0], np.array(task.start, dtype=float)
    start[0] = np.clip(first.neutral + OVERSHOOT_FACTOR * (start[0] - first.neutral), *first.bounds)
    psi, values = np.concatenate([fit.psi, start]), {**fit.values, **task.values}
    reset_values = values | {n.name: n.mean for n in case.nuisances if n.owner is None and n.can_mask}
    scores = [score]
    for label, start_values in (("farther", values), ("unbent", reset_values)):

        def compute(start_values=start_values):
            try:
                candidates = (*fit.candidates, candidate)
                return fit_jointly(
                    case, candidates, psi, start_values, fit.jacobian, iterations=settings.iterations
                ).without_jacobian()
            except SimulationError:
                return None

        refit = cached_fit(store, f"{key}:{label}", compute, (*fit.candidates, candidate))
        if refit is not None:
            scores.append(score_of(case, fit, refit, candidate, settings))
    return max(scores, key=lambda s: s.gain)


def _polish(case, fit, score, settings, store, effect):
    """A leader refitted to convergence, with derivatives of its own: the verdict rests on these."""
    key = f"{effect}:polished:{score.candidate.key}:{len(fit.candidates)}:{tuple(np.round(score.fit.psi, 12))}"
    refit = cached_fit(store, key, lambda: converge(case, score.fit, settings), score.fit.candidates)
    return score_of(case, fit, refit, score.candidate, settings)


def _with_condition_gains(case, fit, score, settings):
    """A leader of an expensive case with its gain condition by condition, each left out in turn."""
    if not case.expensive or not score.fit.jacobian:
        return score
    with_candidate, without_candidate = held_out_score(case, score.fit), held_out_score(case, fit)
    by_condition = {c: with_candidate[c] - without_candidate[c] for c in without_candidate}
    witness = (
        single_witness(case, score.fit, score.candidate, score.gain, by_condition, settings)
        if score.is_reportable
        else ""
    )
    worst_gain, unmasked_gain = min(by_condition.values(), default=0.0), gain_where_unmasked(case, fit, by_condition)
    return replace(
        score, worst_gain=worst_gain, by_condition=by_condition, single_witness=witness, unmasked_gain=unmasked_gain
    )


def _refit(case, fit, candidate, start, start_values, is_far, settings):
    """Joint refit from this start. None if the simulation fails."""
    psi = np.concatenate([fit.psi, start])
    candidates = (*fit.candidates, candidate)
    values = {**fit.values, **start_values}
    if not candidate.start_from_base and not start_values:  # nuisances that can mask an effect return to their priors
        values |= {n.name: n.mean for n in case.nuisances if n.owner is None and n.can_mask}
    try:
        psi = _best_start(case, candidates, psi, values)
        if candidate.start_from_base and not start_values:
            psi = _backtrack(case, candidates, psi, fit)
        jacobian = _start_jacobian(case, fit, candidates, psi, values, is_far)
        refit = fit_jointly(case, candidates, psi, values, jacobian, iterations=settings.iterations)
    except SimulationError:
        return None
    return refit.without_jacobian() if case.expensive else refit


def _start_jacobian(case, fit, candidates, psi, values, is_far):
    """Derivatives from which a refit of an expensive case starts: those of ``fit``, new ones if ``is_far``."""
    if not case.expensive or not is_far:
        return fit.jacobian if case.expensive else None
    joint = JointProblem(case, candidates)
    theta = np.concatenate([[values.get(n.name, n.mean) for n in case.nuisances], psi])
    return joint.jacobian(theta, joint.predict(theta))


def _best_start(case, candidates, psi, values):
    """``psi`` or the last candidate's own starts, whichever costs least.

    The expensive observations decide what the cheap ones cannot see.
    """
    candidate = candidates[-1]
    if candidate.start_from_base and not candidate.sign_ambiguous:
        return psi
    n, costs = psi.size - len(candidate.parameters), []
    alternatives = (candidate.mirror_image(psi[n:]),) if candidate.sign_ambiguous else candidate.starts
    for start in (psi[n:], *alternatives):
        trial = np.concatenate([psi[:n], np.asarray(start, dtype=float)])
        try:
            costs.append((cost_at(case, candidates, trial, values), tuple(trial)))
        except SimulationError:
            continue
    return np.array(min(costs)[1]) if costs else psi


def _backtrack(case, candidates, psi, fit):
    """``psi`` with the last candidate nearer to neutral, by halves, until it costs no more than ``fit`` without it.

    The promise of a column need not hold at a large size.
    """
    n, psi = len(candidates[-1].parameters), np.array(psi, dtype=float)
    neutral = candidates[-1].parameters[0].neutral
    for _ in range(MAX_HALVINGS):
        try:
            if cost_at(case, candidates, psi, fit.values) <= fit.cost:
                break
        except SimulationError:
            pass
        psi[-n] = neutral + 0.5 * (psi[-n] - neutral)
    return psi
