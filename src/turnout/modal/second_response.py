"""Use a second accelerometer: the same modes in each impact, with amplitudes, noise and background of their own."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.least_squares import linearise
from turnout.modal.mixed_effects import degrees_of_freedom, fit_mixed
from turnout.modal.noise import noise_filter, whiten
from turnout.modal.summary import shared_bound

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.selection import Selection


def second_records(second: Sequence[np.ndarray], index: Sequence[int] | np.ndarray, n: int) -> np.ndarray | None:
    """The decays of the second response of the impacts in the fit, cut to the length of the first one.

    Parameters
    ----------
    second : sequence of (m,) arrays of float
        Decay of the second response of each impact. [m/s²]
    index : (n_impact,) array of int
        Numbers of the impacts in the fit.
    n : int
        Samples of the decays of the first response.

    Returns
    -------
    (n_impact, n) array of float or None
        None where one of them is too short, constant or not finite: the impacts are then identified from one response.
    """
    decays = [np.asarray(second[i], dtype=float)[:n] for i in index]
    if any(len(d) < n or not np.all(np.isfinite(d)) or np.ptp(d) == 0.0 for d in decays):
        return None
    return np.array(decays)


def with_second_response(
    selection: Selection, records: np.ndarray, second: np.ndarray, rate: float, settings: IdentifySettings
) -> Selection:
    r"""The modes of each impact from both responses, started at those of the first one.

    .. math:: y_{ri} = \mathrm{Re} \sum_m \alpha_{rim} z_{im}^k + \text{background} + \text{noise}_r, \quad r = 1, 2

    The poles of an impact are the same in both responses, so their scores and information add. Each response is
    whitened by its own noise and divided by its standard deviation.

    Parameters
    ----------
    selection : Selection
        Modes of the test from its first response, with a fit.
    records, second : (n_impact, n) arrays of float
        Decays of both responses. [m/s²]
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Settings of the identification.

    Returns
    -------
    Selection
        A copy with the modes, their scatter and the Cramér-Rao bound of both responses. The tests and the amplitudes
        are those of the first one.
    """
    fit = selection.mode_fit
    columns = selection.background.columns(second.shape[1], rate)
    whitening = noise_filter(linearise(fit.theta, second, rate, columns).residual, settings.noise_order_maximum)
    white = [whiten(records, selection.whitening), whiten(second, whitening)]
    n = min(w.shape[1] for w in white)
    columns = selection.background.columns(n, rate)
    pair = np.stack([_with_unit_noise(w[:, :n], fit.theta, rate, columns) for w in white], axis=1)
    both = fit_mixed(None, pair.reshape(-1, n), rate, columns, theta=fit.theta, iterations=24)
    joint = replace(
        fit, mean=both.mean, theta=both.theta, unshrunken=both.unshrunken, spread=both.spread,
        covariance=both.covariance, is_limited=both.is_limited, converged=both.converged,
    )  # fmt: skip
    return replace(selection, fit=joint, bound=shared_bound(both.linearisation, both.sigma2))


def _with_unit_noise(white: np.ndarray, theta: np.ndarray, rate: float, columns: np.ndarray) -> np.ndarray:
    rss = linearise(theta, white, rate, columns).rss.sum()
    return white / np.sqrt(rss / degrees_of_freedom(white, theta.shape[1], len(columns)))
