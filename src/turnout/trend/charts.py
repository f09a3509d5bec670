"""The finished control charts of a panel: residuals, CUSUM statistics and open alarms, as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from turnout.trend.baseline import lone_outliers

if TYPE_CHECKING:
    from turnout.trend.preparation import Prepared


@dataclass
class Charts:
    """Finished charts of a panel; ``chart_rows``, ``baseline_rows`` and ``alarm_rows`` make tables of them.

    (n_chart, n_campaign) arrays: ``residual`` and ``sigma`` [%], ``z``, ``down``, ``up`` (CUSUM), ``down_open``,
    ``up_open`` (alarm open), ``down_began``, ``up_began`` (last campaign before the change), ``learning``,
    ``fitted`` (expected value, % of f0), ``extra`` (allowance for the level of a later epoch), ``deviation`` (of a
    campaign that must be confirmed [%], else nan). ``is_sibling``
    (serves as sibling of other sections) has the sections alone. (n_chart,) arrays: ``allowance``, ``n_learning``,
    ``guard``, ``autocorrelation``, ``widening``, ``threshold_down``, ``threshold_up``. (n_chart, n_epoch) arrays:
    ``level``, ``shift``, ``n_learned``.
    """

    prepared: Prepared
    allowance: np.ndarray
    n_learning: np.ndarray
    guard: np.ndarray
    autocorrelation: np.ndarray
    widening: np.ndarray
    level: np.ndarray
    shift: np.ndarray
    n_learned: np.ndarray
    residual: np.ndarray
    sigma: np.ndarray
    z: np.ndarray
    fitted: np.ndarray
    learning: np.ndarray
    is_sibling: np.ndarray
    extra: np.ndarray
    threshold_down: np.ndarray
    threshold_up: np.ndarray
    down: np.ndarray
    up: np.ndarray
    down_open: np.ndarray
    up_open: np.ndarray
    down_began: np.ndarray
    up_began: np.ndarray
    deviation: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    def present_campaigns(self, chart: int) -> np.ndarray:
        """Campaigns of the present epoch of a chart with a value, without ``lone_outliers``.

        Parameters
        ----------
        chart : int
            Number of the chart.

        Returns
        -------
        (n,) array of int
            Numbers of the campaigns.
        """
        epoch, residual, sigma = self.prepared.epoch[chart], self.residual[chart], self.sigma[chart]
        campaigns = np.flatnonzero(np.isfinite(residual) & (epoch == epoch[-1]))
        return campaigns[~lone_outliers(residual[campaigns] / sigma[campaigns])]
