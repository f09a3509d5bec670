"""Exact confidence intervals of shares."""

from scipy.stats import beta


def clopper_pearson(k, n, confidence=0.95):
    """(low, high) of a share if ``k`` of ``n`` were observed; (0, 1) for n = 0.

    No alarm in 60 gives an upper limit of 6.0 % (two-sided). One in 30 gives 0.1 to 17.2 %:

    >>> [round(100 * x, 1) for x in (*clopper_pearson(0, 60), *clopper_pearson(1, 30))]
    [0.0, 6.0, 0.1, 17.2]
    """
    if n == 0:
        return 0.0, 1.0
    tail = 0.5 * (1.0 - confidence)
    low = 0.0 if k == 0 else float(beta.ppf(tail, k, n - k + 1))
    return low, 1.0 if k == n else float(beta.ppf(1.0 - tail, k + 1, n - k))
