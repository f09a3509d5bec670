"""Test whether a model can be the cause of the data at one sensor.

If the wheels' jumps do not point along b, the load was no impulse at the sensor and the scores mean little. Null bands
show what models unrelated to the section score on the same data.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from scipy import linalg

from turnout.passage.impulse_fit import joint_fit, onsets
from turnout.passage.scores import Scores, score
from turnout.passage.wheel_basis import WheelBasis, wheel_basis
from turnout.records import ModalModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.passage import PassageSettings


@dataclass(frozen=True)
class DirectionTest:
    """Chi-squared per wheel: ``statistic`` (n_wheel,), ``freedom``, ``p_value`` (n_wheel,), ``failed_share``.

    ``jumps`` (n_wheel, n_column) are the free jumps as column weights, ``covariance`` (n_wheel, n_column, n_column)
    theirs. ``along_share`` is the share of all jumps' power that is along b. It is 1 for impulses at any noise, while
    the test detects even the smallest error of a model at low noise.
    """

    statistic: np.ndarray
    freedom: int
    p_value: np.ndarray
    failed_share: float
    jumps: np.ndarray
    covariance: np.ndarray
    along_share: float = float("nan")


def direction_test(
    data: np.ndarray,
    times: np.ndarray,
    basis: WheelBasis,
    noise: float,
    level: float = 0.01,
    times_estimated: bool = False,
) -> DirectionTest:
    r"""Test of w_j = g_j b against a free jump for every wheel, all wheels estimated together.

    .. math:: \chi^2_j = \min_g (\hat w_j - g b)^T \Sigma_j^{-1} (\hat w_j - g b)

    is chi-squared; its degrees of freedom are the number of states less one. ``data`` must have white residuals of
    standard deviation ``noise``: raw or whitened, not band-passed. A time estimated from the same data takes one
    more degree, as long as one is left. ``times`` in samples.

    Parameters
    ----------
    data : (n_sample,) array of float
        Raw or whitened acceleration, with white residuals. [m/s²]
    times : (n_wheel,) array of float
        Times of the impacts, increasing. [samples]
    basis : WheelBasis
        Responses of the model behind the filter of ``data``.
    noise : float
        Standard deviation of the noise. [m/s²]
    level : float
        Level of the test. [-]
    times_estimated : bool
        Whether ``times`` were estimated from ``data``.

    Returns
    -------
    DirectionTest
        One value per wheel.

    Raises
    ------
    ValueError
        ``noise`` is not above 0.
    """
    if not noise > 0:
        raise ValueError(f"the noise must be above 0, got {noise}")
    fit = joint_fit(data, times, basis, free=True)
    n_wheel, p = fit.amplitudes.shape
    _, phi = onsets(times)
    covariance = np.stack([fit.covariance[i * p : (i + 1) * p, i * p : (i + 1) * p] for i in range(n_wheel)])
    covariance = covariance * noise**2
    statistic, total = np.empty(n_wheel), 0.0
    for j, along in enumerate(basis.coefficients(phi)):
        root = linalg.cholesky(covariance[j], lower=True)
        jump, axis = (linalg.solve_triangular(root, v, lower=True) for v in (fit.amplitudes[j], along))
        statistic[j] = jump @ jump - (axis @ jump) ** 2 / (axis @ axis)
        total += jump @ jump
    freedom = max(p - 2, 1) if times_estimated else p - 1
    p_value = scipy.stats.chi2.sf(statistic, freedom)
    along = 1.0 - float(statistic.sum() / total) if total > 0 else float("nan")
    return DirectionTest(
        statistic, freedom, p_value, float(np.mean(p_value < level)), fit.amplitudes, covariance, along
    )


@dataclass(frozen=True)
class NullBand:
    """95 % quantile of each score over the null models, and their number. [%]

    A further model, drawn as these are, has a higher score with a probability of 5 %. The quantile of the sample itself
    is too low for it: with 30 models 8 % are above.
    """

    fit: float
    forecast: float
    leave_one_out: float
    n: int

    @classmethod
    def of(cls, scores: list[Scores]) -> NullBand:
        """Quantiles over the finite scores; nan where there are none.

        Parameters
        ----------
        scores : list of Scores
            Scores of the null models.

        Returns
        -------
        NullBand
            [%]
        """
        table = np.array([[s.fit, s.forecast, s.leave_one_out] for s in scores], dtype=float).reshape(-1, 3)
        columns = [column[np.isfinite(column)] for column in table.T]
        quantiles = [np.quantile(c, 0.95, method="weibull") if c.size else np.nan for c in columns]
        fit, forecast, leave_one_out = (float(q) for q in quantiles)
        return cls(fit, forecast, leave_one_out, len(scores))


def random_models(n: int, order: int, low: float, high: float, rate: float, seed: int) -> tuple[ModalModel, ...]:
    """Models of ``order`` with random pole pairs in the band.

    The frequency is log-uniform between ``low`` and ``high`` [Hz]. The damping ratio is log-uniform between 0.02 and
    0.35, slightly wider than in the paper's tables.

    Parameters
    ----------
    n : int
        Number of models.
    order : int
        Number of states; at least one pair of poles is made.
    low, high : float
        Limits of the frequencies. [Hz]
    rate : float
        Sampling rate. [Hz]
    seed : int
        Seed of the random numbers.

    Returns
    -------
    tuple of ModalModel
        The same for the same seed.

    Examples
    --------
    >>> [m.order for m in random_models(2, 4, 80.0, 800.0, 20000.0, seed=1)]
    [4, 4]
    """
    rng = np.random.default_rng(seed)
    models = []
    for _ in range(n):
        pairs = max(order // 2, 1)
        omega = 2 * np.pi * np.exp(rng.uniform(np.log(low), np.log(high), pairs))
        zeta = np.exp(rng.uniform(np.log(0.02), np.log(0.35), pairs))
        pole = np.exp((-zeta + 1j * np.sqrt(1 - zeta**2)) * omega / rate)
        a = np.zeros((2 * pairs, 2 * pairs))
        for i, z in enumerate(pole):
            a[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[z.real, z.imag], [-z.imag, z.real]]
        c = rng.standard_normal(2 * pairs)
        models.append(ModalModel(a, c * np.tile([1.0, -1.0], pairs), c, rate, ()))
    return tuple(models)


def null_bases(order: int, band_filter: np.ndarray | None, rate: float, settings: PassageSettings) -> list[WheelBasis]:
    """Bases of the random models behind the same filter. They are the same for every passage.

    Parameters
    ----------
    order : int
        Number of states.
    band_filter : (n_section, 6) array of float or None
        Filter of the data, see ``apply_filter``.
    rate : float
        Sampling rate. [Hz]
    settings : PassageSettings
        Number, band and seed of the models.

    Returns
    -------
    list of WheelBasis
        One per random model.
    """
    models = random_models(settings.null_models, order, settings.band_low, settings.band_high, rate, settings.null_seed)
    return [wheel_basis(model, band_filter, rate, longest=0.1) for model in models]


def null_scores(
    data: np.ndarray, expected: np.ndarray, bases: Sequence[WheelBasis], settings: PassageSettings
) -> list[Scores]:
    """Scores of every null model on the data of one sensor.

    Parameters
    ----------
    data : (n_sample,) array of float
        Acceleration behind the filter of the bases. [m/s²]
    expected : (n_wheel,) array of float
        Expected times of the impacts, increasing. [samples]
    bases : sequence of WheelBasis
        The random models behind the filter of ``data``.
    settings : PassageSettings
        Settings of the passage analysis.

    Returns
    -------
    list of Scores
        One per model.
    """
    return [score(data, expected, basis, settings) for basis in bases]
