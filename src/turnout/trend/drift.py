"""Fit the slope of residuals over time, with autocorrelated errors, and control the false-discovery rate."""

import numpy as np
from scipy.special import stdtr

from turnout.constants import DAYS_PER_YEAR


def slopes(
    residual: np.ndarray, time: np.ndarray, mask: np.ndarray, autocorrelation: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    r"""Least-squares slope of each chart against time, its standard error widened for AR(1) errors.

    .. math:: s_b^2 = \frac{\sum r^2}{\nu \sum (t - \bar t)^2}, \quad \nu = n \frac{1 - \phi}{1 + \phi} - 2

    Parameters
    ----------
    residual, time, mask : (n_chart, n_campaign) arrays
        Residual [%], time [d], campaigns that count.
    autocorrelation : (n_chart,) array of float
        phi.

    Returns
    -------
    slope, error, p_value : (n_chart,) arrays of float
        [%/a], [%/a], two-sided by Student's t; nan where nu is below 3.

    References
    ----------
    Variance of a slope under AR(1): Santer et al., J. Geophys. Res. 105 (2000), eq. 6, effective sample size.

    Examples
    --------
    >>> t = np.arange(20.0)[None] * 36.525
    >>> b, se, p = slopes(0.1 * t / 36.525, t, np.ones((1, 20), bool), np.zeros(1))
    >>> print(f"{b[0]:.3f}")
    1.000
    """
    mask = mask & np.isfinite(residual)
    years = np.where(mask, time / DAYS_PER_YEAR, 0.0)
    count = mask.sum(axis=1)
    n = np.maximum(count, 1)
    x = np.where(mask, years - (years.sum(axis=1) / n)[:, None], 0.0)
    y = np.where(mask, residual, 0.0)
    y = np.where(mask, y - (y.sum(axis=1) / n)[:, None], 0.0)
    sxx = np.sum(x * x, axis=1)
    shrink = (1.0 - autocorrelation) / (1.0 + autocorrelation)
    freedom = count * shrink - 2.0
    with np.errstate(invalid="ignore", divide="ignore"):
        slope = np.sum(x * y, axis=1) / sxx
        rss = np.sum((y - slope[:, None] * x) ** 2, axis=1)
        error = np.sqrt(rss / (count * shrink - 2.0) / sxx)
        is_valid = (freedom >= 3.0) & (sxx > 0.0)
        p_value = 2.0 * stdtr(np.maximum(freedom, 1.0), -np.abs(slope / error))
    slope, error, p_value = (np.where(is_valid, value, np.nan) for value in (slope, error, p_value))
    return slope, error, p_value


def span(time: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Time from the first to the last campaign of the mask; 0 where there is none.

    Parameters
    ----------
    time : (n_chart, n_campaign) array of float
        Time of each campaign. [d]
    mask : (n_chart, n_campaign) array of bool
        Campaigns that count.

    Returns
    -------
    (n_chart,) array of float
        Length of time. [d]
    """
    last = np.max(np.where(mask, time, -np.inf), axis=1, initial=-np.inf)
    first = np.min(np.where(mask, time, np.inf), axis=1, initial=np.inf)
    return np.where(mask.any(axis=1), last - first, 0.0)


def adjusted_p_values(p_value: np.ndarray) -> np.ndarray:
    """Benjamini and Hochberg's adjusted p values over the charts that have one, nan elsewhere.

    Parameters
    ----------
    p_value : (n_chart,) array of float
        P values, nan where there is none.

    Returns
    -------
    (n_chart,) array of float
        Adjusted p values.

    References
    ----------
    Benjamini and Hochberg, Controlling the false discovery rate, J. Royal Stat. Soc. B 57, 1995.

    Examples
    --------
    >>> adjusted_p_values(np.array([0.01, np.nan, 0.04])).round(3)
    array([0.02,  nan, 0.04])
    """
    adjusted = np.full(p_value.shape, np.nan)
    is_valid = np.isfinite(p_value)
    if is_valid.any():
        p = p_value[is_valid]
        order = np.argsort(p)
        scaled = p[order] * (p.size / np.arange(1, p.size + 1))
        p[order] = np.minimum(np.minimum.accumulate(scaled[::-1])[::-1], 1.0)
        adjusted[is_valid] = p
    return adjusted
