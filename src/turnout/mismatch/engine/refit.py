"""Joint refits of the shortlisted candidates on top of a fit: starts, convergence, and the score of each.

A leader that explains too little is restarted from smaller sizes. Fits are cached by key.
"""

from dataclasses import replace
from itertools import product

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate_search import Entry, shortlist
from turnout.mismatch.engine.cross_validation import hangs_on, held_out_score, told_apart
from turnout.mismatch.engine.evidence import score_of
from turnout.mismatch.engine.map_fit import FINE, STALL, Joint, cost_at, fit_jointly

ROUNDS = 3  # rounds of steps for a leader; one that still gains afterwards is far from any optimum


def ended(case, fit, settings):
    """The fit, continued until a round of steps gains less than a name needs. Each round computes new derivatives."""
    for _ in range(ROUNDS):
        try:
            before, fit = fit, to_the_end(case, fit, settings, FINE)
        except SimulationError:
            break
        if fit.evidence - before.evidence < settings.threshold:
            break
    return fit


def to_the_end(case, fit, settings, stall=STALL):
    """The fit continued from where it is, with new derivatives."""
    return fit_jointly(case, fit.candidates, fit.psi, fit.values, iterations=settings.iterations, stall=stall)


def with_derivatives(case, fit, settings):
    """The fit, continued if it has no Jacobian; unchanged if the simulation fails close to it."""
    try:
        return fit if fit.jacobian else to_the_end(case, fit, settings)
    except SimulationError:
        return fit


def kept(store, key, compute, candidates=()):
    """A fit by its key, computed if the store lacks it; stores hold fits without their candidates' functions."""
    if key not in store:
        fit = compute()
        store[key] = fit.with_candidates(()) if fit is not None else None
    fit = store[key]
    return None if fit is None else fit.with_candidates(candidates)


SIZES = (1.0, 0.75, 0.5)  # shares of a leader's first two parameters: its response is nonlinear in both


def begun_anew(case, fit, score, settings, store, effect):
    """The better of a leader that explains too little and its restart. Other leaders stay.

    The restart begins at the least costly of smaller sizes, with all nuisances that can mask an effect at their priors.
    A base fit that imitates a large effect has local minima, and so has an effect that lifts wheels off the rail.
    """
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
    """``psi`` with the first two parameters of the leader at those shares of their values that cost least."""
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


HELD = 0.5  # share of the gain from the cheap observations; a refit that gains less has not converged
PROMISING = 0.5  # thresholds that an effect of a component must gain before its other effects are refitted
NEARLY = 0.5  # thresholds of gain from which a leader is fitted to convergence
# Thresholds promised by the cheap observations beyond which a start needs derivatives of its own.
FAR = 4.0
# Multiple of the promised size from which an effect that gained too little is restarted: the base fit masks part of it.
FARTHER = 2.0
HALVINGS = 4  # halvings of a start that costs more than no effect; a sixteenth of it is linear


def scored(case, fit, settings, tell, store, effect, promising):
    """(best Score of each family, ``fit``), all refitted jointly on top of ``fit``.

    If ``fit`` proves to have stopped a threshold before its optimum, it is continued from the leader's nuisances, and
    all candidates are scored again on top of it.
    """
    ranked = _ranked(case, fit, settings, tell, store, effect, promising)
    further = _owed(case, fit, ranked, settings, store, effect)
    if further is not None and further.evidence - fit.evidence > settings.threshold:
        fit, effect = further, f"{effect}:again"
        ranked = _ranked(case, fit, settings, tell, store, effect, promising)
        further = _owed(case, fit, ranked, settings, store, effect)
    if further is not None:  # the shortfall of the base fit is no evidence
        short = max(0.0, further.evidence - fit.evidence)
        ranked = [replace(s, gain=s.gain - short) for s in ranked]
    if case.frozen_jacobian and ranked:
        ranked = beside(case, fit, ranked, settings)
    return tuple(_checked(case, fit, s, settings) for s in ranked), fit


def _ranked(case, fit, settings, tell, store, effect, promising):
    """Best Score of each family on top of ``fit``, leaders fitted to convergence."""
    plan = shortlist(case, fit, settings, promising)
    scores, best = {}, -np.inf
    for done, entry in enumerate(plan):
        if entry.rival:
            if best < PROMISING * settings.threshold:
                continue
            entry = _after_its_kin(entry, scores)
        score = _tried(case, fit, entry, settings, store, effect, best)
        tell(done + 1, len(plan), entry.candidate.key)
        if score is None:
            continue
        best, known = max(best, score.gain), scores.get(score.family)
        if known is None or score.gain > known.gain:
            scores[score.family] = score
    ranked = sorted(scores.values(), key=lambda s: -s.gain)
    if case.frozen_jacobian and ranked:
        ranked = _same_law_beside(case, fit, ranked, settings, store, effect)
        material = [s for s in ranked if s.material][:2]
        close = min(material[0].gain - settings.margin, HELD * material[0].gain) if material else 0.0
        leaders = [s for s in material if s.gain > max(NEARLY * settings.threshold, close)]
        polished = [_polished(case, fit, s, settings, store, effect) for s in leaders]
        if polished and not fit.candidates:  # beside another effect the residual is also an error in its shape
            polished[0] = begun_anew(case, fit, polished[0], settings, store, effect)
        ranked = sorted([*polished, *(s for s in ranked if all(s is not x for x in leaders))], key=lambda s: -s.gain)
    return ranked


