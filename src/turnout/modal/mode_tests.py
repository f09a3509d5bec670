"""Test the modes of a fit: a mode must be significant, be damped little enough and agree between impacts.

The significance of a mode or a drift comes from chi-squared tests of amplitudes, per impact and over all impacts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc, chdtri

from turnout.modal.least_squares import Linearisation
from turnout.modal.mixed_effects import MIN_DAMPING, MixedFit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.identify import IdentifySettings

IMPACT_SIGNIFICANCE = 0.01  # significance level of a mode in one impact


def mode_chi_squared(linearisation: Linearisation, sigma2: float) -> np.ndarray:
    r"""Squared amplitude of each mode in each impact over its covariance: chi-squared(2) if the mode is absent.

    .. math:: \chi^2 = a^T \left(\sigma^2 [(B^T B)^{-1}]_{mm}\right)^{-1} a

    Parameters
    ----------
    linearisation : Linearisation
        Fit of the modes.
    sigma2 : float
        Variance of the noise.

    Returns
    -------
    (n_decay, n_mode) array of float
        Statistic of each mode in each impact.
    """
    n_mode = linearisation.amplitude.shape[1]
    inverse = np.linalg.inv(linearisation.gram)
    cosine, sine = np.arange(n_mode), n_mode + np.arange(n_mode)
    cc, ss, cs = inverse[:, cosine, cosine], inverse[:, sine, sine], inverse[:, cosine, sine]
    a, b = linearisation.coefficient[:, cosine], linearisation.coefficient[:, sine]
    return (a**2 * ss - 2.0 * a * b * cs + b**2 * cc) / (np.maximum(cc * ss - cs**2, 1e-300) * sigma2)


def columns_chi_squared(linearisation: Linearisation, sigma2: float, columns: Sequence[int] | np.ndarray) -> float:
    """Statistic of columns of the model (a drift, a hum): chi-squared(n_decay times columns) if they are absent.

    Parameters
    ----------
    linearisation : Linearisation
        Fit of the modes.
    sigma2 : float
        Variance of the noise.
    columns : sequence of int
        Numbers of the columns of the model.

    Returns
    -------
    float
        Statistic, summed over the decays.
    """
    columns = np.asarray(columns)
    block = np.linalg.inv(linearisation.gram)[:, columns[:, None], columns]
    value = linearisation.coefficient[:, columns]
    return float(np.sum(value * np.linalg.solve(block, value[..., None])[..., 0]) / sigma2)


def common_probability(statistic: np.ndarray) -> np.ndarray:
    """Probability of the sum over impacts of chi-squared(2) values if the mode is absent.

    Parameters
    ----------
    statistic : (n_decay, n_mode) array of float
        Values of ``mode_chi_squared``.

    Returns
    -------
    (n_mode,) array of float
        Probability for each mode.

    Examples
    --------
    >>> print(common_probability(np.array([[0.0], [0.0]])))
    [1.]
    """
    return chdtrc(2 * len(statistic), statistic.sum(axis=0))


def share_of_impacts(statistic: np.ndarray) -> np.ndarray:
    """Share of impacts in which the mode alone is significant.

    Parameters
    ----------
    statistic : (n_decay, n_mode) array of float
        Values of ``mode_chi_squared``.

    Returns
    -------
    (n_mode,) array of float
        Share for each mode, 0 to 1.
    """
    return (statistic > chdtri(2, IMPACT_SIGNIFICANCE)).mean(axis=0)


# Distance of the single impacts' mean from the common mode, over the half-power half-width of the mode. One linear step
# over this distance turns the phase by 0.25 rad within a decay time: its result is no longer that of a linear model.
MAX_LINEAR_DISTANCE = 0.25
MIN_DISAGREEMENT = 4.0  # the same distance over its standard error: below, it may be chance


def disagreement(fit: MixedFit) -> np.ndarray:
    r"""Distance between the mean of the single impacts and the common mode, where it is significant.

    .. math:: d = \max\left(\frac{|\overline{\ln f_i} - \ln f|}{\zeta}, \frac{|\bar\zeta_i - \zeta|}{\zeta}\right)

    Two poles that share one resonance fit all impacts together better than one pole, but no impact determines them.
    Their estimates from single impacts then lie elsewhere than the common poles.

    Parameters
    ----------
    fit : MixedFit
        Fit of all modes.

    Returns
    -------
    (n_mode,) array of float
        In half-power half-widths; 0 where it is less than ``MIN_DISAGREEMENT`` standard errors, and for fewer than
        three impacts.
    """
    n = len(fit.theta)
    if n < 3:
        return np.zeros(len(fit.mean))
    distance = np.abs(fit.unshrunken.mean(axis=0) - fit.mean)
    error = fit.unshrunken.std(axis=0, ddof=1) / np.sqrt(n)
    significant = np.where(distance > MIN_DISAGREEMENT * error, distance, 0.0)
    return significant.max(axis=1) / np.maximum(np.abs(fit.mean[:, 1]), MIN_DAMPING)


def mode_failures(
    fit: MixedFit, settings: IdentifySettings, max_damping: float | None = None
) -> list[tuple[int, tuple[str, float, float]]]:
    """Every mode that fails a test, the weakest first.

    With ``max_damping`` only the tests for a pole to stay in a fit apply: it is present and damped less than this.

    Parameters
    ----------
    fit : MixedFit
        Fit of all modes.
    settings : IdentifySettings
        Settings of the identification.
    max_damping : float or None
        Largest damping ratio of a pole that stays; None: all tests of a mode.

    Returns
    -------
    list of (int, (str, float, float))
        Index, reason, value and limit.
    """
    n_mode = len(fit.mean)
    statistic = mode_chi_squared(fit.linearisation, fit.sigma2)
    weight = 1.0 / (np.einsum("ijj->ij", fit.covariance) + fit.spread)
    se = np.sqrt(1.0 / weight.sum(axis=0)).reshape(n_mode, 2)
    spread = np.sqrt(fit.spread).reshape(n_mode, 2)
    probability, share = common_probability(statistic), share_of_impacts(statistic)
    distance = disagreement(fit)
    failures = []
    for m in range(n_mode):
        damping = fit.mean[m, 1]
        presence_tests = (
            ("not significant", probability[m], settings.false_mode_probability, True),
            ("shows in too few impacts", share[m], settings.impact_share, False),
            ("damping too high", damping, max_damping or settings.damping_maximum, True),
            ("damping not above zero", damping, 1e-4, False),
            ("single impacts disagree with their common fit", distance[m], MAX_LINEAR_DISTANCE, True),
        )
        precision_tests = (
            ("frequency too uncertain", se[m, 0], settings.frequency_se_maximum, True),
            ("damping too uncertain", se[m, 1] / abs(damping), settings.damping_se_maximum, True),
            ("differs between impacts", spread[m, 0], settings.spread_maximum, True),
        )
        for reason, value, limit, upper in presence_tests if max_damping else presence_tests + precision_tests:
            if (value > limit) if upper else (value < limit):
                failures.append((m, (reason, float(value), limit)))
                break
    return sorted(failures, key=lambda item: statistic[:, item[0]].sum())
