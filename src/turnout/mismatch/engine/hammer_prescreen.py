"""Prescreening: joint fits to the cheap observations alone, before any expensive fit.

Every family is fitted at its likeliest sites. The base model may have changed to hide an effect, so each fit starts
from the priors with the effect in it. A first fit with large independent errors finds the basin, a second one with the
actual errors finds the minimum: smooth errors would accept a resonance at a wrong frequency.
"""

from dataclasses import dataclass

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate_search import Projector, amplified
from turnout.mismatch.engine.map_fit import CHEAP_STEPS, fit_jointly

GLANCE, GLANCED = 4, 5  # steps of a trial fit; largest number of starts that are tried by trial fits
BLIND = 0.999  # share of the prior standard deviation that remains: the data say nothing
ENOUGH = 0.5  # nats; a step that gains less ends a fit of the prescreening


@dataclass(frozen=True)
class Found:
    """A candidate fitted to the cheap observations.

    ``gain`` in evidence less the logarithm of the number of sites [nats]. ``psi`` its parameters. ``values`` of
    nuisances that the cheap observations determine. ``level`` with it, ``before`` without it: weighted mean square.
    """

    gain: float
    candidate: object
    psi: np.ndarray
    values: dict
    level: float
    before: float


def scout(case, fit, settings, families=None):
    """Fits at the best site of every family, or of these ``families``, that the cheap observations show on top of
    ``fit``.

    [] without cheap observations.
    """
    cheap = case.cheap_part()
    if cheap is None or (families is not None and not families):
        return []
    held, n = fit.candidates, fit.psi.size
    rough = cheap.roughened()
    first = fit_jointly(rough, held, fit.psi, iterations=CHEAP_STEPS, done=ENOUGH)
    base = fit_jointly(cheap, held, first.psi, first.values, iterations=CHEAP_STEPS, done=ENOUGH)
    entries = _ranked(case, rough, first, held) + _ranked(case, cheap, base, held)
    found, glances = [], {}
    for family, members in _by_family(entries).items():
        if families is not None and family not in families:
            continue
        best = None
        for candidate, start in _likeliest(members, rough, first, held, settings, glances):
            hopeless = first.cost - 2.0 * settings.promise if candidate.always else np.inf
            refit = _fitted(rough, cheap, (*held, candidate), np.concatenate([first.psi, start]), hopeless)
            if refit is None:
                continue
            gain = refit.evidence - base.evidence - np.log(candidate.scanned)
            if best is None or gain > best.gain:
                levels = (max(f.level.values()) for f in (refit, base))
                best = Found(gain, candidate, refit.psi[n:], _seen(cheap, refit, candidate), *levels)
        if best is not None:
            found.append(best)
    return sorted(found, key=lambda f: -f.gain)


def _seen(case, fit, candidate):
    """Values of the nuisances that the cheap observations determine, and of the masking parameter.

    They do not determine the masking parameter beside the candidate. Its value in the base fit must not come on top.
    """
    sd = np.sqrt(np.diag(fit.covariance))
    known = {n.name: s < BLIND * n.sd or n.name == candidate.twin for n, s in zip(case.nuisances, sd)}
    return {name: fit.values[name] for name, seen in known.items() if seen}


def _ranked(case, cheap, fit, held):
    """(nats, candidate, start) by the columns of every candidate that shows in the cheap observations."""
    projector, columns, found = Projector(cheap, fit), cheap.screen(fit), []
    known = {c.key for c in held}
    for candidate in case.candidates:
        for k in range(len(candidate.starts)):
            parts = columns.get((candidate.key, k))
            if candidate.key in known or parts is None or not any(p.any() for p in parts):
                continue
            gain, share = projector.score(parts, candidate, k)
            found.append((0.5 * gain, candidate, amplified(candidate, k, share)))
    return found


def _by_family(entries):
    families = {}
    for entry in entries:
        families.setdefault(entry[1].family, []).append(entry)
    return families


def _likeliest(members, rough, first, held, settings, glances):
    """The most promising sites of a family, each with its best start.

    Families that the base model absorbs (``prescreen_group``) are tried at every site by a few steps of the broad fit.
    Families of one group share these ``trial_gains``. A family of the whole track is tried from its
    ``MAX_TRIAL_STARTS`` most promising starts.
    """
    best = {}
    for gain, candidate, start in sorted(members, key=lambda m: m[0]):
        best[candidate.key] = gain, candidate, start
    alike = next(iter(best.values()))[1].always
    if alike and len(best) == 1:
        starts = {tuple(start): (candidate, start) for _, candidate, start in sorted(members, key=lambda m: m[0])}
        tried = list(starts.values())[-GLANCED:]
        return [max(tried, key=lambda m: _glance(rough, first, held, *m)) if tried[1:] else tried[0]]
    if alike:
        for _, c, s in best.values() if len(best) > 1 else ():
            place = alike, tuple(sorted(c.where.items()))
            if place not in glances:
                glances[place] = _glance(rough, first, held, c, s)
        ranked = sorted(best.values(), key=lambda m: -glances.get((alike, tuple(sorted(m[1].where.items()))), 0.0))
        return [(c, s) for _, c, s in ranked[: settings.scouted_places]]
    ranked = sorted(best.values(), key=lambda m: -m[0])[: settings.scouted_places]
    return [(c, s) for gain, c, s in ranked if gain > settings.promise]


def _glance(rough, first, held, candidate, start):
    """Gain in half the cost after a few steps of the broad fit from the priors."""
    psi = np.concatenate([first.psi, start])
    try:
        fit = fit_jointly(rough, (*held, candidate), psi, {n.name: n.mean for n in rough.nuisances}, iterations=GLANCE)
    except SimulationError:
        return -np.inf
    return 0.5 * (first.cost - fit.cost)


def _fitted(rough, cheap, candidates, psi, hopeless):
    """Fit from the priors with the broad errors, then with the actual ones.

    None if the simulation fails, or if the broad fit costs more than ``max_cost``, the limit for candidates that were
    tried without any promise.
    """
    try:
        first = fit_jointly(
            rough, candidates, psi, {n.name: n.mean for n in rough.nuisances}, iterations=CHEAP_STEPS, done=ENOUGH
        )
        if first.cost > hopeless:
            return None
        return fit_jointly(cheap, candidates, first.psi, first.values, iterations=CHEAP_STEPS, done=ENOUGH)
    except SimulationError:
        return None
