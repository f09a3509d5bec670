"""Mean over blows with its interval, and the spread between blows beyond their own error."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from turnout.identify.mixed import between_variance


@dataclass(frozen=True)
class Summary:
    """``mean`` ± ``se`` with interval ``low`` to ``high``, between-blow standard deviation ``spread``, ``n`` blows."""

    mean: float
    se: float
    low: float
    high: float
    spread: float
    n: int


def summarise(value, se, confidence: float = 0.95, choice: float = 0.0) -> Summary:
    r"""Random-effects mean of estimates that each have a standard error.

    .. math:: m = \frac{\sum w_i x_i}{\sum w_i}, \quad w_i = \frac{1}{s_i^2 + \tau^2}, \quad
              \mathrm{se}^2 = \frac{\sum w_i (x_i - m)^2}{(n-1) \sum w_i}, \quad m \pm t_{n-1}\,\mathrm{se}

    The standard error comes from the spread of the estimates, not from their stated errors, so it holds if
    those are wrong by a common factor. With equal errors this is the t interval. A single estimate keeps its own
    error and a normal interval.

    Parameters
    ----------
    value, se : (n,) array of float
        Estimates and standard errors, same unit; ValueError if there are none.
    confidence : float
    choice : float
        Standard error that all estimates share, such as that of the choice of a model; no blow shows it.

    References
    ----------
    Hartung and Knapp 2001; Sidik and Jonkman 2002.

    Examples
    --------
    >>> s = summarise(np.array([9.0, 11.0]), np.array([0.1, 0.1]))
    >>> print(f"{s.mean:.1f} ± {s.se:.1f}, {s.high - s.mean:.2f}")
    10.0 ± 1.0, 12.71
    """
    value, se = np.asarray(value, float), np.asarray(se, float)
    n = len(value)
    if n == 0:
        raise ValueError("no estimates to summarise")
    if n == 1:
        error = float(np.hypot(se[0], choice))
        half = norm.ppf(0.5 + confidence / 2.0) * error
        return Summary(float(value[0]), error, float(value[0] - half), float(value[0] + half), 0.0, 1)
    spread2 = float(between_variance(value, np.maximum(se**2, 1e-300)))
    weight = 1.0 / (np.maximum(se**2, 1e-300) + spread2)
    mean = float(np.sum(weight * value) / weight.sum())
    error = float(np.sqrt(np.sum(weight * (value - mean) ** 2) / ((n - 1) * weight.sum())))
    error = float(np.hypot(error, choice))
    half = t.ppf(0.5 + confidence / 2.0, n - 1) * error
    return Summary(mean, error, float(mean - half), float(mean + half), float(np.sqrt(spread2)), n)
