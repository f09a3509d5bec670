"""The cumulative sum with resets, for all charts at once."""

import numpy as np


def cusum(z, allowance, threshold, active, fresh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""One-sided CUSUM for a falling mean.

    .. math:: S_i = \max(0, S_{i-1} - z_i - k)

    The sum starts at 0 with every epoch and holds its value over campaigns that are not ``active`` (learning,
    no value, no temperature). An alarm opens when S > h and closes when S is back at 0 or the epoch ends. For a
    rising mean pass ``-z``.

    Parameters
    ----------
    z : (n_chart, n_campaign) array of float
        Standardised residuals.
    allowance : (n_chart, n_campaign) array of float
        k, in the same unit.
    threshold : (n_chart,) array of float
    active, fresh : (n_chart, n_campaign) arrays of bool
        Campaigns that count; campaigns that start an epoch.

    Returns
    -------
    statistic : (n_chart, n_campaign) array of float
    open_alarm : (n_chart, n_campaign) array of bool
    began : (n_chart, n_campaign) array of int
        Last campaign with a value at which the sum was 0: the change came after it; -1 before the first.

    References
    ----------
    Page, Continuous inspection schemes, Biometrika 41, 1954.

    Examples
    --------
    >>> z, on = np.array([[0.0, -3.0, -3.0, 1.0]]), np.ones((1, 4), bool)
    >>> s, alarm, began = cusum(z, np.ones((1, 4)), np.array([3.5]), on, ~on)
    >>> print(s[0], alarm[0], began[0])
    [0. 2. 4. 2.] [False False  True  True] [0 0 0 0]
    """
    n_chart, n_campaign = z.shape
    gain = np.where(active & np.isfinite(z), -np.nan_to_num(z) - allowance, 0.0).T.copy()
    counts = np.isfinite(z).T.copy()
    fresh = fresh.T.copy()
    statistic = np.zeros((n_campaign, n_chart))
    opened = np.zeros((n_campaign, n_chart), dtype=bool)
    began = np.full((n_campaign, n_chart), -1, dtype=np.int32)
    total, alarm, since = np.zeros(n_chart), np.zeros(n_chart, dtype=bool), np.full(n_chart, -1, dtype=np.int32)
    for i in range(n_campaign):
        total = np.maximum(np.where(fresh[i], 0.0, total) + gain[i], 0.0)
        resting = total == 0.0
        since = np.where(resting & (counts[i] | fresh[i]), i, since)
        alarm = (alarm & ~resting & ~fresh[i]) | (total > threshold)
        statistic[i], opened[i], began[i] = total, alarm, since
    return np.ascontiguousarray(statistic.T), np.ascontiguousarray(opened.T), np.ascontiguousarray(began.T)
