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
    0.01  # probability of being absent above which all modes are dropped at once, not one by one
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


def screen(
    candidates: list[Candidate],
    decays: np.ndarray,
    rate: float,
    columns: np.ndarray,
    settings: IdentifySettings,
    rejected: list[dict],
) -> list[Candidate]:
    """Drop candidates that are not significant at the poles of the realisation: the clear ones first, then singly.

    Parameters
    ----------
    candidates : list of Candidate
        Candidate poles.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        Sampling rate. [Hz]
    columns : (n_column, n) array of float
        Columns of the background.
    settings : IdentifySettings
        Settings of the identification.
    rejected : list of dict
        Rows of rejected candidates, to which those dropped here are added.

    Returns
    -------
    list of Candidate
        The candidates that remain.
    """
    limit = settings.false_mode_probability
    while candidates:
        linearisation = linearise(start_values(candidates)[None], decays, rate, columns)
        sigma2 = linearisation.rss.sum() / degrees_of_freedom(decays, len(candidates), len(columns))
        probability = common_probability(mode_chi_squared(linearisation, sigma2))
        dropped = set(np.flatnonzero(probability > MAX_SCREENING_PROBABILITY).tolist()) or {int(np.argmax(probability))}
        dropped = {m for m in dropped if probability[m] > limit}
        if not dropped:
            break
        rejected += [rejection(candidates[m], "not significant", probability[m], limit) for m in sorted(dropped)]
        candidates = [c for m, c in enumerate(candidates) if m not in dropped]
    return candidates


def fit_and_prune(
    candidates: list[Candidate],
    decays: np.ndarray,
    rate: float,
    columns: np.ndarray,
    settings: IdentifySettings,
    rejected: list[dict],
    theta: np.ndarray | None = None,
    max_damping: float | None = None,
    indispensable: set | None = None,
) -> tuple[MixedFit | None, list[Candidate]]:
    """Maximum likelihood with all modes; drops the worst mode that fails a test until none does.

    The fits have the accuracy of ``SEARCH_OPTIONS``, enough to choose modes.

    Parameters
    ----------
    candidates : list of Candidate
        Candidate poles.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        Sampling rate. [Hz]
    columns : (n_column, n) array of float
        Columns of the background.
    settings : IdentifySettings
        Settings of the identification.
    rejected : list of dict
        Rows of rejected candidates, to which those dropped here are added.
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
    fit = fit_mixed(start_values(candidates), decays, rate, columns, theta=theta, **SEARCH_OPTIONS)
    while True:
        failures = mode_failures(fit, settings, max_damping)
        if failures:
            worst, (reason, value, limit) = failures[0]
            smaller = None
        else:
            redundant, smaller, probability = _redundant_mode(
                fit, candidates, decays, rate, columns, settings, indispensable
            )
            if redundant is None:
                return fit, candidates
            worst = redundant
            reason, value, limit = "splits a stronger mode", probability, settings.false_mode_probability
        fitted = replace(candidates[worst], frequency=np.exp(fit.shrunken_mean[worst, 0]), damping=fit.mean[worst, 1])
        rejected.append(rejection(fitted, reason, value, limit))
        candidates = candidates[:worst] + candidates[worst + 1 :]
        if not candidates:
            return None, candidates
        fit = smaller or fit_mixed(np.delete(fit.shrunken_mean, worst, axis=0), decays, rate, columns, **SEARCH_OPTIONS)


def _redundant_mode(
    fit: MixedFit,
    candidates: list[Candidate],
    decays: np.ndarray,
    rate: float,
    columns: np.ndarray,
    settings: IdentifySettings,
    indispensable: set[int],
) -> tuple[int | None, MixedFit | None, float]:
    """A mode that overlaps a stronger one and is not needed for the fit: (index, fit without it, probability).

    Poles that differ between impacts look like two poles to a realisation of all impacts, but not to a fit of each.
    """
    statistic = mode_chi_squared(fit.linearisation, fit.sigma2).sum(axis=0)
    target_rss = fit.rss + fit.sigma2 * float(chdtri(4 * len(decays), settings.false_mode_probability))
    for weak in np.argsort(statistic):
        if id(candidates[weak]) in indispensable:
            continue
        gap = np.abs(fit.mean[:, 0] - fit.mean[weak, 0])
        overlaps = (gap < fit.mean[:, 1] + fit.mean[weak, 1]) & (statistic > statistic[weak])
        if not overlaps.any():
            continue
        # start from common modes: the remaining mode must be free to move between the two
        without = fit_mixed(
            np.delete(fit.shrunken_mean, weak, axis=0), decays, rate, columns, target_rss=target_rss, **SEARCH_OPTIONS
        )
        probability = float(chdtrc(4 * len(decays), (without.rss - fit.rss) / fit.sigma2))
        if probability > settings.false_mode_probability:
            return int(weak), without, probability
        indispensable.add(id(candidates[weak]))
    return None, None, 1.0
