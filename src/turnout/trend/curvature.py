"""Curvature of a temperature law: of sections without siblings, and of the median of a turnout."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import DAYS_PER_YEAR
from turnout.trend.epochs import by_epoch, expand_epochs

if TYPE_CHECKING:
    from turnout.trend.baseline import Baseline


# Prior standard deviation of the curvature about 0 [%/°C²], a choice: at 15 °C from the mean of the year 2.3 %, four
# times the scatter of a campaign.
CURVATURE_PRIOR_SD = 0.01
MAX_DAYS_OF_YEAR = 92.0  # without a campaign: a curvature of the other seasons says nothing of the one left out


@dataclass(frozen=True)
class CurvedLaw:
    """Law b (T - T_0) + c (T - T_0)² of each chart about its ``reference`` T_0 [°C]; (n_chart,) arrays.

    ``slope`` b [%/°C] and ``quadratic`` c [%/°C²] are 0 where the law is straight (``is_curved`` False).
    ``spread_ratio`` is the standard deviation of the baseline about this law over that about a straight one, 1 there.
    ``error`` is the root mean square error of c [%/°C²]: that of its estimate, and what the law leaves out of it.
    """

    slope: np.ndarray
    quadratic: np.ndarray
    reference: np.ndarray
    is_curved: np.ndarray
    spread_ratio: np.ndarray
    error: np.ndarray

    def term(self, temperature: np.ndarray) -> np.ndarray:
        """The law at each temperature.

        Parameters
        ----------
        temperature : (n_chart, n_campaign) array of float
            Rail temperatures. [°C]

        Returns
        -------
        (n_chart, n_campaign) array of float
            0 where the law is straight or the temperature unknown. [%]
        """
        applies = self.is_curved[:, None] & np.isfinite(temperature)
        warmer = np.where(applies, temperature - self.reference[:, None], 0.0)
        return self.slope[:, None] * warmer + self.quadratic[:, None] * warmer**2


def fit_curved_law(
    values: np.ndarray,
    temperature: np.ndarray,
    inside: np.ndarray,
    epoch: np.ndarray,
    autocorrelation: np.ndarray,
    reference: np.ndarray | None = None,
    in_every_season: np.ndarray | None = None,
) -> CurvedLaw:
    r"""Curved temperature law of each chart, where its baseline shows one.

    .. math:: v_i = l_{e(i)} + b (T_i - T_0) + c (T_i - T_0)^2 + r_i

    is fitted to the baseline by least squares, and b and c are drawn towards the straight law by the share

    .. math:: \max(0, 1 - 1/F)

    with F of the test of c: a curvature no larger than its error is none, one of many errors is kept. Memory leaves n
    campaigns the information of n (1 - phi) / (1 + phi), which divides F. The prior of c is 0 ± ``CURVATURE_PRIOR_SD``:
    it keeps c bounded where the temperature hardly varied, and a year of temperatures outweighs it a hundred times.

    Parameters
    ----------
    values : (n_chart, n_campaign) array of float
        Values corrected for straight laws; nan does not count. [%]
    temperature : (n_chart, n_campaign) array of float
        Rail temperatures; nan does not count. [°C]
    inside : (n_chart, n_campaign) array of bool
        Campaigns of the baseline.
    epoch : (n_chart, n_campaign) array of int
        Number of the epoch of each campaign.
    autocorrelation : (n_chart,) array of float
        Memory from campaign to campaign, nan where unknown.
    reference : (n_chart,) array of float, optional
        T_0; by default the mean of the baseline. [°C]
    in_every_season : (n_chart,) array of bool, optional
        Baselines that may give a curvature, from ``covers_the_year``; by default all.

    Returns
    -------
    CurvedLaw
        Its slope adds to the one that ``values`` are corrected for.

    References
    ----------
    James and Stein 1961; the positive part after Baranchik 1964.
    """
    inside = inside & np.isfinite(values) & np.isfinite(temperature)
    n_campaign = inside.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        if reference is None:
            reference = np.sum(np.where(inside, temperature, 0.0), axis=1) / n_campaign
        linear = temperature - reference[:, None]
        x, y, v = (_deviation(column, inside, epoch) for column in (linear, linear**2, values))
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
        information = np.sum(across * across, axis=1)
        from_data = information / (information + left / freedom / CURVATURE_PRIOR_SD**2)
        precision = np.where(freedom > 0, np.nan_to_num(statistic / quadratic**2), 0.0) + CURVATURE_PRIOR_SD**-2
        share = np.where(freedom > 0, np.nan_to_num(from_data * np.maximum(1.0 - 1.0 / statistic, 0.0)), 0.0)
        share = share if in_every_season is None else np.where(in_every_season, share, 0.0)
        is_curved = share > 0.0
        ratio = np.sqrt((left + (1.0 - share) ** 2 * gain) / (left + gain) * (freedom + 1) / freedom)
        error = np.sqrt(1.0 / precision + np.nan_to_num((from_data - share) * quadratic) ** 2)
    slope, quadratic = (np.where(is_curved, share * term, 0.0) for term in (slope, quadratic))
    return CurvedLaw(slope, quadratic, reference, is_curved, np.where(is_curved, ratio, 1.0), error)


def covers_the_year(time: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Whether a baseline has campaigns in every season: at most ``MAX_DAYS_OF_YEAR`` of the year are without one.

    Parameters
    ----------
    time : (n_chart, n_campaign) array of float
        Time of each campaign. [d]
    inside : (n_chart, n_campaign) array of bool
        Campaigns of the baseline.

    Returns
    -------
    (n_chart,) array of bool
        False without a campaign.

    Examples
    --------
    The second one lasts two years, but has winters alone.

    >>> day = np.array([[0.0, 91.0, 182.0, 274.0], [0.0, 60.0, 365.0, 730.0]])
    >>> covers_the_year(day, np.isfinite(day))
    array([ True, False])
    """
    count = inside.sum(axis=1)
    if not inside.shape[1]:
        return count > 0
    day = np.sort(np.where(inside, np.mod(time, DAYS_PER_YEAR), np.inf), axis=1)
    latest = np.take_along_axis(day, np.maximum(count - 1, 0)[:, None], axis=1)
    with np.errstate(invalid="ignore"):
        gap = np.diff(np.hstack([latest - DAYS_PER_YEAR, day]), axis=1)
    return (count > 0) & (np.max(np.where(np.isfinite(gap), gap, 0.0), axis=1) <= MAX_DAYS_OF_YEAR)


