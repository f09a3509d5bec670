"""Compute which change a chart detects, by running simulated charts with an estimated baseline."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from turnout.trend.cusum import cusum
from turnout.trend.roots import find_root

N_RUNS = 2000  # simulated charts; the probability of an alarm is then known to 0.007
WEATHER = 0.4  # sd of the weather's temperatures over the amplitude of the season
LEAST_BASELINE = 6  # campaigns; a shorter baseline has too few degrees of freedom for its spread


@lru_cache(maxsize=4096)
def detectable_shift(
    threshold: float,
    allowance: float,
    campaigns: int,
    n_base: int,
    n_learned: int = 0,
    guard: float = 1.0,
    autocorrelation: float = 0.0,
    single_share: float = 0.6,
    outlier_limit: float = 3.0,
    probability: float = 0.9,
) -> float:
    r"""Smallest shift of z that raises an alarm within ``campaigns`` with ``probability``.

    Each simulated chart has AR(1) noise of unit variance and a season of temperatures. Level, temperature slope and
    spread s are estimated from its ``n_base`` first campaigns. The later values give the charted

    .. math:: z_i = \frac{r_i}{g\, s\, \sqrt{(1 + \phi)/(1 - \phi)}} - \delta

    Parameters
    ----------
    threshold, allowance : float
        h and k. [sd of z]
    campaigns : int
        Number of campaigns a year, within which the alarm must come.
    n_base : int
        Campaigns of the baseline.
    n_learned : int
        Campaigns from which the level of a later epoch was learned; 0: the level is that of the baseline.
    guard : float
        g, the widening for the estimated baseline.
    autocorrelation : float
        phi from campaign to campaign.
    single_share, outlier_limit : float
        Settings of that name: how outliers count.
    probability : float
        Probability of an alarm.

    Returns
    -------
    float
        Shift delta, in the unit of z; infinite without a campaign.

    Examples
    --------
    An estimated baseline detects less than a known one.

    >>> detectable_shift(3.5, 1.0, 52, 52, guard=1.12) > detectable_shift(3.5, 1.0, 52, 5000, guard=1.12)
    True
    """
    if campaigns < 1:
        return float("inf")
    z = simulated_z(campaigns, max(n_base, LEAST_BASELINE), n_learned, guard, autocorrelation)
    shape = z.shape
    limit = min(single_share * threshold + allowance, outlier_limit)
    charts = (np.full(shape, allowance), np.full(len(z), threshold), np.full(shape, limit))
    step, on = np.full(len(z), single_share * threshold), np.ones(shape, dtype=bool)

    def shortfall(shift: float) -> float:
        alarms = cusum(z - shift, *charts, step, on, ~on)[1]
        return float(alarms.any(axis=1).mean()) - probability

    high = 2.0 * (threshold + allowance) + 4.0
    return find_root(shortfall, 0.0, high, 5e-3) if shortfall(high) > 0.0 else float("inf")


def simulated_z(campaigns: int, n_base: int, n_learned: int, guard: float, autocorrelation: float) -> np.ndarray:
    """Standardised residuals of one year of unchanged charts, with the errors of their baselines.

    Parameters
    ----------
    campaigns : int
        Campaigns a year.
    n_base : int
        Campaigns of the baseline, at the same intervals.
    n_learned : int
        Campaigns that learned the level of a later epoch, 0 for that of the baseline.
    guard : float
        Widening of the spread.
    autocorrelation : float
        phi from campaign to campaign.

    Returns
    -------
    (N_RUNS, campaigns) array of float
        z, the same values in each call.
    """
    rng = np.random.default_rng(20240607)
    n = n_base + n_learned + campaigns
    noise = rng.standard_normal((N_RUNS, n))
    for i in range(1, n):
        noise[:, i] = autocorrelation * noise[:, i - 1] + np.sqrt(1.0 - autocorrelation**2) * noise[:, i]
    season = np.sin(2.0 * np.pi * (np.arange(n) / campaigns + rng.random((N_RUNS, 1))))
    temperature = season + WEATHER * rng.standard_normal(season.shape)
    base = slice(0, n_base)
    centred = temperature - temperature[:, base].mean(axis=1, keepdims=True)
    slope = np.sum(centred[:, base] * noise[:, base], axis=1) / np.sum(centred[:, base] ** 2, axis=1)
    residual = noise - slope[:, None] * centred
    level_from = slice(n_base, n_base + n_learned) if n_learned else base
    fitted = residual[:, base] - residual[:, base].mean(axis=1, keepdims=True)
    spread = np.sqrt(np.sum(fitted**2, axis=1) / (n_base - 2))
    residual = residual - residual[:, level_from].mean(axis=1, keepdims=True)
    widening = np.sqrt((1.0 + autocorrelation) / (1.0 - autocorrelation))
    return residual[:, n_base + n_learned :] / (guard * spread * widening)[:, None]
