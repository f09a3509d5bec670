"""Format numbers with their 95 % interval, days, and states for pages."""

import math
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
    """A value with the half width of its 95 % t interval, which gets at least one significant digit.

    >>> with_interval(154.55, 0.4, 30)
    '154.6 ± 0.8'
    >>> with_interval(154.55, 0.004, 30)
    '154.550 ± 0.008'
    >>> with_interval(0.19321, None, 1, 3)
    '0.193 ± ?'
    >>> with_interval(None, None, 0)
    'none'
    """
    if value is None:
        return "none"
    if not standard_error or n < 2:  # an error of zero is below the resolution of the registry
        return f"{value:.{digits}f} ± ?"
    half = student_quantile(n) * standard_error
    if 2.0 * half < 10.0**-digits:
        digits = -math.floor(math.log10(half))
    return f"{value:.{digits}f} ± {half:.{digits}f}"


def day(when):
    """The day of a time stamp, or a dash."""
    return "–" if when is None else f"{when:%Y-%m-%d}"


def badge(state):
    """Style of the badge that shows ``state``."""
    return BADGES.get(state, "unknown")
