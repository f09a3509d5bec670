"""Scatter of the values of components of one kind, such as the railpads of a turnout."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import median_abs_deviation

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance


def spread_of_others(case: Case, fit: Fit, component: Nuisance, without_outliers: bool = False) -> float | None:
    r"""Standard deviation of the other components of the same kind, as fitted, with the errors of the fit.

    .. math:: s^2 = \overline{(v_j - \bar v)^2} + \overline{\sigma_j^2}

    :math:`v_j` are the fitted values, and :math:`\sigma_j` their standard errors.

    Parameters
    ----------
    case : Case
    fit : Fit
        Its covariance begins with the nuisances, in their order.
    component : Nuisance
        One of several, with its index.
    without_outliers : bool
        Take the first term from the median absolute deviation, which a few unusual components do not widen.

    Returns
    -------
    float or None
        In the unit of the component. None with fewer than ``THRESHOLDS.min_siblings`` others.
    """
    others = [
        k for k, n in enumerate(case.nuisances) if n.group == component.group and n.index not in (None, component.index)
    ]
    if len(others) < THRESHOLDS.min_siblings:
        return None
    values = np.array([fit.values[case.nuisances[k].name] for k in others])
    spread = median_abs_deviation(values, scale="normal") if without_outliers else values.std()
    return float(np.sqrt(spread**2 + np.mean(np.diag(fit.covariance)[others])))
