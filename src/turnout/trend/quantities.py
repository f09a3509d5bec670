"""Say what the bands of charts mean: a resonance, its damping ratio, or an acceleration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from turnout.config.settings.trend import TrendSettings

RESONANCES = ("ballast", "railpad")
DAMPING_SCALE = 100.0  # charts hold damping ratios in percent of critical damping
ACCELERATION = "amplitude"  # band of the weekly peak acceleration under trains
DAMPING_ENDING = "_damping"  # the band of the damping ratio of a resonance ends with it


def is_damping(bands: Sequence[str] | np.ndarray | pd.Series) -> np.ndarray:
    """Whether each band is a damping ratio.

    Parameters
    ----------
    bands : (n,) sequence of str
        Bands of charts.

    Returns
    -------
    (n,) array of bool
        True for a damping ratio.

    Examples
    --------
    >>> is_damping(["ballast", "ballast_damping"])
    array([False,  True])
    """
    return np.array([str(band).endswith(DAMPING_ENDING) for band in bands], dtype=bool)


def resonances_of(bands: Sequence[str] | np.ndarray | pd.Series) -> np.ndarray:
    """The resonance that each band belongs to; other bands as they are.

    Parameters
    ----------
    bands : (n,) sequence of str
        Bands of charts.

    Returns
    -------
    (n,) array of str
        Bands without the ending of a damping ratio.

    Examples
    --------
    >>> print(resonances_of(["railpad_damping", "amplitude"]))
    ['railpad' 'amplitude']
    """
    return np.array([str(band).removesuffix(DAMPING_ENDING) for band in bands], dtype=object)


def targets(bands: Sequence[str] | np.ndarray | pd.Series, settings: TrendSettings) -> np.ndarray:
    """Change that each chart is to show.

    Parameters
    ----------
    bands : (n,) sequence of str
        Bands of charts.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    (n,) array of float
        Target. [%]

    Examples
    --------
    >>> from turnout.config.settings.trend import TrendSettings
    >>> targets(["railpad", "railpad_damping", "amplitude"], TrendSettings()).tolist()
    [1.5, 20.0, 10.0]
    """
    is_acceleration = np.array([str(band) == ACCELERATION for band in bands], dtype=bool)
    target = np.where(is_damping(bands), settings.target_damping_percent, settings.target_percent)
    return np.where(is_acceleration, settings.target_acceleration_percent, target)