def with_curved_laws(
    base: Baseline,
    values: np.ndarray,
    temperature: np.ndarray,
    time: np.ndarray,
    epoch: np.ndarray,
    autocorrelation: np.ndarray,
    lone: np.ndarray,
) -> tuple[Baseline, np.ndarray]:
    """Baselines and values with the curved law of each section without siblings, which would remove what they share.

    Baselines that leave out a season keep their straight law (``covers_the_year``).

    Parameters
    ----------
    base : Baseline
        Baselines with straight laws.
    values : (n_chart, n_campaign) array of float
        Frequencies in percent of f0, corrected for straight laws. [%]
    temperature : (n_chart, n_campaign) array of float
        Rail temperatures. [°C]
    time : (n_chart, n_campaign) array of float
        Time of each campaign. [d]
    epoch : (n_chart, n_campaign) array of int
        Number of the epoch of each campaign.
    autocorrelation : (n_chart,) array of float
        Memory from campaign to campaign about the straight law, nan where unknown.
    lone : (n_chart,) array of bool
        Sections without siblings.

    Returns
    -------
    (Baseline, (n_chart, n_campaign) array of float)
        The same objects where every section has siblings.
    """
    last = int(np.max(np.flatnonzero(base.inside.any(axis=0)), initial=-1)) + 1
    row = np.flatnonzero(lone & base.inside.any(axis=1))
    if not len(row):
        return base, values
    campaigns = np.ix_(row, np.arange(last))
    law = fit_curved_law(
        values[campaigns],
        temperature[campaigns],
        base.inside[campaigns],
        epoch[campaigns],
        autocorrelation[row],
        base.reference[row],
        covers_the_year(time[campaigns], base.inside[campaigns]),
    )
    slope, curvature, freedom, values = base.slope.copy(), base.curvature.copy(), base.freedom.copy(), values.copy()
    curvature_error = base.curvature_error.copy()
    curvature_error[row] = law.error
    slope[row] += law.slope
    curvature[row] = law.quadratic
    freedom[row] -= law.is_curved
    values[row] -= law.term(temperature[row])
    return replace(base, slope=slope, curvature=curvature, curvature_error=curvature_error, freedom=freedom), values


def _deviation(values: np.ndarray, inside: np.ndarray, epoch: np.ndarray) -> np.ndarray:
    """Values inside less the mean of their epoch, 0 outside."""
    mean, _ = by_epoch(np.where(inside, values, 0.0), inside, epoch, int(epoch.max(initial=0)) + 1)
    return np.where(inside, values - expand_epochs(mean, epoch), 0.0)
