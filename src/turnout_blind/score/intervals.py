"""Exact confidence intervals of shares."""

from scipy.stats import beta


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
