"""Numbers and states as people read them: never a number without its interval and its n."""

from functools import cache

from scipy.stats import t as student

BADGES = {
    "inspect this week": "inspect",
    "plan": "plan",
    "learning": "learning",
    "ok": "ok",
    "cannot tell": "unknown",
    "not measured": "unknown",
    "suppressed": "unknown",
}


@cache
def student_quantile(n):
    """97.5 % quantile of Student's t with n - 1 degrees of freedom.

    >>> round(student_quantile(30), 3)
    2.045
    """
    return float(student.ppf(0.975, n - 1))


def with_interval(value, standard_error, n, digits=1):
    """A value with the half width of its 95 % t interval.

    >>> with_interval(154.55, 0.4, 30)
    '154.6 ± 0.8'
    >>> with_interval(0.19321, None, 1, 3)
    '0.193 ± ?'
    >>> with_interval(None, None, 0)
    'none'
    """
    if value is None:
        return "none"
    if standard_error is None or n < 2:
        return f"{value:.{digits}f} ± ?"
    return f"{value:.{digits}f} ± {student_quantile(n) * standard_error:.{digits}f}"


def day(when):
    """The day of a time stamp, or a dash."""
    return "–" if when is None else f"{when:%Y-%m-%d}"


def badge(state):
    """Style of the badge that shows ``state``."""
    return BADGES.get(state, "unknown")
