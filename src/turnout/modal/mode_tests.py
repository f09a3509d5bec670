"""Test the modes of a fit: a mode must recur over orders, be significant, be single and agree between impacts.

The significance of a mode or a drift comes from chi-squared tests of amplitudes, per impact and over all impacts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import chdtrc, chdtri

from turnout.modal.least_squares import Linearisation, linearise
from turnout.modal.mixed_effects import MIN_DAMPING, MixedFit, degrees_of_freedom, fit_mixed

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

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


def mode_chi_squared(linearisation: Linearisation, sigma2: float) -> np.ndarray:
    r"""Squared amplitude of each mode in each impact over its covariance: chi-squared(2) if the mode is absent.

    .. math:: \chi^2 = a^T \left(\sigma^2 [(B^T B)^{-1}]_{mm}\right)^{-1} a

    Parameters
    ----------
    linearisation : Linearisation
        Fit of the modes.
    sigma2 : float
        Variance of the noise.

    Returns
    -------
    (n_decay, n_mode) array of float
        Statistic of each mode in each impact.
    """
    n_mode = linearisation.amplitude.shape[1]
    inverse = np.linalg.inv(linearisation.gram)
    cosine, sine = np.arange(n_mode), n_mode + np.arange(n_mode)
    cc, ss, cs = inverse[:, cosine, cosine], inverse[:, sine, sine], inverse[:, cosine, sine]
    a, b = linearisation.coefficient[:, cosine], linearisation.coefficient[:, sine]
    return (a**2 * ss - 2.0 * a * b * cs + b**2 * cc) / (np.maximum(cc * ss - cs**2, 1e-300) * sigma2)


def columns_chi_squared(linearisation: Linearisation, sigma2: float, columns: Sequence[int] | np.ndarray) -> float:
    """Statistic of columns of the model (a drift, a hum): chi-squared(n_decay times columns) if they are absent.

    Parameters
    ----------
    linearisation : Linearisation
        Fit of the modes.
    sigma2 : float
        Variance of the noise.
    columns : sequence of int
        Numbers of the columns of the model.

    Returns
    -------
    float
        Statistic, summed over the decays.
    """
    columns = np.asarray(columns)
    block = np.linalg.inv(linearisation.gram)[:, columns[:, None], columns]
    value = linearisation.coefficient[:, columns]
    return float(np.sum(value * np.linalg.solve(block, value[..., None])[..., 0]) / sigma2)


def common_probability(statistic: np.ndarray) -> np.ndarray:
    """Probability of the sum over impacts of chi-squared(2) values if the mode is absent.

    Parameters
    ----------
    statistic : array
        (n_decay, n_mode) values of ``mode_chi_squared``.

    Returns
    -------
    (n_mode,) array of float
        Probability for each mode.

    Examples
    --------
    >>> print(common_probability(np.array([[0.0], [0.0]])))
    [1.]
    """
    return chdtrc(2 * len(statistic), statistic.sum(axis=0))


def share_of_impacts(statistic: np.ndarray, probability: float = 0.01) -> np.ndarray:
    """Share of impacts in which the mode alone is significant.

    Parameters
    ----------
    statistic : array
        (n_decay, n_mode) values of ``mode_chi_squared``.
    probability : float
        Level of significance.

    Returns
    -------
    (n_mode,) array of float
        Share for each mode, 0 to 1.
    """
    return (statistic > chdtri(2, probability)).mean(axis=0)


# Distance of the single impacts' mean from the common mode, over the half-power half-width of the mode. One linear step
# over this distance turns the phase by 0.25 rad within a decay time: its result is no longer that of a linear model.
MAX_LINEAR_DISTANCE = 0.25
MIN_DISAGREEMENT = 4.0  # the same distance over its standard error: below, it may be chance


def disagreement(fit: MixedFit) -> np.ndarray:
    r"""Distance between the mean of the single impacts and the common mode, where it is significant.

    .. math:: d = \max\left(\frac{|\overline{\ln f_i} - \ln f|}{\zeta}, \frac{|\bar\zeta_i - \zeta|}{\zeta}\right)

    Two poles that share one resonance fit all impacts together better than one pole, but no impact determines them.
    Their estimates from single impacts then lie elsewhere than the common poles.

    Parameters
    ----------
    fit : MixedFit
        Fit of all modes.

    Returns
    -------
    (n_mode,) array of float
        In half-power half-widths; 0 where it is less than ``MIN_DISAGREEMENT`` standard errors, and for fewer than
        three impacts.
    """
    n = len(fit.theta)
    if n < 3:
        return np.zeros(len(fit.mean))
    distance = np.abs(fit.unshrunken.mean(axis=0) - fit.mean)
    error = fit.unshrunken.std(axis=0, ddof=1) / np.sqrt(n)
    significant = np.where(distance > MIN_DISAGREEMENT * error, distance, 0.0)
    return significant.max(axis=1) / np.maximum(np.abs(fit.mean[:, 1]), MIN_DAMPING)


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


def mode_failures(
    fit: MixedFit, settings: IdentifySettings, max_damping: float | None = None
) -> list[tuple[int, tuple[str, float, float]]]:
    """Every mode that fails a test, the weakest first.

    With ``max_damping`` only the tests for a pole to stay in a fit apply: it is present and damped less than this.

    Parameters
    ----------
    fit : MixedFit
        Fit of all modes.
    settings : IdentifySettings
        Settings of the identification.
    max_damping : float or None
        Largest damping ratio of a pole that stays; None: all tests of a mode.

    Returns
    -------
    list of (int, (str, float, float))
        Index, reason, value and limit.
    """
    n_mode = len(fit.mean)
    statistic = mode_chi_squared(fit.linearisation, fit.sigma2)
    weight = 1.0 / (np.einsum("ijj->ij", fit.covariance) + fit.spread)
    se = np.sqrt(1.0 / weight.sum(axis=0)).reshape(n_mode, 2)
    spread = np.sqrt(fit.spread).reshape(n_mode, 2)
    probability, share = common_probability(statistic), share_of_impacts(statistic)
    distance = disagreement(fit)
    failures = []
    for m in range(n_mode):
        damping = fit.mean[m, 1]
        presence_tests = (
            ("not significant", probability[m], settings.false_mode_probability, True),
            ("shows in too few impacts", share[m], settings.impact_share, False),
            ("damping too high", damping, max_damping or settings.damping_maximum, True),
            ("damping not above zero", damping, 1e-4, False),
            ("single impacts disagree with their common fit", distance[m], MAX_LINEAR_DISTANCE, True),
        )
        precision_tests = (
            ("frequency too uncertain", se[m, 0], settings.frequency_se_maximum, True),
            ("damping too uncertain", se[m, 1] / abs(damping), settings.damping_se_maximum, True),
            ("differs between impacts", spread[m, 0], settings.spread_maximum, True),
        )
        for reason, value, limit, upper in presence_tests if max_damping else presence_tests + precision_tests:
            if (value > limit) if upper else (value < limit):
                failures.append((m, (reason, float(value), limit)))
                break
    return sorted(failures, key=lambda item: statistic[:, item[0]].sum())
