"""Exact confidence intervals of shares and rates."""

from scipy.stats import beta, chi2


def clopper_pearson(k: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Confidence interval of a share.

    Parameters
    ----------
    k : int
        Number of cases that were observed.
    n : int
        Number of all cases.
    confidence : float
        Probability of the interval.

    Returns
    -------
    (float, float)
        Lower and upper limit; (0, 1) for n = 0.

    References
    ----------
    Clopper and Pearson 1934, The use of confidence or fiducial limits illustrated in the case of the binomial.

    Examples
    --------
    >>> [round(100 * x, 1) for x in (*clopper_pearson(0, 60), *clopper_pearson(1, 30))]
    [0.0, 6.0, 0.1, 17.2]
    """
    if n == 0:
        return 0.0, 1.0
    tail = 0.5 * (1.0 - confidence)
    low = 0.0 if k == 0 else float(beta.ppf(tail, k, n - k + 1))
    return low, 1.0 if k == n else float(beta.ppf(1.0 - tail, k + 1, n - k))


def poisson_interval(k: int, exposure: float, confidence: float = 0.95) -> tuple[float, float]:
    """Confidence interval of a rate of independent events.

    Parameters
    ----------
    k : int
        Number of events that were observed.
    exposure : float
        Time in which they could occur.
    confidence : float
        Probability of the interval.

    Returns
    -------
    (float, float)
        Lower and upper limit per unit of exposure; (0, inf) without exposure.

    References
    ----------
    Garwood 1936, Fiducial limits for the Poisson distribution.

    Examples
    --------
    >>> [round(x, 3) for x in (*poisson_interval(0, 1.0), *poisson_interval(10, 2.0))]
    [0.0, 3.689, 2.398, 9.195]
    """
    if exposure <= 0.0:
        return 0.0, float("inf")
    tail = 0.5 * (1.0 - confidence)
    low = 0.0 if k == 0 else 0.5 * float(chi2.ppf(tail, 2 * k))
    return low / exposure, 0.5 * float(chi2.ppf(1.0 - tail, 2 * k + 2)) / exposure
