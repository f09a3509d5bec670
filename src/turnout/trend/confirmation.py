"""Find campaigns so far outside their expected value that they must be confirmed at once.

One campaign alone raises no alarm. A large deviation is named the same day, so that somebody repeats the hammer test.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.trend.epochs import expand_epochs
from turnout.trend.quantities import is_damping

if TYPE_CHECKING:
    from turnout.config.settings.trend import TrendSettings
    from turnout.trend.charts import Charts

LEAST_SD = 3.0  # standard deviations that a deviation must have, however large it is in percent
MIN_EARLIER = 3  # campaigns before one that is compared with their mean while the chart still learns


def deviation_limit(sd: np.ndarray, settings: TrendSettings) -> np.ndarray:
    r"""Deviation from which a campaign is far outside.

    .. math:: \max(\tau, \min(c s, \max(p, 3 s)))

    with ``confirm_sd`` c, ``confirm_percent`` p and the target :math:`\tau`: nobody repeats a test for less than the
    target.

    Parameters
    ----------
    sd : (...) array of float
        Standard deviation s of one campaign. [%]
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    (...) array of float
        Limit. [%]

    Examples
    --------
    >>> from turnout.config.settings.trend import TrendSettings
    >>> deviation_limit(np.array([0.1, 0.5, 3.0, 5.0]), TrendSettings())
    array([ 1.5,  3. , 10. , 15. ])
    """
    large = np.maximum(settings.confirm_percent, LEAST_SD * sd)
    return np.maximum(settings.target_percent, np.minimum(settings.confirm_sd * sd, large))


def far_deviations(charts: Charts, settings: TrendSettings) -> np.ndarray:
    """Deviation of every campaign of a hammer test whose resonance is far outside its expected value.

    A damping ratio asks for no repetition: it scatters far more than its resonance, which shows the same loss.

    A settled campaign is compared with the chart, with and without siblings, for a loss may be common to many
    sections. Without a temperature, the standard deviation contains the effect of the temperatures of the baseline.
    While a level is learned, a campaign is compared with the mean of the earlier ones of its epoch.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    settings : TrendSettings
        Settings of the charts.

    Returns
    -------
    (n_chart, n_campaign) array of float
        Measured minus expected [%], nan where the campaign is not far outside.
    """
    p, n = charts.prepared, len(charts.prepared.panel.charts)
    sd = charts.guard[:, None] * charts.sigma
    settled = p.baseline.complete[:, None] & ~charts.learning
    deviation = _beyond(np.where(settled, charts.residual, np.nan), sd, settings)
    alone, sd_alone = _deviation_alone(charts, n)
    sections = deviation[:n]
    own = _beyond(np.where(settled[:n], alone, np.nan), sd_alone, settings)
    sections = np.where(np.isfinite(sections), sections, own)
    early = _beyond(*_deviation_from_earlier(charts, ~settled[:n], settings), settings, by_percent=True)
    deviation[:n] = np.where(np.isfinite(early), early, sections)
    is_judged = (p.charts["source"] == "hammer").to_numpy() & ~is_damping(p.charts["band"])
    return np.where(is_judged[:, None], deviation, np.nan)


def _beyond(values: np.ndarray, sd: np.ndarray, settings: TrendSettings, by_percent: bool = False) -> np.ndarray:
    """Values beyond their limit, nan elsewhere; ``by_percent``: the limit is max(confirm_percent, LEAST_SD sd)."""
    with np.errstate(invalid="ignore"):
        limit = deviation_limit(sd, settings)
        if by_percent:
            limit = np.maximum(settings.confirm_percent, LEAST_SD * sd)
        return np.where(np.abs(values) > limit, values, np.nan)


def _deviation_alone(charts: Charts, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Deviation of the sections from their own level and its standard deviation, (n_section, n_campaign) each. [%]"""
    p, base = charts.prepared, charts.prepared.baseline
    level = expand_epochs(charts.level[:n], p.epoch[:n])
    f0 = base.frequency[:n, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        raw = 100.0 * (p.panel.frequency / f0 - 1.0) - level
    known = np.isfinite(p.values)
    spread = p.spread_alone[:n, None]
    extra = np.maximum(charts.sigma[:n] ** 2 - p.spread[:n, None] ** 2, 0.0)  # own error and temperature slope
    temperature = p.panel.temperature
    inside = base.inside[:n] & np.isfinite(temperature)
    count = np.maximum(inside.sum(axis=1), 1)
    mean = np.sum(np.where(inside, temperature, 0.0), axis=1) / count
    variance = np.sum(np.where(inside, (temperature - mean[:, None]) ** 2, 0.0), axis=1) / count
    season = (np.nan_to_num(base.slope[:n]) ** 2 + np.nan_to_num(base.slope_se[:n]) ** 2) * variance
    added = np.where(known, np.nan_to_num(extra), season[:, None])
    return np.where(known, p.values - level, raw), charts.guard[:n, None] * np.sqrt(spread**2 + added)


def _deviation_from_earlier(
    charts: Charts, learning: np.ndarray, settings: TrendSettings
) -> tuple[np.ndarray, np.ndarray]:
    """Deviation of learning campaigns from the mean of the earlier ones of their epoch, and their scatter. [%]

    Campaigns that deviate by more than the limit do not enter the mean. nan with fewer than ``MIN_EARLIER`` of them.
    """
    p, shape = charts.prepared, learning.shape
    frequency, epoch = p.panel.frequency, p.epoch[: shape[0]]
    deviation, scatter = np.full(shape, np.nan), np.full(shape, np.nan)
    count, total, squares = np.zeros((3, shape[0]))
    for i in range(shape[1]):
        if i:
            same = epoch[:, i] == epoch[:, i - 1]
            count, total, squares = (np.where(same, part, 0.0) for part in (count, total, squares))
        if not learning[:, i].any():
            continue
        value = frequency[:, i]
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / count
            sd = np.sqrt(np.maximum(squares / count - mean**2, 0.0) * count / (count - 1.0))
            relative, relative_sd = 100.0 * (value / mean - 1.0), 100.0 * sd / mean
            use = np.isfinite(value) & learning[:, i]
            judged = use & (count >= MIN_EARLIER)
            far = judged & (np.abs(relative) > np.maximum(settings.confirm_percent, LEAST_SD * relative_sd))
        deviation[:, i] = np.where(judged, relative, np.nan)
        scatter[:, i] = np.where(judged, relative_sd, np.nan)
        add = use & ~far
        count = count + add
        total = total + np.where(add, value, 0.0)
        squares = squares + np.where(add, value**2, 0.0)
    return deviation, scatter
