"""Compute CUSUM thresholds from the allowed false-alarm rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.trend.quantities import is_damping
from turnout.trend.roots import find_root

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from numpy.typing import ArrayLike

    from turnout.config.settings.trend import TrendSettings

OVERSHOOT = 1.166  # sd; twice Siegmund's correction of 0.583 for the excess over the threshold


def run_length(threshold: ArrayLike, allowance: ArrayLike, shift: ArrayLike = 0.0) -> np.ndarray:
    r"""Mean campaigns to an alarm of a one-sided CUSUM of standard normal values.

    .. math:: ARL = \frac{e^{-2DH} - 1 + 2DH}{2D^2},\quad D = \delta - k,\\ H = h + 1.166

    Parameters
    ----------
    threshold, allowance, shift : float or (...) arrays of float
        h, k and the shift delta, all in standard deviations; H² where D = 0.

    Returns
    -------
    float or (...) array of float
        Mean number of campaigns, of the shape to which the three broadcast.

    References
    ----------
    Siegmund, Sequential Analysis, 1985, eq. 2.57.

    Examples
    --------
    The chart k = 0.5, h = 5 has 930 campaigns (Montgomery prints 465 two-sided); the approximation is 1 % high.

    >>> print(f"{run_length(5.0, 0.5) / 930:.2f}")
    1.01
    """
    height = np.asarray(threshold, dtype=float) + OVERSHOOT
    drift = np.asarray(shift, dtype=float) - allowance
    flat = np.abs(drift) < 1e-9
    safe = np.where(flat, 1.0, drift)
    curved = (np.expm1(-2.0 * safe * height) + 2.0 * safe * height) / (2.0 * safe**2)
    return np.where(flat, height**2, curved)[()]


def threshold_for(campaigns: float, allowance: float) -> float:
    """Threshold h that gives one false alarm in ``campaigns`` on average (inverse of ``run_length``).

    Parameters
    ----------
    campaigns : float
        Mean number of campaigns to a false alarm.
    allowance : float
        Allowance k. [sd]

    Returns
    -------
    float
        Threshold h. [sd]

    Examples
    --------
    >>> print(f"{threshold_for(5600, 1.0):.2f} {threshold_for(56000, 0.5):.2f}")
    3.50 9.07
    """
    return find_root(
        lambda h: float(np.log(run_length(h, allowance)) - np.log(campaigns)), 0.0, 150.0 / allowance, 1e-12
    )


def run_lengths(bands: Sequence[str] | np.ndarray | pd.Series, direction: str, settings: TrendSettings) -> np.ndarray:
    """Mean campaigns between false alarms: fewer for the harmful direction.

    Harmful is down for stiffness, up for acceleration. Of a damping ratio both directions are alike.

    Parameters
    ----------
    bands : (n_chart,) sequence of str
        Band of each chart.
    direction : str
        "down" or "up".
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    (n_chart,) array of float
        Mean number of campaigns.

    Examples
    --------
    >>> from turnout.config.settings.trend import TrendSettings
    >>> run_lengths(np.array(["ballast", "amplitude"], dtype=object), "down", TrendSettings())
    array([ 5600., 56000.])
    """
    harmful = (np.asarray(bands) == "amplitude") == (direction == "up")
    lengths = np.where(harmful, settings.run_length_loss, settings.run_length_gain)
    return np.where(is_damping(bands), settings.run_length_damping, lengths)
