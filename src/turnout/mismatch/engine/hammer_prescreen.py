"""Prescreening: joint fits to the hammer tests alone, before any fit to passages.

Every family is fitted at its likeliest sites. The base model may have changed to hide an effect, so each fit starts
from the priors with the effect in it. A first fit with large independent errors finds the basin, a second one with the
actual errors finds the minimum: smooth errors would accept a resonance at a wrong frequency.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.map_fit import fit_jointly, steps_from
from turnout.mismatch.engine.projector import Projector
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.search import Search


@dataclass(frozen=True)
class PrescreenFit:
    """A candidate fitted to the hammer tests.

    ``gain`` in evidence less the logarithm of the number of sites [nats]. ``psi`` its parameters. ``values`` of
    nuisances that the hammer tests determine. ``level`` with it, ``before`` without it: weighted mean square.
    """

    gain: float
    candidate: Candidate
    psi: np.ndarray
    values: dict[str, float]
    level: float
    before: float


class _Start(NamedTuple):
    """A start of a candidate, scaled, with half the gain in chi-squared that its column promises."""

    gain: float
    candidate: Candidate
    start: np.ndarray


@dataclass
class _Prescreen:
    """The hammer tests with broad and with actual errors, and the fits of the ``accepted`` effects to both.

    ``trial_gains`` are gains of trial fits at the sites of a group of families, ``trial_ends`` the nuisances and
    parameters where trials of a candidate from a start ended: its fit goes on from there.
    """

    settings: MismatchSettings
    broad_case: Case
    hammer_case: Case
    accepted: tuple[Candidate, ...]
    broad_fit: Fit
    base: Fit
    trial_gains: dict[tuple, float] = field(default_factory=dict)
    trial_ends: dict[tuple, tuple[dict[str, float], np.ndarray]] = field(default_factory=dict)

    def fit(self, candidate: Candidate, start: np.ndarray) -> PrescreenFit | None:
        """Fit from the priors, or the end of a trial from there, with the broad errors, then with the actual ones.

        None if the simulation fails, or if the broad fit of a family that is tried without any promise gains too
        little.
        """
        candidates = (*self.accepted, candidate)
        from_priors = _prior_means(self.broad_case), np.concatenate([self.broad_fit.psi, start])
        (values, psi), n = self.trial_ends.get((candidate.key, *start), from_priors), self.broad_fit.psi.size
        max_cost = self.broad_fit.cost - 2.0 * self.settings.promise if candidate.refit.prescreen_group else np.inf
        try:
            broad_fit = _fit_hammer_tests(self.broad_case, candidates, psi, values)
            if broad_fit.cost > max_cost:
                return None
            refit = self._fit_actual(candidates, broad_fit)
        except SimulationError:
            return None
        gain = refit.evidence - self.base.evidence - np.log(candidate.site.n_scanned)
        values = informed_values(self.hammer_case, refit, candidate)
        level, before = (max(f.level.values()) for f in (refit, self.base))
        return PrescreenFit(gain, candidate, refit.psi[n:], values, level, before)

    def _fit_actual(self, candidates: Sequence[Candidate], broad_fit: Fit) -> Fit:
        """Fit with the actual errors from ``broad_fit``, and if that costs more than no effect, also from the base.

        A model with an effect more cannot be worse: such a fit has ended in another basin than the base.
        """
        refit = _fit_hammer_tests(self.hammer_case, candidates, broad_fit.psi, broad_fit.values)
        if refit.cost <= self.base.cost:
            return refit
        other = _fit_hammer_tests(self.hammer_case, candidates, broad_fit.psi, self.base.values)
        return min(refit, other, key=lambda f: f.cost)

    def base_shortfall(self, best: PrescreenFit) -> float:
        """Evidence that the base lacks, since it stopped before its optimum: what it gains from the nuisances of a fit.

        It is none of the evidence of any effect. [nats]
        """
        values = {**self.base.values, **best.values}
        try:
            continued = _fit_hammer_tests(self.hammer_case, self.accepted, self.base.psi, values)
        except SimulationError:
            return 0.0
        return max(0.0, continued.evidence - self.base.evidence)

    def likeliest_starts(self, starts: Sequence[_Start]) -> list[tuple[Candidate, np.ndarray]]:
        """The most promising sites of a family, each with its best start.

        Families that the base model absorbs (``prescreen_group``) are tried at every site by a few steps of the broad
        fit. Families of one group share these gains. A family of the whole track is tried from its most promising
        starts.
        """
        ranked = sorted(starts, key=lambda s: s.gain)
        best_starts = {s.candidate.key: s for s in ranked}
        group = next(iter(best_starts.values())).candidate.refit.prescreen_group
        if group and len(best_starts) == 1:
            return [self._best_of_track(ranked)]
        if group:
            gains: dict[str, float] = {}
            for s in sorted(best_starts.values(), key=lambda s: -s.gain):
                chosen = sorted(gains.values())[-self.settings.scouted_places :]
                sought_gain = chosen[0] if len(chosen) == self.settings.scouted_places else -np.inf
                gains[s.candidate.key] = self._gain_at_site(group, s, sought_gain)
            likeliest = sorted(best_starts.values(), key=lambda s: -gains[s.candidate.key])
            return [(s.candidate, s.start) for s in likeliest[: self.settings.scouted_places]]
        likeliest = peaks_of_promise(best_starts.values())[: self.settings.scouted_places]
        return [(s.candidate, s.start) for s in likeliest if s.gain > self.settings.promise]

    def best_beside(self, fit: PrescreenFit | None, sites: Sequence[Candidate]) -> PrescreenFit | None:
        """A promising fit, moved to the next of the ``sites`` along the track as long as it gains, from its own sizes.

        A family that the base model absorbs is tried at every site before.
        """
        if fit is None or not sites or fit.candidate.refit.prescreen_group:
            return fit
        positions = [c.position for c in sites]
        while fit.gain > self.settings.promise:
            at = positions.index(fit.candidate.position)
            beside = [self.fit(c, fit.psi) for c in (*sites[max(at - 1, 0) : at], *sites[at + 1 : at + 2])]
            best = max((f for f in beside if f is not None), key=lambda f: f.gain, default=fit)
            if best.gain <= fit.gain:
                break
            fit = best
        return fit

    def _best_of_track(self, ranked: Sequence[_Start]) -> tuple[Candidate, np.ndarray]:
        """The best of the most promising starts of a family of the whole track."""
        starts = {tuple(s.start): (s.candidate, s.start) for s in ranked}
        leader, *rivals = list(starts.values())[: -THRESHOLDS.max_trial_starts - 1 : -1]
        best_gain = self._trial_gain(*leader, -np.inf) if rivals else 0.0
        for trial in rivals:
            gain = self._trial_gain(*trial, best_gain)
            if gain > best_gain:
                leader, best_gain = trial, gain
        return leader

    def _gain_at_site(self, group: str, start: _Start, sought_gain: float) -> float:
        """Gain of a trial fit at a site, computed for the first family of the group that asks."""
        site = group, tuple(sorted(start.candidate.where.items()))
        if site not in self.trial_gains:
            self.trial_gains[site] = self._trial_gain(start.candidate, start.start, sought_gain)
        return self.trial_gains[site]

    def _trial_gain(self, candidate: Candidate, start: np.ndarray, sought_gain: float) -> float:
        """Gain in half the cost after a few steps of the broad fit from the priors.

        The steps end where they do not lead to ``sought_gain``, that of trials at better sites.
        """
        psi, candidates = np.concatenate([self.broad_fit.psi, start]), (*self.accepted, candidate)
        values, steps = _prior_means(self.broad_case), THRESHOLDS.n_trial_steps
        sought_cost = self.broad_fit.cost - 2.0 * sought_gain
        try:
            cost, end_values, end_psi = steps_from(self.broad_case, candidates, psi, values, steps, sought_cost)
        except SimulationError:
            return -np.inf
        self.trial_ends[(candidate.key, *start)] = end_values, end_psi
        return 0.5 * (self.broad_fit.cost - cost)


def sites_along_track(starts: Iterable[_Start]) -> list[Candidate]:
    """The candidates of a family that is tested at positions alone, from one end of the track to the other; else []."""
    sites = {s.candidate.key: s.candidate for s in starts}
    if any(c.position is None or not set(c.where) <= {"place", "sleeper"} for c in sites.values()):
        return []
    return sorted(sites.values(), key=lambda c: c.position or 0.0)


def peaks_of_promise(starts: Iterable[_Start]) -> list[_Start]:
    """The best start of every site that promises no less than both of its neighbours along the track, the best first.

    Sites beside a peak are reached from it. Of a family that is not tested at positions alone all sites are kept.
    """
    starts = list(starts)
    sites = sites_along_track(starts)
    if not sites:
        return sorted(starts, key=lambda s: -s.gain)
    by_key = {s.candidate.key: s for s in starts}
    ordered = [by_key[c.key] for c in sites]
    gains = np.array([-np.inf, *(s.gain for s in ordered), -np.inf])
    peaks = [s for s, before, behind in zip(ordered, gains[:-2], gains[2:]) if s.gain >= max(before, behind)]
    return sorted(peaks, key=lambda s: -s.gain)


def prescreen(search: Search, fit: Fit, families: Collection[str] | None = None) -> list[PrescreenFit]:
    """Fits at the best site of every family that the hammer tests show on top of ``fit``.

    Parameters
    ----------
    search : Search
    fit : Fit
        Its candidates are in the model.
    families : collection of str or None
        Families that are tried; None: all.

    Returns
    -------
    list of PrescreenFit
        The largest gain first. [] without hammer tests.
    """
    case = search.case
    hammer_case = case.hammer_case()
    if hammer_case is None or (families is not None and not families):
        return []
    accepted, broad_case = fit.candidates, hammer_case.with_broad_errors()
    broad_fit = _fit_hammer_tests(broad_case, accepted, fit.psi)
    base = _fit_hammer_tests(hammer_case, accepted, broad_fit.psi, broad_fit.values)
    step = _Prescreen(search.settings, broad_case, hammer_case, accepted, broad_fit, base)
    by_family: dict[str, list[_Start]] = {}
    for entry in _column_starts(case, broad_case, broad_fit) + _column_starts(case, hammer_case, base):
        by_family.setdefault(entry.candidate.family, []).append(entry)
    best_fits = []
    for family, starts in by_family.items():
        if families is not None and family not in families:
            continue
        fits = [step.fit(candidate, start) for candidate, start in step.likeliest_starts(starts)]
        sites = sites_along_track(starts)
        successful = [f for f in (step.best_beside(f, sites) for f in fits) if f is not None]
        if successful:
            best_fits.append(max(successful, key=lambda f: f.gain))
    best_fits.sort(key=lambda f: -f.gain)
    if not best_fits or best_fits[0].gain <= search.settings.promise:
        return best_fits
    shortfall = step.base_shortfall(best_fits[0])
    return [replace(f, gain=f.gain - shortfall) for f in best_fits]


def informed_values(case: Case, fit: Fit, candidate: Candidate) -> dict[str, float]:
    """Values of the nuisances that the hammer tests determine, and of the masking parameter.

    They do not determine the masking parameter beside the candidate. Its value in the base fit must not come on top.

    Parameters
    ----------
    case : Case
        Of the hammer tests.
    fit : Fit
        With the candidate.
    candidate : Candidate

    Returns
    -------
    dict
        Nuisance parameter -> value.
    """
    sd = np.sqrt(np.diag(fit.covariance))
    is_informed = {
        n.name: s < THRESHOLDS.uninformed_sd_share * n.sd or n.name == candidate.site.masking_parameter
        for n, s in zip(case.nuisances, sd)
    }
    return {name: fit.values[name] for name, informed in is_informed.items() if informed}


def _fit_hammer_tests(
    case: Case, candidates: Sequence[Candidate], psi: np.ndarray, values: Mapping[str, float] | None = None
) -> Fit:
    """Joint fit to hammer tests, with many steps."""
    steps, min_gain = THRESHOLDS.max_hammer_steps, THRESHOLDS.min_hammer_step_gain
    return fit_jointly(case, candidates, psi, values, iterations=steps, min_gain=min_gain)


def _prior_means(case: Case) -> dict[str, float]:
    return {n.name: n.mean for n in case.nuisances}


def _column_starts(case: Case, hammer_case: Case, fit: Fit) -> list[_Start]:
    """Starts of every candidate that shows in the hammer tests, scaled by their columns."""
    columns = hammer_case.screen(fit)
    accepted_keys = {c.key for c in fit.candidates}
    chosen = [
        (c, k)
        for c in case.candidates
        if c.key not in accepted_keys
        for k in range(len(c.starts))
        if any(p.any() for p in columns.get((c.key, k)) or ())
    ]
    if not chosen:
        return []
    scores = Projector(hammer_case, fit).scores([columns[c.key, k] for c, k in chosen], *zip(*chosen))
    return [_Start(0.5 * gain, c, c.scaled_start(k, share)) for (c, k), (gain, share) in zip(chosen, scores)]
