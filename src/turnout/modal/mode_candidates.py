"""Candidate poles of a test, and which of them remain as modes of the fit.

A mode must recur over orders and starts, be significant, be single and pass the tests of ``mode_tests``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtrc, chdtri

from turnout.modal.least_squares import linearise
from turnout.modal.mixed_effects import MixedFit, degrees_of_freedom, fit_mixed
from turnout.modal.mode_tests import common_probability, mode_chi_squared, mode_failures

if TYPE_CHECKING:
    from collections.abc import Iterable

    from turnout.config.settings.identify import IdentifySettings


@dataclass(frozen=True)
class Candidate:
    """A pole that recurs: medians of ``frequency`` [Hz], ``damping``, ``energy``, ``emac``; ``presence`` 0 to 1."""

    frequency: float
    damping: float
    energy: float
    emac: float
    presence: float
    members: np.ndarray


MAX_SCREENING_PROBABILITY = (
    0.01  # probability of being absent above which all modes are removed at once, not one by one
)
MIN_LISTED_PRESENCE = 0.2  # share of orders and starts from which on a rejected pole is listed
# During the search a fit within a tenth of the errors of single impacts is accurate enough to choose modes.
SEARCH_OPTIONS: dict[str, Any] = {"iterations": 24, "tolerance": 0.1, "is_search": True}


def rejection(candidate: Candidate, reason: str, value: float, limit: float) -> dict:
    """A row of ``rejected_modes``.

    Parameters
    ----------
    candidate : Candidate
        The candidate that failed.
    reason : str
        Why it is no mode.
    value : float
        Value that failed the test.
    limit : float
        Limit of the test.

    Returns
    -------
    dict
        Frequency [Hz], damping, energy and emac of the candidate, with reason, value and limit.
    """
    return {
        "frequency": float(candidate.frequency),
        "damping": float(candidate.damping),
        "energy": float(candidate.energy),
        "emac": float(candidate.emac),
        "reason": reason,
        "value": float(value),
        "limit": float(limit),
    }


def filter_reappearing(
    candidates: Iterable[Candidate], rate: float, settings: IdentifySettings
) -> tuple[list[Candidate], list[dict]]:
    """Candidates that occur at enough orders and starts, and above the lowest frequency that a record can resolve.

    Parameters
    ----------
    candidates : iterable of Candidate
        Poles that recur.
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Settings of the identification.

    Returns
    -------
    (list of Candidate, list of dict)
        Candidates by energy, at most two more than half the largest order; rows of the rejected ones.
    """
    min_frequency = 0.5 / settings.duration
    max_listed_frequency = 1.5 * max(high for _, _, high in settings.bands())
    accepted, rejected = [], []
    for c in candidates:
        if c.frequency < min_frequency or c.frequency > 0.45 * rate:
            continue
        if c.presence >= settings.presence_minimum:
            accepted.append(c)
        elif c.presence > MIN_LISTED_PRESENCE and c.frequency < max_listed_frequency:
            rejected.append(rejection(c, "found in too few model orders", c.presence, settings.presence_minimum))
    accepted.sort(key=lambda c: -c.energy)
    max_modes = settings.order_maximum // 2 + 2
    for c in accepted[max_modes:]:
        rejected.append(rejection(c, "weaker than enough others", c.energy, accepted[max_modes - 1].energy))
    return accepted[:max_modes], rejected


def start_values(candidates: Iterable[Candidate]) -> np.ndarray:
    """Modes of candidates as the fits need them.

    Parameters
    ----------
    candidates : iterable of Candidate
        Candidates.

    Returns
    -------
    (n_mode, 2) array of float
        Ln f [Hz] and zeta.
    """
    return np.array([[np.log(c.frequency), c.damping] for c in candidates]).reshape(-1, 2)


@dataclass(frozen=True)
class ModeSearch:
    """Search for the candidates that are modes of the decays of a test.

    ``decays`` (n_decay, n) [m/s²] at ``rate`` [Hz]; ``columns`` (n_column, n) of the background; ``settings`` of the
    identification. ``rejected`` are rows of rejected candidates, to which those that are removed here are added.
    """

    decays: np.ndarray
    rate: float
    columns: np.ndarray
    settings: IdentifySettings
    rejected: list[dict]

    def screen(self, candidates: list[Candidate]) -> list[Candidate]:
        """Drop candidates that are not significant at the poles of the realisation: clear ones first, then singly.

        Parameters
        ----------
        candidates : list of Candidate
            Candidate poles.

        Returns
        -------
        list of Candidate
            The candidates that remain.
        """
        limit = self.settings.false_mode_probability
        while candidates:
            linearisation = linearise(start_values(candidates)[None], self.decays, self.rate, self.columns)
            sigma2 = linearisation.rss.sum() / degrees_of_freedom(self.decays, len(candidates), len(self.columns))
            probability = common_probability(mode_chi_squared(linearisation, sigma2))
            is_clear = probability > MAX_SCREENING_PROBABILITY
            absent = set(np.flatnonzero(is_clear).tolist()) or {int(np.argmax(probability))}
            absent = {m for m in absent if probability[m] > limit}
            if not absent:
                break
            for m in sorted(absent):
                self.rejected.append(rejection(candidates[m], "not significant", probability[m], limit))
            candidates = [c for m, c in enumerate(candidates) if m not in absent]
        return candidates

    def fit_and_prune(
        self,
        candidates: list[Candidate],
        theta: np.ndarray | None = None,
        max_damping: float | None = None,
        indispensable: set[int] | None = None,
    ) -> tuple[MixedFit | None, list[Candidate]]:
        """Maximum likelihood with all modes; removes the worst mode that fails a test until none does.

        The fits have the accuracy of ``SEARCH_OPTIONS``, enough to choose modes.

        Parameters
        ----------
        candidates : list of Candidate
            Candidate poles.
        theta : (n_decay, n_mode, 2) array of float or None
            Modes of each decay at which the first fit starts; None: those of the candidates.
        max_damping : float or None
            Damping up to which a pole may stay in the fit although it is no mode; None: only modes stay.
        indispensable : set or None
            Identities of candidates that are not redundant and not tested again; extended.

        Returns
        -------
        (MixedFit or None, list of Candidate)
            Fit of the modes that pass, None if none does, and their candidates.
        """
        if not candidates:
            return None, candidates
        indispensable = set() if indispensable is None else indispensable
        fit = self._fit(start_values(candidates), theta=theta)
        while True:
            failures = mode_failures(fit, self.settings, max_damping)
            if failures:
                worst, (reason, value, limit) = failures[0]
                smaller = None
            else:
                redundant, smaller, probability = self._redundant_mode(fit, candidates, indispensable)
                if redundant is None:
                    return fit, candidates
                worst = redundant
                reason, value, limit = "splits a stronger mode", probability, self.settings.false_mode_probability
            frequency, damping = np.exp(fit.shrunken_mean[worst, 0]), fit.mean[worst, 1]
            fitted = replace(candidates[worst], frequency=frequency, damping=damping)
            self.rejected.append(rejection(fitted, reason, value, limit))
            candidates = candidates[:worst] + candidates[worst + 1 :]
            if not candidates:
                return None, candidates
            fit = smaller or self._fit(np.delete(fit.shrunken_mean, worst, axis=0))

    def _fit(self, start: np.ndarray, **options: Any) -> MixedFit:
        return fit_mixed(start, self.decays, self.rate, self.columns, **options, **SEARCH_OPTIONS)

    def _redundant_mode(
        self, fit: MixedFit, candidates: list[Candidate], indispensable: set[int]
    ) -> tuple[int | None, MixedFit | None, float]:
        """A mode that overlaps a stronger one and is not needed for the fit: (index, fit without it, probability).

        Poles that differ between impacts look like two poles to a realisation of all impacts, but not to a fit of each.
        """
        n_values, limit = 4 * len(self.decays), self.settings.false_mode_probability
        statistic = mode_chi_squared(fit.linearisation, fit.sigma2).sum(axis=0)
        target_rss = fit.rss + fit.sigma2 * float(chdtri(n_values, limit))
        for weak in np.argsort(statistic):
            if id(candidates[weak]) in indispensable:
                continue
            gap = np.abs(fit.mean[:, 0] - fit.mean[weak, 0])
            overlaps = (gap < fit.mean[:, 1] + fit.mean[weak, 1]) & (statistic > statistic[weak])
            if not overlaps.any():
                continue
            # start from common modes: the remaining mode must be free to move between the two
            without = self._fit(np.delete(fit.shrunken_mean, weak, axis=0), target_rss=target_rss)
            probability = float(chdtrc(n_values, (without.rss - fit.rss) / fit.sigma2))
            if probability > limit:
                return int(weak), without, probability
            indispensable.add(id(candidates[weak]))
        return None, None, 1.0
