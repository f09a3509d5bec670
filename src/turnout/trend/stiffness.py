"""Decide which stiffness of a section changed, ballast or railpads, from its two resonances together.

Ballast and railpad resonance are coupled: a softer ballast lowers the railpad resonance a little, and the reverse.
Judged alone, a small fall of one resonance may name the wrong component.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri, ndtri

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.trend.charts import Charts

BANDS = ("ballast", "railpad")
COMPONENTS = ("ballast", "pad")  # the spring that holds most of the energy of each band
# Half a sleeper over the rail of one sleeper bay: a light wooden sleeper under 60E1. Heavier ones couple less.
MIN_MASS_RATIO = 1.2
REJECTION_PROBABILITY = 0.002  # a single component is ruled out below it: the true one is, in one case of 500
MAX_DEVIATION = 4.0  # errors between a value and the fit of the change
NORMAL_QUANTILE = -float(ndtri(0.025))


@dataclass(frozen=True)
class ResonancePair:
    """Values of both resonances of one section, each since the last event that resets it.

    ``time`` [d], ``values`` and ``error`` [%] are (n,) arrays by band; an error is the standard deviation of a value,
    guarded and with its memory. ``coupling`` are the limits of ``coupling_limits``.
    """

    time: Mapping[str, np.ndarray]
    values: Mapping[str, np.ndarray]
    error: Mapping[str, np.ndarray]
    coupling: tuple[float, float]


@dataclass(frozen=True)
class StiffnessChange:
    """Which ``component`` changed: "ballast", "pad", "both", or "either" where the data do not decide.

    ``ballast`` and ``pad`` are (change, low, high) of the stiffness with its 95 % interval [%], nan where unknown. A
    component that is not named has changed by 0.
    """

    component: str
    ballast: tuple[float, float, float]
    pad: tuple[float, float, float]


def coupling_limits(frequency_ratio: float, min_mass_ratio: float = MIN_MASS_RATIO) -> tuple[float, float]:
    r"""Share of the ballast in the energy of the railpad resonance, and of the pads in that of the ballast resonance.

    Rail (mass m) on pads (k_p), sleeper (M) on ballast (k_b), as a chain of two degrees of freedom. Both shares are the
    same number :math:`\alpha`, and

    .. math:: \begin{pmatrix} d\ln f_1 \\ d\ln f_2 \end{pmatrix} = \tfrac12
              \begin{pmatrix} 1-\alpha & \alpha \\ \alpha & 1-\alpha \end{pmatrix}
              \begin{pmatrix} d\ln k_b \\ d\ln k_p \end{pmatrix}, \qquad
              \alpha = 1 - \frac{\lambda_2 (a - \lambda_1)}{a (\lambda_2 - \lambda_1)}

    with :math:`\lambda_i = (2\pi f_i)^2` and :math:`a = k_p / m`, the larger root of
    :math:`a^2 (1 + m/M) - a (\lambda_1 + \lambda_2) + \lambda_1 \lambda_2 = 0`. An infinite track with rail, pads,
    sleepers and ballast has the same resonances, for a unit of its length.

    Parameters
    ----------
    frequency_ratio : float
        Railpad over ballast resonance.
    min_mass_ratio : float
        Smallest M / m.

    Returns
    -------
    (float, float)
        Limits of the share. The lower one is 0, since damping moves the identified resonances as well. The upper one is
        at most 1/2, for two resonances as close as the masses allow, or unknown ones.

    References
    ----------
    Nelson, Simplified calculation of eigenvector derivatives, AIAA J. 14, 1976, for the derivative of an eigenvalue.

    Examples
    --------
    >>> print(f"{coupling_limits(4.0, 4.0)[1]:.3f}")
    0.018
    >>> coupling_limits(1.2)
    (0.0, 0.5)
    """
    return 0.0, coupling_share(frequency_ratio, min_mass_ratio)


def coupling_share(frequency_ratio: float, mass_ratio: float) -> float:
    """The share of ``coupling_limits`` for one ratio of the masses.

    Parameters
    ----------
    frequency_ratio : float
        Railpad over ballast resonance.
    mass_ratio : float
        Sleeper over rail.

    Returns
    -------
    float
        Share, at most 1/2.
    """
    high = frequency_ratio**2
    together, product, factor = 1.0 + high, high, 1.0 + 1.0 / mass_ratio
    discriminant = together**2 - 4.0 * factor * product
    if not discriminant > 0.0 or not frequency_ratio > 1.0:
        return 0.5
    pads = (together + np.sqrt(discriminant)) / (2.0 * factor)
    return float(np.clip(1.0 - high * (pads - 1.0) / (pads * (high - 1.0)), 0.0, 0.5))


def chart_numbers(charts: Charts) -> dict[tuple[str, str, str, str], int]:
    """Number of each chart by turnout, section, source and band.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.

    Returns
    -------
    dict
        Numbers of the charts.
    """
    columns = (charts.prepared.charts[name] for name in ("turnout_id", "section_id", "source", "band"))
    return {key: i for i, key in enumerate(zip(*columns))}


def resonance_pair(
    charts: Charts, chart: int, numbers: Mapping[tuple[str, str, str, str], int]
) -> ResonancePair | None:
    """Both resonances of the section of a chart.

    Parameters
    ----------
    charts : Charts
        Finished charts of a panel.
    chart : int
        Number of the chart.
    numbers : mapping
        Result of ``chart_numbers``.

    Returns
    -------
    ResonancePair or None
        None for a chart of another quantity, and where the other resonance has no chart.
    """
    p = charts.prepared
    row = p.charts.iloc[chart]
    chart_of = {band: numbers.get((row["turnout_id"], row["section_id"], row["source"], band), -1) for band in BANDS}
    if row["band"] not in BANDS or min(chart_of.values()) < 0:
        return None
    time, values, error = {}, {}, {}
    for band in BANDS:
        i = chart_of[band]
        columns = charts.present_campaigns(i)
        columns = columns[np.isfinite(charts.sigma[i, columns])]
        time[band], values[band] = p.time[i, columns], charts.residual[i, columns]
        error[band] = charts.sigma[i, columns] * charts.guard[i] * charts.widening[i]
    low, high = (_mean_frequency(charts, chart_of[band]) for band in BANDS)
    return ResonancePair(time, values, error, coupling_limits(high / low if low > 0.0 else np.nan))


def _mean_frequency(charts: Charts, chart: int) -> float:
    """Baseline frequency of a section [Hz]; of a whole turnout the mean of its sections."""
    p = charts.prepared
    n_section = len(p.panel.charts)
    if chart < n_section:
        return float(p.baseline.frequency[chart])
    members = p.panel.charts["group"].to_numpy() == p.charts["group"].iloc[chart]
    frequency = p.baseline.frequency[:n_section][members]
    return float(np.mean(frequency[np.isfinite(frequency)])) if np.isfinite(frequency).any() else float("nan")


def stiffness_change(pair: ResonancePair | None, course: tuple[tuple[str, float], ...]) -> StiffnessChange:
    r"""Component that changed, with the size of its change.

    Both resonances are fitted with changes of the given shapes and onsets, and their sums are compared. A component
    alone is rejected where the changes are too far from its line for every coupling within the limits,

    .. math:: \chi^2 = \min_\alpha \frac{(\alpha x_1 - (1 - \alpha) x_2)^2}{\alpha^2 v_1 + (1 - \alpha)^2 v_2}

    for the ballast, and with the resonances exchanged for the pads. The one that is not rejected is named; "either" if
    none is, "both" if both are.

    Parameters
    ----------
    pair : ResonancePair or None
        Both resonances; None gives "either".
    course : tuple of (str, float)
        "step" or "drift", and the onset [d], of each change; empty gives "either".

    Returns
    -------
    StiffnessChange
        The component and both changes.
    """
    unknown = (float("nan"),) * 3
    if pair is None or not course:
        return StiffnessChange("either", unknown, unknown)
    x, variance = np.array([_log_change(pair, band, course) for band in BANDS]).T
    if not (np.isfinite(x).all() and np.isfinite(variance).all()):
        return StiffnessChange("either", unknown, unknown)
    return judged_change(x, variance, pair.coupling)


def judged_change(x: np.ndarray, variance: np.ndarray, coupling: tuple[float, float]) -> StiffnessChange:
    """Component and sizes from the changes of both resonances.

    Parameters
    ----------
    x : (2,) array of float
        Change of the logarithm of the ballast and the railpad resonance.
    variance : (2,) array of float
        Their variances.
    coupling : (float, float)
        Limits of the share, see ``coupling_limits``.

    Returns
    -------
    StiffnessChange
        The component and both changes.

    Examples
    --------
    The ballast has lost a tenth of its stiffness.

    >>> change = judged_change(np.log([0.95, 0.998]), np.array([2e-3, 2e-3]) ** 2, (0.0, 0.08))
    >>> change.component, round(change.ballast[0], 1), change.pad
    ('ballast', -10.1, (0.0, 0.0, 0.0))
    """
    shares = np.linspace(*coupling, 33)
    limit = chdtri(1, REJECTION_PROBABILITY)
    is_possible = [
        np.min((shares * x[i] - (1.0 - shares) * x[1 - i]) ** 2
               / (shares**2 * variance[i] + (1.0 - shares) ** 2 * variance[1 - i])) <= limit
        for i in (0, 1)
    ]  # fmt: skip
    if is_possible[0] != is_possible[1]:
        i = 0 if is_possible[0] else 1
        own = _extremes([_one_component(x, variance, share, i) for share in coupling])
        none = (0.0, 0.0, 0.0)
        return StiffnessChange(COMPONENTS[i], *((own, none) if i == 0 else (none, own)))
    # two resonances in one place do not separate the components
    pairs = [_two_components(x, variance, min(share, 0.45)) for share in coupling]
    sizes = [_extremes([pair[i] for pair in pairs]) for i in (0, 1)]
    return StiffnessChange("either" if is_possible[0] else "both", sizes[0], sizes[1])


def _one_component(x: np.ndarray, variance: np.ndarray, share: float, i: int) -> tuple[float, float]:
    """Change of the logarithm of the stiffness of component ``i`` alone, and its standard error."""
    slope = 0.5 * np.array([1.0 - share, share])[:: 1 if i == 0 else -1]
    precision = float(np.sum(slope**2 / variance))
    return float(np.sum(slope * x / variance)) / precision, precision**-0.5


def _two_components(x: np.ndarray, variance: np.ndarray, share: float) -> list[tuple[float, float]]:
    """Changes of the logarithms of both stiffnesses, and their standard errors."""
    inverse = np.linalg.inv(0.5 * np.array([[1.0 - share, share], [share, 1.0 - share]]))
    return list(zip((inverse @ x).tolist(), np.sqrt(inverse**2 @ variance).tolist()))


def _extremes(changes: list[tuple[float, float]]) -> tuple[float, float, float]:
    """Mean of the changes in percent, and the widest limits of their 95 % intervals."""
    low = min(c - NORMAL_QUANTILE * e for c, e in changes)
    high = max(c + NORMAL_QUANTILE * e for c, e in changes)
    mean = float(np.mean([c for c, _ in changes]))
    return (100.0 * math.expm1(mean), 100.0 * math.expm1(low), 100.0 * math.expm1(high))


def _log_change(pair: ResonancePair, band: str, course: tuple[tuple[str, float], ...]) -> tuple[float, float]:
    """Change of the logarithm of a resonance, and its variance; nan where its values do not determine the changes.

    A value further than ``MAX_DEVIATION`` errors from the fit is left out, the furthest first: it may be another mode.
    """
    newest = max((float(t[-1]) for t in pair.time.values() if t.size), default=0.0)
    time, values, error = pair.time[band], pair.values[band], pair.error[band]
    while True:
        columns = [_change_course(time, newest, shape, since) for shape, since in course]
        design = np.column_stack([np.ones(time.size), *columns]) / error[:, None]
        if np.linalg.matrix_rank(design) < design.shape[1]:
            return float("nan"), float("nan")
        covariance = np.linalg.inv(design.T @ design)
        coefficient = covariance @ (design.T @ (values / error))
        deviation = np.abs(values / error - design @ coefficient)
        furthest = int(np.argmax(deviation))
        if deviation[furthest] <= MAX_DEVIATION:
            break
        time, values, error = (np.delete(part, furthest) for part in (time, values, error))
    factor = max(1.0 + float(coefficient[1:].sum()) / 100.0, 1e-3)
    return float(np.log(factor)), 1e-4 * float(covariance[1:, 1:].sum()) / factor**2


def _change_course(time: np.ndarray, newest: float, shape: str, since: float) -> np.ndarray:
    """Course of one change at every time, 1 at the newest."""
    if shape == "drift":
        return np.maximum(time - since, 0.0) / max(newest - since, 1e-9)
    return (time >= since).astype(float)
