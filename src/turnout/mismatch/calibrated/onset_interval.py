"""Range of time in which a change began: as a step, as growth to the last visit, or as growth that has ended."""

from __future__ import annotations

import numpy as np

from turnout.mismatch.calibrated.change import ChangeEffect, direction_of
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.history import History

N_DAYS = 120  # begins and ends of growth that are compared, over the time of all visits
MIN_DAYS = 3  # between two visits


def onset_interval(
    history: History, effect: ChangeEffect, probability: float = CALIBRATION.interval_probability
) -> tuple[float, float]:
    r"""Shortest range between visits that contains the onset of an effect with at least this probability.

    The effect is a step, growth up to the last visit, or growth that has ended: equally probable before. It begins
    between two successive visits, each pair equally probable, and there on any day alike; growth that has ended did so
    on any later day alike. The evidence of an onset is the mean over these days. The prior of the size is that of the
    change at the last visit. So a change that only the last visit shows is growth as probably as it is a step.

    Parameters
    ----------
    history : History
        As for ``compare_onsets``, of at least two visits.
    effect : ChangeEffect
        Whether it grows makes no difference.
    probability : float

    Returns
    -------
    start : float
        Last visit that is certainly without the effect. [years]
    end : float
        First visit that certainly has it. [years]

    Raises
    ------
    ValueError
        If the history has fewer than two visits, or the effect has a parameter that is not in the history.
    """
    times = np.array([s.time for s in history.steps])
    if times.size < 2:
        raise ValueError("a change needs two visits")
    n = times.size - 1
    n_days = max(MIN_DAYS, N_DAYS // n)
    edges = np.interp(np.arange(n * n_days + 1) / n_days, np.arange(n + 1), times)
    days, last = 0.5 * (edges[:-1] + edges[1:]), np.full(n * n_days, times[-1])
    begin, end = np.triu_indices(days.size)
    forms = (  # begin and end of the change, and the interval between visits in which it begins
        (times[:-1], times[:-1], np.arange(n)),
        (days, last, np.arange(days.size) // n_days),
        (days[begin], edges[1:][end], begin // n_days),
    )
    information, score = _of_changes_at_each_visit(history, direction_of(history, effect))
    log_weights = []
    for begins, ends, interval in forms:
        gains = _gains(information, score, _courses(times, begins, ends), effect.sd)
        gains[begins < effect.not_before] = -np.inf
        of_interval = [np.logaddexp.reduce(gains[interval == j]) - np.log(np.sum(interval == j)) for j in range(n)]
        log_weights.append(of_interval)
    weights = np.exp(np.logaddexp.reduce(log_weights, axis=0) - np.max(log_weights))
    total = np.concatenate([[0.0], np.cumsum(weights / weights.sum())])
    ranges = [(i, j) for i in range(n) for j in range(i + 1, n + 1) if total[j] - total[i] >= probability - 1e-12]
    i, j = min(ranges, key=lambda r: (times[r[1]] - times[r[0]], total[r[0]] - total[r[1]]))
    return float(times[i]), float(times[j])


def _courses(times: np.ndarray, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(n_visit, n) share of the size at each visit: it rises from begin to end, or at once after its begin."""
    elapsed, duration = times[:, None] - begins, ends - begins
    rising = np.clip(elapsed / np.where(duration > 0.0, duration, 1.0), 0.0, 1.0)
    return np.where(duration > 0.0, rising, elapsed > 0.0)


def _of_changes_at_each_visit(history: History, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r"""Information (n_visit, n_visit) and score (n_visit,) of changes of any size at each visit.

    A and b of ``compare_onsets`` are :math:`c^T A c` and :math:`c^T b` for the course c of the size over the visits.
    """
    n = len(history.steps)
    information, score = np.zeros((n, n)), np.zeros(n)
    absorbed = np.zeros((direction.size, n))
    for v, step in enumerate(history.steps):
        missing = -absorbed
        missing[:, v] += direction
        missing_information, nu = step.matrix @ missing, step.vector - step.matrix @ step.predicted.mean
        gained = step.belief.covariance @ missing_information
        information += missing.T @ missing_information - missing_information.T @ gained
        score += missing.T @ nu - gained.T @ nu
        absorbed = absorbed + gained
    return information, score


def _gains(information: np.ndarray, score: np.ndarray, courses: np.ndarray, sd: float) -> np.ndarray:
    """(n,) evidence of an effect with each course over no change, with the prior standard deviation ``sd``. [nats]"""
    a, b = np.sum(courses * (information @ courses), axis=0), score @ courses
    return 0.5 * b**2 / (a + sd**-2) - 0.5 * np.log1p(a * sd**2)