def _owed(case, fit, ranked, settings, store, effect):
    """``fit`` computed again from the leader's nuisances, to convergence.

    None if nobody leads, the case is not expensive, or the simulation fails.
    """
    if not case.frozen_jacobian or not ranked or ranked[0].gain <= settings.threshold:
        return None
    leader = ranked[0]
    key = f"{effect}:back:{leader.candidate.key}:{len(fit.candidates)}:{tuple(np.round(leader.fit.psi, 12))}"
    return kept(store, key, lambda: _back(case, fit, leader.fit.values, settings), fit.candidates)


def _back(case, fit, values, settings):
    try:
        start = fit_jointly(case, fit.candidates, fit.psi, values, iterations=settings.iterations, stall=FINE)
        return ended(case, start, settings)
    except SimulationError:
        return None


def _same_law_beside(case, fit, ranked, settings, store, effect):
    """The scores, with equivalent families refitted from the leader's nuisances, which suit them as well.

    Equivalent are families that cannot be distinguished from the leader as fitted: its ``limit_form`` and
    ``simpler_form``.
    """
    leader = ranked[0]
    for k, score in enumerate(ranked[1:], 1):
        alike = score.is_limit_of(leader) or score.is_plain_form_of(leader)
        if leader.gain > settings.threshold and alike:
            entry = Entry(score.candidate, score.own[0], leader.fit.values)
            again = _tried(case, fit, entry, settings, store, f"{effect}:beside")
            if again is not None and again.gain > score.gain:
                ranked[k] = again
    return sorted(ranked, key=lambda s: -s.gain)


def beside(case, fit, ranked, settings):
    """The scores, with the best reportable one reduced to its gain on top of the leader.

    This applies if a leader that is not reportable leads by more than the margin. An effect of the whole track that is
    too small to matter may be what another effect took for itself.
    """
    leader, best = ranked[0], next((s for s in ranked if s.material), None)
    if best is None or leader.gain - best.gain <= settings.margin or best.gain <= settings.threshold:
        return ranked
    held, own = leader.fit, best.fit.psi[fit.psi.size :]
    none = np.concatenate([fit.psi, leader.candidate.neutral])
    found, both = [], (*held.candidates, best.candidate)
    for psi, values in ((held.psi, held.values), (none, best.fit.values)):  # from the optimum of either
        start = np.concatenate([psi, own])
        try:
            found.append(fit_jointly(case, both, start, values, iterations=settings.iterations))
        except SimulationError:
            continue
    if not found:
        return ranked
    left = max(f.evidence for f in found) - held.evidence + best.candidate.aside - np.log(best.candidate.scanned)
    return sorted((replace(s, gain=min(s.gain, left)) if s is best else s for s in ranked), key=lambda s: -s.gain)


def _after_its_kin(entry, scores):
    """The rival with the nuisances of the best effect of its component: they nearly suit it."""
    candidate = entry.candidate
    kin = [s for s in scores.values() if s.candidate.part == candidate.part]
    return replace(entry, values=max(kin, key=lambda s: s.gain).fit.values) if kin else entry


def _tried(case, fit, entry, settings, store, effect, best=0.0):
    """Score of a task of the shortlist after its joint refit. None if the simulation fails.

    A refit that gains less than its promise is continued. A fault of a channel starts with derivatives of its own if it
    promises much. It is continued only if ``best_gain`` so far is within its reach.
    """
    candidate, start, of_channel = entry.candidate, entry.start, entry.candidate.frame == "sensor"
    key = f"{effect}:{'+'.join(c.key for c in fit.candidates)}:{candidate.key}:{tuple(np.round(start, 12))}"
    both, far = (*fit.candidates, candidate), of_channel and entry.promised > FAR * settings.threshold
    refit = kept(store, key, lambda: _refit(case, fit, candidate, start, entry.values, far, settings), both)
    if refit is None:
        return None
    score = score_of(case, fit, refit, candidate, settings)
    whole_track = candidate.scanned == 1 and candidate.start_from_base
    if case.frozen_jacobian and whole_track and score.gain < settings.threshold:
        score = max(score, _from_farther(case, fit, entry, score, settings, store, key), key=lambda s: s.gain)
    worth = max(settings.threshold, HELD * best if of_channel else 0.0)
    if case.frozen_jacobian and score.gain < HELD * entry.promised and entry.promised > worth:
        return _polished(case, fit, score, settings, store, effect)
    return score


