r"""Whether each wheel's jump points along b: if not, the load was no impulse at the sensor and no score means much."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg, stats

from turnout.passage.basis import WheelBasis
from turnout.passage.wheels import joint_fit, onsets


@dataclass(frozen=True)
class DirectionTest:
    """Chi-squared per wheel: ``statistic`` (n_wheel,), ``freedom``, ``p_value`` (n_wheel,), ``failed_share``.

    ``jumps`` (n_wheel, n_column) are the free jumps as column weights, ``covariance`` (n_wheel, n_column, n_column)
    theirs. ``along_share`` is the part of all jumps' power that is along b: 1 for impulses, whatever the noise, while
    the test finds the smallest error of a model once the noise is low.
    """

    statistic: np.ndarray
    freedom: int
    p_value: np.ndarray
    failed_share: float
    jumps: np.ndarray
    covariance: np.ndarray
    along_share: float = float("nan")


def direction_test(data, times, basis: WheelBasis, noise: float, level: float = 0.01) -> DirectionTest:
    r"""Test of w_j = g_j b against a free jump for every wheel, all wheels estimated together.

    .. math:: \chi^2_j = \min_g (\hat w_j - g b)^T \Sigma_j^{-1} (\hat w_j - g b)

    is chi-squared with one degree of freedom less than there are states. ``data`` must have white residuals of
    standard deviation ``noise``: raw or whitened, not band-passed. A time estimated from the same data takes up
    part of one more degree, which makes the test a little lenient. ``times`` in samples.
    """
    if not noise > 0:
        raise ValueError(f"the noise must be above 0, got {noise}")
    fit = joint_fit(data, times, basis, free=True)
    n_wheel, p = fit.amplitudes.shape
    _, phi = onsets(times)
    covariance = np.stack([fit.covariance[i * p : (i + 1) * p, i * p : (i + 1) * p] for i in range(n_wheel)])
    covariance = covariance * noise**2
    statistic, whole = np.empty(n_wheel), 0.0
    for j, along in enumerate(basis.coefficients(phi)):
        root = linalg.cholesky(covariance[j], lower=True)
        jump, axis = (linalg.solve_triangular(root, v, lower=True) for v in (fit.amplitudes[j], along))
        statistic[j] = jump @ jump - (axis @ jump) ** 2 / (axis @ axis)
        whole += jump @ jump
    p_value = stats.chi2.sf(statistic, p - 1)
    along = 1.0 - float(statistic.sum() / whole) if whole > 0 else float("nan")
    return DirectionTest(statistic, p - 1, p_value, float(np.mean(p_value < level)), fit.amplitudes, covariance, along)
