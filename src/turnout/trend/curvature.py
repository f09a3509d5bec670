"""Curvature of a temperature law that the straight lines of the sections leave in the median of a turnout."""

from __future__ import annotations

import numpy as np
from scipy.stats import f as f_distribution

from turnout.trend.epochs import by_epoch, expand_epochs

SIGNIFICANCE = 0.01  # probability of a curvature in the baseline of a straight law


def curvature_term(
    values: np.ndarray, temperature: np.ndarray, inside: np.ndarray, epoch: np.ndarray, autocorrelation: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""Curved part of each value's temperature law, where the baseline shows one.

    .. math:: v_i = l_{e(i)} + b (T_i - T_0) + c (T_i - T_0)^2 + r_i

    is fitted to the baseline by least squares. The term is used where the F test of c rejects a straight law at
    ``SIGNIFICANCE``. Memory leaves n campaigns the information of n (1 - phi) / (1 + phi), which divides the statistic.

    Parameters
    ----------
    values : (n_chart, n_campaign) array of float
        Medians of the sections, corrected for straight laws; nan does not count. [%]
    temperature : (n_chart, n_campaign) array of float
        Rail temperatures; nan does not count. [°C]
    inside : (n_chart, n_campaign) array of bool
        Campaigns of the baseline.
    epoch : (n_chart, n_campaign) array of int
        Number of the epoch of each campaign.
    autocorrelation : (n_chart,) array of float
        Memory from campaign to campaign, nan where unknown.

    Returns
    -------
    term : (n_chart, n_campaign) array of float
        The whole fitted b and c terms [%]; 0 where the law is straight or the temperature unknown.
    spread_ratio : (n_chart,) array of float
        Standard deviation of the baseline about the curved law over that about a straight one; 1 where it is straight.
    """
    inside = inside & np.isfinite(values) & np.isfinite(temperature)
    n_campaign = inside.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        middle = np.sum(np.where(inside, temperature, 0.0), axis=1) / n_campaign
        linear = temperature - middle[:, None]
        x, y, v = (_deviation(part, inside, epoch) for part in (linear, linear**2, values))
        y_on_x = np.sum(x * y, axis=1) / np.sum(x * x, axis=1)
        across = y - y_on_x[:, None] * x  # the square without its straight part
        quadratic = np.sum(across * v, axis=1) / np.sum(across * across, axis=1)
        slope = np.sum(x * v, axis=1) / np.sum(x * x, axis=1) - quadratic * y_on_x
        gain = quadratic**2 * np.sum(across * across, axis=1)
        left = np.sum((v - slope[:, None] * x - quadratic[:, None] * y) ** 2, axis=1)
        n_level = by_epoch(np.zeros(inside.shape), inside, epoch, int(epoch.max(initial=0)) + 1)[1]
        freedom = n_campaign - (n_level > 0).sum(axis=1) - 2
        phi = np.nan_to_num(autocorrelation)
        statistic = gain / left * freedom * (1.0 - phi) / (1.0 + phi)
        is_curved = (freedom > 0) & (f_distribution.sf(statistic, 1, np.maximum(freedom, 1)) < SIGNIFICANCE)
        term = slope[:, None] * linear + quadratic[:, None] * linear**2
        ratio = np.sqrt(left / (left + gain) * (freedom + 1) / freedom)
    return np.where(is_curved[:, None] & np.isfinite(term), term, 0.0), np.where(is_curved, ratio, 1.0)


def _deviation(values: np.ndarray, inside: np.ndarray, epoch: np.ndarray) -> np.ndarray:
    """Values inside less the mean of their epoch, 0 outside."""
    mean, _ = by_epoch(np.where(inside, values, 0.0), inside, epoch, int(epoch.max(initial=0)) + 1)
    return np.where(inside, values - expand_epochs(mean, epoch), 0.0)
