"""Prescreening: joint fits to the cheap observations alone, before any expensive fit.

Every family is fitted at its likeliest sites. The base model may have changed to hide an effect, so each fit starts
from the priors with the effect in it. A first fit with large independent errors finds the basin, a second one with the
actual errors finds the minimum: smooth errors would accept a resonance at a wrong frequency.
"""

from dataclasses import dataclass

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate_search import Projector, scaled_start
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.thresholds import THRESHOLDS


@dataclass(frozen=True)
class PrescreenFit:
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


def prescreen(search, fit, families=None):
    """Fits at the best site of every family, or of these ``families``, that the cheap observations show on top of
    ``fit``.

    [] without cheap observations.
    """
    case, settings = search.case, search.settings
    cheap_case = case.cheap_case()
    if cheap_case is None or (families is not None and not families):
        return []
    accepted, n_psi = fit.candidates, fit.psi.size
    broad_case = cheap_case.with_broad_errors()
    broad_fit = fit_jointly(
        broad_case, accepted, fit.psi, iterations=THRESHOLDS.max_cheap_steps, min_gain=THRESHOLDS.min_cheap_step_gain
    )
    base = fit_jointly(
        cheap_case,
        accepted,
        broad_fit.psi,
        broad_fit.values,
        iterations=THRESHOLDS.max_cheap_steps,
        min_gain=THRESHOLDS.min_cheap_step_gain,
    )
    entries = _column_entries(case, broad_case, broad_fit, accepted) + _column_entries(case, cheap_case, base, accepted)
    prescreened, trial_gains = [], {}
    for family, members in _by_family(entries).items():
        if families is not None and family not in families:
            continue
        top = None
        for candidate, start in _likeliest_starts(members, broad_case, broad_fit, accepted, settings, trial_gains):
            max_cost = broad_fit.cost - 2.0 * settings.promise if candidate.prescreen_group else np.inf
            refit = _fit_candidates(
                broad_case, cheap_case, (*accepted, candidate), np.concatenate([broad_fit.psi, start]), max_cost
            )
            if refit is None:
                continue
            gain = refit.evidence - base.evidence - np.log(candidate.n_scanned)
            if top is None or gain > top.gain:
                levels = (max(f.level.values()) for f in (refit, base))
                top = PrescreenFit(
                    gain, candidate, refit.psi[n_psi:], informed_values(cheap_case, refit, candidate), *levels
                )
        if top is not None:
            prescreened.append(top)
    return sorted(prescreened, key=lambda f: -f.gain)


def informed_values(case, fit, candidate):
    """Values of the nuisances that the cheap observations determine, and of the masking parameter.

    They do not determine the masking parameter beside the candidate. Its value in the base fit must not come on top.
    """
    sd = np.sqrt(np.diag(fit.covariance))
    is_informed = {
        n.name: s < THRESHOLDS.uninformed_sd_share * n.sd or n.name == candidate.masking_parameter
        for n, s in zip(case.nuisances, sd)
    }
    return {name: fit.values[name] for name, informed in is_informed.items() if informed}


def _column_entries(case, cheap_case, fit, accepted):
    """(nats, candidate, start) by the columns of every candidate that shows in the cheap observations."""
    projector, columns, ranked = Projector(cheap_case, fit), cheap_case.screen(fit), []
    accepted_keys = {c.key for c in accepted}
    for candidate in case.candidates:
        for k in range(len(candidate.starts)):
            changes = columns.get((candidate.key, k))
            if candidate.key in accepted_keys or changes is None or not any(p.any() for p in changes):
                continue
            gain, share = projector.score(changes, candidate, k)
            ranked.append((0.5 * gain, candidate, scaled_start(candidate, k, share)))
    return ranked


def _by_family(entries):
    families = {}
    for entry in entries:
        families.setdefault(entry[1].family, []).append(entry)
    return families


def _likeliest_starts(members, broad_case, broad_fit, accepted, settings, trial_gains):
    """The most promising sites of a family, each with its best start.

    Families that the base model absorbs (``prescreen_group``) are tried at every site by a few steps of the broad fit.
    Families of one group share these ``trial_gains``. A family of the whole track is tried from its
    ``max_trial_starts`` most promising starts.
    """
    best_starts = {}
    for gain, candidate, start in sorted(members, key=lambda m: m[0]):
        best_starts[candidate.key] = gain, candidate, start
    group = next(iter(best_starts.values()))[1].prescreen_group
    if group and len(best_starts) == 1:
        starts = {tuple(start): (candidate, start) for _, candidate, start in sorted(members, key=lambda m: m[0])}
        trials = list(starts.values())[-THRESHOLDS.max_trial_starts :]
        return [
            max(trials, key=lambda m: _trial_gain(broad_case, broad_fit, accepted, *m)) if trials[1:] else trials[0]
        ]
    if group:
        for _, c, s in best_starts.values() if len(best_starts) > 1 else ():
            site = group, tuple(sorted(c.where.items()))
            if site not in trial_gains:
                trial_gains[site] = _trial_gain(broad_case, broad_fit, accepted, c, s)
        ranked = sorted(
            best_starts.values(), key=lambda m: -trial_gains.get((group, tuple(sorted(m[1].where.items()))), 0.0)
        )
        return [(c, s) for _, c, s in ranked[: settings.scouted_places]]
    ranked = sorted(best_starts.values(), key=lambda m: -m[0])[: settings.scouted_places]
    return [(c, s) for gain, c, s in ranked if gain > settings.promise]


def _trial_gain(broad_case, broad_fit, accepted, candidate, start):
    """Gain in half the cost after a few steps of the broad fit from the priors."""
    psi = np.concatenate([broad_fit.psi, start])
    try:
        fit = fit_jointly(
            broad_case,
            (*accepted, candidate),
            psi,
            {n.name: n.mean for n in broad_case.nuisances},
            iterations=THRESHOLDS.n_trial_steps,
        )
    except SimulationError:
        return -np.inf
    return 0.5 * (broad_fit.cost - fit.cost)


def _fit_candidates(broad_case, cheap_case, candidates, psi, max_cost):
    """Fit from the priors with the broad errors, then with the actual ones.

    None if the simulation fails, or if the broad fit costs more than ``max_cost``, the limit for candidates that were
    tried without any promise.
    """
    try:
        broad_fit = fit_jointly(
            broad_case,
            candidates,
            psi,
            {n.name: n.mean for n in broad_case.nuisances},
            iterations=THRESHOLDS.max_cheap_steps,
            min_gain=THRESHOLDS.min_cheap_step_gain,
        )
        if broad_fit.cost > max_cost:
            return None
        return fit_jointly(
            cheap_case,
            candidates,
            broad_fit.psi,
            broad_fit.values,
            iterations=THRESHOLDS.max_cheap_steps,
            min_gain=THRESHOLDS.min_cheap_step_gain,
        )
    except SimulationError:
        return None
