"""Baseline of each chart: its campaigns, frequency, temperature slope, spread and autocorrelation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import DAYS_PER_YEAR, MAD_TO_SD
from turnout.trend.epochs import by_epoch, expand_epochs

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings

# Prior standard deviation of the temperature slope about 0. [%/°C] Resonances fall by 0.15 to 0.4 %/°C
# (docs/measuring.md), so all slopes lie within one sd. A choice; a year of temperatures outweighs it.
SLOPE_PRIOR_SD = 0.5


@dataclass(frozen=True)
class Baseline:
    """Baseline of each chart; (n_chart,) arrays unless stated.

    ``frequency`` f0 [Hz] at ``reference`` temperature [°C]; ``slope`` and its standard error ``slope_se`` [%/°C];
    ``curvature`` [%/°C²], 0 of a straight law (``turnout.trend.curvature``), and its ``curvature_error``, 0 for a
    section whose siblings remove it. ``count`` campaigns; ``freedom``: degrees of freedom after f0, slope, a curvature
    that is not 0, and one level per further epoch. ``complete`` where the baseline is long enough.
    ``without_temperature``: campaigns with a frequency but no temperature. ``inside`` is the (n_chart, n_campaign) mask
    of its campaigns.
    """

    frequency: np.ndarray
    reference: np.ndarray
    slope: np.ndarray
    slope_se: np.ndarray
    curvature: np.ndarray
    curvature_error: np.ndarray
    count: np.ndarray
    freedom: np.ndarray
    complete: np.ndarray
    without_temperature: np.ndarray
    inside: np.ndarray


def baseline_window(
    usable: np.ndarray, time: np.ndarray, least_days: float, least_campaigns: int
) -> tuple[np.ndarray, np.ndarray]:
    """Campaigns of the baseline: from the first usable one until both minimum length and minimum number are reached.

    An incomplete baseline holds all usable campaigns.

    Parameters
    ----------
    usable : (n_chart, n_campaign) array of bool
        Campaigns with frequency and temperature.
    time : (n_chart, n_campaign) array of float
        Time of each campaign. [d]
    least_days : float
        Minimum length. [d]
    least_campaigns : int
        Minimum number of campaigns.

    Returns
    -------
    (n_chart, n_campaign) and (n_chart,) arrays of bool
        Campaigns of the baseline, and whether it is complete.

    Examples
    --------
    >>> time = np.array([[0.0, 10.0, 20.0, 30.0]])
    >>> baseline_window(np.array([[True, False, True, True]]), time, 15.0, 2)
    (array([[ True, False,  True, False]]), array([ True]))
    """
    rank = np.cumsum(usable, axis=1)
    first = np.min(np.where(usable, time, np.inf), axis=1, keepdims=True, initial=np.inf)
    is_complete = usable & (rank >= least_campaigns) & (time - first >= least_days)
    before = np.cumsum(is_complete, axis=1) - is_complete == 0
    return usable & before, is_complete.any(axis=1)


def fit_baseline(
    frequency: np.ndarray,
    temperature: np.ndarray,
    time: np.ndarray,
    epoch: np.ndarray,
    settings: TrendSettings,
    aside: np.ndarray | bool = False,
) -> tuple[Baseline, np.ndarray]:
    """Fit level and temperature slope by least squares on the baseline, with one level per epoch in it.

    .. math:: 100 (f_i / f_0 - 1) = l_{e(i)} + b (T_i - T_0) + r_i

    The prior of b is 0 ± ``SLOPE_PRIOR_SD``. A year of temperatures outweighs it a thousand times. Where the
    temperature hardly varied, it keeps b bounded. f0 and T0 are means over the first epoch of the baseline.

    Parameters
    ----------
    frequency : (n_chart, n_campaign) array of float
        Natural frequencies, nan without one. [Hz]
    temperature : (n_chart, n_campaign) array of float
        Rail temperatures, nan without one. [°C]
    time : (n_chart, n_campaign) array of float
        Time of each campaign. [d]
    epoch : (n_chart, n_campaign) array of int
        Number of the epoch of each campaign.
    settings : TrendSettings
        Minimum length and number of campaigns of a baseline.
    aside : (n_chart, n_campaign) array of bool
        Campaigns of the baseline that do not count; False: none.

    Returns
    -------
    (Baseline, (n_chart, n_campaign) array of float)
        The baselines, and the frequencies in percent of f0, corrected for temperature; nan without frequency or
        temperature.
    """
    usable = np.isfinite(frequency) & np.isfinite(temperature)
    window, complete = baseline_window(usable, time, settings.baseline_days, settings.baseline_campaigns)
    inside = window & ~np.asarray(aside)
    n_epoch = int(epoch.max(initial=0)) + 1
    level_f, count = by_epoch(frequency, inside, epoch, n_epoch)
    level_t, _ = by_epoch(temperature, inside, epoch, n_epoch)
    first = np.argmax(count > 0, axis=1)[:, None]
    f0 = np.take_along_axis(level_f, first, axis=1)
    t0 = np.take_along_axis(level_t, first, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        dt = np.where(inside, temperature - expand_epochs(level_t, epoch), 0.0)
        dp = np.where(inside, 100.0 * (frequency - expand_epochs(level_f, epoch)) / f0, 0.0)
        stt, stp = np.sum(dt * dt, axis=1), np.sum(dt * dp, axis=1)
        n_base = count.sum(axis=1)
        freedom = n_base - (count > 0).sum(axis=1) - (stt > 0.0)
        rss = np.sum(dp * dp, axis=1) - np.where(stt > 0.0, stp**2 / stt, 0.0)
        scatter = np.where(freedom > 0, np.maximum(rss, 0.0) / np.maximum(freedom, 1), 0.0)
        weight = stt + scatter / SLOPE_PRIOR_SD**2
        slope = np.where(weight > 0.0, stp / weight, 0.0)
        slope_se = np.where((freedom > 0) & (weight > 0.0), np.sqrt(scatter / weight), np.nan)
        corrected = 100.0 * (frequency / f0 - 1.0) - slope[:, None] * (temperature - t0)
    missing = np.sum(np.isfinite(frequency) & ~np.isfinite(temperature), axis=1)
    straight = np.zeros(len(slope))
    fitted = Baseline(
        f0[:, 0], t0[:, 0], slope, slope_se, straight, straight, n_base, freedom, complete, missing, inside
    )  # fmt: skip
    return fitted, corrected


def spread_and_autocorrelation(
    residual: np.ndarray, inside: np.ndarray, epoch: np.ndarray, freedom: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""Spread s and lag-one autocorrelation of a residual over the baseline, about the mean of each epoch.

    .. math:: s^2 = \sum_B r_i^2 / \nu, \qquad
              \rho = \frac{\sum_B r_i r_{i-1}}{\sum_B r_i^2}, \quad
              \rho \leftarrow \frac{n_B \rho + p}{n_B - p - 2}, \quad p = n_B - \nu

    The second step removes the bias of a short series, -(p + (p + 2) rho) / n. For an estimated mean, p = 1, it is
    that of Marriott and Pope (Biometrika 41, 1954). A temperature slope, smooth over the year, counts as another
    mean. rho is clipped to 0 ... 0.9. Neighbours more than 1.5 usual intervals apart are no pair.

    Parameters
    ----------
    residual : (n_chart, n_campaign) array of float
        Residuals; nan does not count.
    inside : (n_chart, n_campaign) array of bool
        Campaigns of the baseline.
    epoch : (n_chart, n_campaign) array of int
        Number of the epoch of each campaign.
    freedom : (n_chart,) array of int
        Degrees of freedom of the spread.
    time : (n_chart, n_campaign) array of float
        Time of each campaign. [d]

    Returns
    -------
    spread : (n_chart,) array of float
        nan without degrees of freedom. [unit of residual]
    autocorrelation : (n_chart,) array of float
        rho; nan with fewer than 6 pairs.

    References
    ----------
    Marriott and Pope, Bias in the estimation of autocorrelations, Biometrika 41, 1954.
    """
    inside = inside & np.isfinite(residual)
    n_epoch = int(epoch.max(initial=0)) + 1
    mean, count = by_epoch(np.where(inside, residual, 0.0), inside, epoch, n_epoch)
    centred = np.where(inside, residual - expand_epochs(mean, epoch), 0.0)
    power = np.sum(centred**2, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = np.sqrt(np.where(freedom > 0, power / np.maximum(freedom, 1), np.nan))
        near = _intervals(time, inside) <= 1.5 * usual_interval(time, inside)[:, None]
        pairs = near.sum(axis=1)
        lagged = np.take_along_axis(centred, np.maximum(previous(inside), 0), axis=1)
        rho = np.sum(centred * lagged * near, axis=1) / np.where(power > 0.0, power, np.nan)
        n_base = count.sum(axis=1)
        fitted = n_base - freedom
        rho = (n_base * rho + fitted) / np.maximum(n_base - fitted - 2, 1)
    return spread, np.where(pairs >= 6, np.clip(rho, 0.0, 0.9), np.nan)


def previous(inside: np.ndarray) -> np.ndarray:
    """Column of the last campaign of the mask before each column, -1 where there is none.

    Parameters
    ----------
    inside : (n_chart, n_campaign) array of bool
        The mask.

    Returns
    -------
    (n_chart, n_campaign) array of int
        Number of the column.

    Examples
    --------
    >>> previous(np.array([[True, False, True, True]]))
    array([[-1,  0,  0,  2]])
    """
    column = np.maximum.accumulate(np.where(inside, np.arange(inside.shape[1]), -1), axis=1)
    return np.concatenate([np.full((len(inside), 1), -1), column], axis=1)[:, :-1]


LONE_SD = 6.0  # robust standard deviations by which a lone outlier lies outside both neighbours, as in mode_scatter.sql
MIN_STEPS = 7  # steps from campaign to campaign that give the robust standard deviation, as in mode_scatter.sql


def lone_outliers(values: np.ndarray, epoch: np.ndarray | int = 0) -> np.ndarray:
    r"""Which values of each series lie far outside both of their neighbours, on the same side.

    A change shows in every campaign from its onset on, so one campaign alone is an error of that campaign. Far are
    ``LONE_SD`` robust standard deviations of a value, from the steps between neighbours,

    .. math:: s = 1.4826\, \mathrm{median} |v_i - v_{i-1}| / \sqrt{2}

    so that neither a change nor the outlier widens it. The first and the last value of an epoch have one neighbour:
    they cannot be told from a change.

    Parameters
    ----------
    values : (n,) or (n_chart, n) array of float
        Values in order of time, nan where there is none.
    epoch : (n_chart, n) array of int
        Number of the epoch of each value; 0: all are in one.

    Returns
    -------
    (n,) or (n_chart, n) array of bool
        True for a value that stands alone; none with fewer than ``MIN_STEPS`` steps.

    Examples
    --------
    >>> np.flatnonzero(lone_outliers(np.array([0.0, 1.0, 0.0, 9.0, 1.0, 0.0, 1.0, -9.0, -8.0, -9.0])))
    array([3])
    """
    if np.size(values) == 0:
        return np.zeros(np.shape(values), dtype=bool)
    rows = np.atleast_2d(values)
    epoch = np.broadcast_to(epoch, rows.shape)
    inside = np.isfinite(rows)
    before = previous(inside)
    at = np.maximum(before, 0)
    is_pair = inside & (before >= 0) & (np.take_along_axis(epoch, at, axis=1) == epoch)
    step = np.where(is_pair, rows - np.take_along_axis(rows, at, axis=1), np.nan)
    after = rows.shape[1] - 1 - previous(inside[:, ::-1])[:, ::-1]
    next_step = np.take_along_axis(np.pad(step, ((0, 0), (0, 1)), constant_values=np.nan), after, axis=1)
    size = np.sort(np.abs(step), axis=1)  # nan at the end
    count = is_pair.sum(axis=1, keepdims=True)
    middle = np.maximum(np.concatenate([count - 1, count], axis=1) // 2, 0)
    limit = LONE_SD * MAD_TO_SD / np.sqrt(2.0) * np.take_along_axis(size, middle, axis=1).mean(axis=1)
    beyond = np.maximum(np.minimum(step, -next_step), np.minimum(-step, next_step))  # the nearer neighbour
    judged = (count >= MIN_STEPS) & (limit > 0.0)[:, None]
    return (judged & (beyond > limit[:, None])).reshape(np.shape(values))


def usual_interval(time: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Median time between neighbouring campaigns of the mask, nan where there are none.

    Parameters
    ----------
    time : (n_chart, n_campaign) array of float
        Time of each campaign. [d]
    inside : (n_chart, n_campaign) array of bool
        The mask.

    Returns
    -------
    (n_chart,) array of float
        Median interval, in the unit of ``time``.

    Examples
    --------
    >>> usual_interval(np.array([[0.0, 7.0, 10.0, 14.0, 60.0]]), np.array([[True, True, False, True, True]]))
    array([7.])
    """
    step = np.sort(_intervals(time, inside), axis=1)
    if step.shape[1] == 0:
        return np.full(len(step), np.nan)
    count = np.isfinite(step).sum(axis=1)
    return np.where(count > 0, step[np.arange(len(step)), np.maximum(count - 1, 0) // 2], np.nan)


MAX_INTERVAL = 1.5 * DAYS_PER_YEAR  # d, a longer one is a pause of the measurements


def mean_interval(time: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Mean time between neighbouring campaigns of the mask, without pauses longer than ``MAX_INTERVAL``.

    Three campaigns within a week of every quarter have a usual interval of days, and a mean one of a month.

    Parameters
    ----------
    time : (n_chart, n_campaign) array of float
        Time of each campaign. [d]
    inside : (n_chart, n_campaign) array of bool
        The mask.

    Returns
    -------
    (n_chart,) array of float
        Mean interval [d], nan where there is none.

    Examples
    --------
    >>> mean_interval(np.array([[0.0, 2.0, 4.0, 94.0, 96.0, 1096.0]]), np.ones((1, 6), bool))
    array([24.])
    """
    step = _intervals(time, inside)
    counts = step <= MAX_INTERVAL
    return np.sum(step, axis=1, where=counts) / np.where(counts.any(axis=1), counts.sum(axis=1), np.nan)


def _intervals(time: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """(n_chart, n_campaign) time since the campaign of the mask before each one; infinite where there is none."""
    before = previous(inside)
    with np.errstate(invalid="ignore"):
        step = time - np.take_along_axis(time, np.maximum(before, 0), axis=1)
    return np.where(inside & (before >= 0), step, np.inf)


def pooled_autocorrelation(autocorrelation: np.ndarray, classes: np.ndarray) -> np.ndarray:
    """Autocorrelation of each chart: the mean over the charts of its class; 0 where none is known.

    The estimate of one chart from 52 campaigns scatters by 0.13, which would cause false alarms. The mean scatters
    far less.

    Parameters
    ----------
    autocorrelation : (n_chart,) array of float
        Estimate of each chart, nan where there is none.
    classes : (n_chart,) array of int
        Class of each chart.

    Returns
    -------
    (n_chart,) array of float
        Mean of the class of each chart.

    Examples
    --------
    >>> pooled_autocorrelation(np.array([0.2, 0.4, np.nan, 0.1]), np.array([0, 0, 0, 1]))
    array([0.3, 0.3, 0.3, 0.1])
    """
    is_valid = np.isfinite(autocorrelation)
    n = int(classes.max(initial=-1)) + 1
    total = np.bincount(classes[is_valid], weights=autocorrelation[is_valid], minlength=n)
    count = np.bincount(classes[is_valid], minlength=n)
    return (total / np.maximum(count, 1))[classes]
