"""Course of a change over the visits: a step, growth up to the last visit, or growth that has ended.

It gives the range of time in which the change began, and its size at the last visit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from turnout.mismatch.calibrated.change import ChangeEffect, direction_of
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.history import History

N_DAYS = 120  # begins and ends of growth that are compared, over the time of all visits
MIN_DAYS = 3  # between two visits


@dataclass(frozen=True)
class ChangeCourses:
    """Courses that a change may have taken, with their probabilities.

    ``times`` (n_visit,) [years]. ``intervals``, ``probabilities``, ``sizes`` and ``sds`` are (n_course,): number of the
    pair of successive visits between which the course begins, its probability given that the effect has appeared, and
    the size at the last visit with its standard deviation, given the course.
    """

    times: np.ndarray
    intervals: np.ndarray
    probabilities: np.ndarray
    sizes: np.ndarray
    sds: np.ndarray

    def onset_interval(self, probability: float = CALIBRATION.interval_probability) -> tuple[float, float]:
        """Shortest range between visits that contains the onset with at least this probability.

        Parameters
        ----------
        probability : float

        Returns
        -------
        start : float
            Last visit that is certainly without the effect. [years]
        end : float
            First visit that certainly has it. [years]
        """
        n = self.times.size - 1
        weights = np.bincount(self.intervals, self.probabilities, n)
        total = np.concatenate([[0.0], np.cumsum(weights / weights.sum())])
        ranges = [(i, j) for i in range(n) for j in range(i + 1, n + 1) if total[j] - total[i] >= probability - 1e-12]
        i, j = min(ranges, key=lambda r: (self.times[r[1]] - self.times[r[0]], total[r[0]] - total[r[1]]))
        return float(self.times[i]), float(self.times[j])

    @property
    def last_size(self) -> tuple[float, float]:
        """Size at the last visit and its standard deviation over all courses."""
        mean = float(self.probabilities @ self.sizes)
        return mean, float(np.sqrt(self.probabilities @ (self.sds**2 + (self.sizes - mean) ** 2)))


def courses_of(history: History, effect: ChangeEffect) -> ChangeCourses:
    r"""Courses of an effect and their probabilities.

    The effect is a step, growth up to the last visit, or growth that has ended: equally probable before. It begins
    between two successive visits, each pair equally probable, and there on any day alike; growth that has ended did so
    on any later day alike. The prior of the size is that of the change at the last visit. So a change that only the
    last visit shows is growth as probably as it is a step.

    Parameters
    ----------
    history : History
        As for ``compare_onsets``, of at least two visits.
    effect : ChangeEffect
        Whether it grows makes no difference.

    Returns
    -------
    ChangeCourses

    Raises
    ------
    ValueError
        If the history has fewer than two visits, or the effect has a parameter that is not in the history.
    """
    times = np.array([s.time for s in history.steps])
    if times.size < 2:
        raise ValueError("a change needs two visits")
    begins, intervals, courses, prior = _lasting_courses(times)
    gains, sizes, sds = _of_courses(history, effect, courses)
    log_weights = np.where(begins < effect.not_before, -np.inf, gains + np.log(prior))
    weights = np.exp(log_weights - log_weights.max())
    return ChangeCourses(times, intervals, weights / weights.sum(), sizes, sds)


def visits_of_ended_change(history: History, effect: ChangeEffect, margin: float) -> tuple[str, ...]:
    """Successive visits that alone show an effect: a later one no longer does.

    A logger with a wrong gain for a month, for example. As a change that lasts it would have a size between that of
    these visits and 0.

    Parameters
    ----------
    history : History
        As for ``compare_onsets``, of at least two visits.
    effect : ChangeEffect
        Whether it grows makes no difference.
    margin : float
        Evidence of a change that ends over one that lasts, each over all of its equally probable courses. [nats]

    Returns
    -------
    tuple of str
        () where the effect lasts up to the last visit, or less than the margin tells the two apart.
    """
    times = np.array([s.time for s in history.steps])
    n = times.size
    ranges = [(first, stop) for first in range(1, n) for stop in range(first + 1, n)]
    if not ranges:
        return ()
    number = np.arange(n)[:, None]
    firsts, stops = np.array(ranges).T
    ended, _, _ = _of_courses(history, effect, ((number >= firsts) & (number < stops)).astype(float))
    begins, _, courses, prior = _lasting_courses(times)
    lasting, _, _ = _of_courses(history, effect, courses)
    lasting = np.where(begins < effect.not_before, -np.inf, lasting)
    if logsumexp(ended - np.log(len(ranges))) - logsumexp(lasting, b=prior) < margin:
        return ()
    first, stop = ranges[int(np.argmax(ended))]
    return tuple(s.visit for s in history.steps[first:stop])


def _lasting_courses(times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Courses that do not end: (n_course,) begins [years] and intervals, (n_visit, n_course) sizes, (n_course,) prior.

    A step, growth up to the last visit, or growth that has ended.
    """
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
    begins, ends, intervals = (np.concatenate(parts) for parts in zip(*forms, strict=True))
    n_alike = np.concatenate([np.bincount(interval, minlength=n)[interval] for _, _, interval in forms])
    return begins, intervals, _courses(times, begins, ends), 1.0 / (len(forms) * n * n_alike)


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


def _of_courses(
    history: History, effect: ChangeEffect, courses: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Evidence over no change [nats], size at the last visit and its standard deviation of each course, (n_course,)."""
    information, score = _of_changes_at_each_visit(history, direction_of(history, effect))
    a = np.sum(courses * (information @ courses), axis=0)
    variance, b = 1.0 / (a + effect.sd**-2), score @ courses
    return 0.5 * b**2 * variance - 0.5 * np.log1p(a * effect.sd**2), b * variance, np.sqrt(variance)