def _from_farther(case, fit, entry, score, settings, store, key):
    """Best Score of a task restarted at more than its promised size, once also with maskable nuisances at their priors.

    If common values of the base fit have absorbed part of an effect of the whole track, a small size gains nothing and
    a large one costs more, until these values return. If the waves of the rail absorbed it, they return on no straight
    path. ``score`` if no restart is better, or the simulation fails.
    """
    candidate = entry.candidate
    first, start = candidate.parameters[0], np.array(entry.start, dtype=float)
    start[0] = np.clip(first.neutral + FARTHER * (start[0] - first.neutral), *first.bounds)
    psi, values = np.concatenate([fit.psi, start]), {**fit.values, **entry.values}
    unbent = values | {n.name: n.mean for n in case.nuisances if n.owner is None and n.bends}
    found = [score]
    for how, begin in (("farther", values), ("unbent", unbent)):

        def made(begin=begin):
            try:
                both = (*fit.candidates, candidate)
                return fit_jointly(case, both, psi, begin, fit.jacobian, iterations=settings.iterations).light()
            except SimulationError:
                return None

        refit = kept(store, f"{key}:{how}", made, (*fit.candidates, candidate))
        if refit is not None:
            found.append(score_of(case, fit, refit, candidate, settings))
    return max(found, key=lambda s: s.gain)


def _polished(case, fit, score, settings, store, effect):
    """A leader refitted to convergence, with derivatives of its own: the verdict rests on these."""
    key = f"{effect}:polished:{score.candidate.key}:{len(fit.candidates)}:{tuple(np.round(score.fit.psi, 12))}"
    refit = kept(store, key, lambda: ended(case, score.fit, settings), score.fit.candidates)
    return score_of(case, fit, refit, score.candidate, settings)


def _checked(case, fit, score, settings):
    """A leader of an expensive case with its gain condition by condition, each left out in turn."""
    if not case.frozen_jacobian or not score.fit.jacobian:
        return score
    mine, reference = held_out_score(case, score.fit), held_out_score(case, fit)
    by_condition = {c: mine[c] - reference[c] for c in reference}
    alone = hangs_on(case, score.fit, score.candidate, score.gain, by_condition, settings) if score.material else ""
    worst, apart = min(by_condition.values(), default=0.0), told_apart(case, fit, by_condition)
    return replace(score, worst=worst, by_condition=by_condition, alone=alone, apart=apart)


def _refit(case, fit, candidate, start, back, far, settings):
    """Joint refit from this start. None if the simulation fails."""
    psi = np.concatenate([fit.psi, start])
    candidates = (*fit.candidates, candidate)
    values = {**fit.values, **back}
    if not candidate.start_from_base and not back:  # nuisances that can mask an effect return to their priors
        values |= {n.name: n.mean for n in case.nuisances if n.owner is None and n.bends}
    try:
        psi = _best_start(case, candidates, psi, values)
        if candidate.start_from_base and not back:
            psi = _sobered(case, candidates, psi, fit)
        keep = _derivatives(case, fit, candidates, psi, values, far)
        refit = fit_jointly(case, candidates, psi, values, keep, iterations=settings.iterations)
    except SimulationError:
        return None
    return refit.light() if case.frozen_jacobian else refit


def _derivatives(case, fit, candidates, psi, values, far):
    """Derivatives from which a refit of an expensive case starts: those of ``fit``, new ones if ``is_far``."""
    if not case.frozen_jacobian or not far:
        return fit.jacobian if case.frozen_jacobian else None
    joint = Joint(case, candidates)
    theta = np.concatenate([[values.get(n.name, n.mean) for n in case.nuisances], psi])
    return joint.jacobian(theta, joint.predict(theta))


def _best_start(case, candidates, psi, values):
    """``psi`` or the last candidate's own starts, whichever costs least.

    The expensive observations decide what the cheap ones cannot see.
    """
    candidate = candidates[-1]
    if candidate.start_from_base and not candidate.even:
        return psi
    n, found = psi.size - len(candidate.parameters), []
    others = (candidate.mirrored(psi[n:]),) if candidate.even else candidate.starts
    for start in (psi[n:], *others):
        tried = np.concatenate([psi[:n], np.asarray(start, dtype=float)])
        try:
            found.append((cost_at(case, candidates, tried, values), tuple(tried)))
        except SimulationError:
            continue
    return np.array(min(found)[1]) if found else psi


def _sobered(case, candidates, psi, fit):
    """``psi`` with the last candidate nearer to neutral, by halves, until it costs no more than ``fit`` without it.

    The promise of a column need not hold at a large size.
    """
    n, psi = len(candidates[-1].parameters), np.array(psi, dtype=float)
    neutral = candidates[-1].parameters[0].neutral
    for _ in range(HALVINGS):
        try:
            if cost_at(case, candidates, psi, fit.values) <= fit.cost:
                break
        except SimulationError:
            pass
        psi[-n] = neutral + 0.5 * (psi[-n] - neutral)
    return psi
