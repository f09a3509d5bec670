"""One explanation of the decays of all impacts by a set of poles: its fit, its noise and its criterion."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.modal.least_squares import linearise
from turnout.modal.mixed_effects import MixedFit, fit_mixed
from turnout.modal.mode_candidates import ModeSearch
from turnout.modal.mode_tests import mode_chi_squared, mode_failures
from turnout.modal.noise import (
    Background,
    noise_filter,
    significant_background,
    whiten,
)
from turnout.modal.systematic_error import common_residual

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.mode_candidates import Candidate

MAX_NOISE_PASSES = 3  # fits with a new whitening filter


# Relative difference of residual sums up to which two fits are the same. Two distinct optima differ by more.
RSS_TOLERANCE = 1e-4


@dataclass
class Explanation:
    """``fit`` of the modes ``candidates`` and the ``background`` to the decays whitened by ``whitening``.

    ``rejected`` lists the candidates that failed a test; ``fit`` is None if all failed. ``leaves_common`` says whether
    the residuals have a part in common, which no noise of single impacts has.
    """

    fit: MixedFit | None
    candidates: list
    background: Background
    whitening: np.ndarray = field(default_factory=lambda: np.ones(1))
    rejected: list = field(default_factory=list)
    leaves_common: bool = False

    @property
    def is_doubtful(self) -> bool:
        """Whether there is coloured noise, a drift or a common residual: they may be the rest of overlooked modes."""
        return len(self.whitening) > 1 or self.background.drift_degree >= 0 or self.leaves_common


def explain(
    start: list[Candidate],
    decays: np.ndarray,
    rate: float,
    background: Background,
    settings: IdentifySettings,
    largest_background: Background | None = None,
    max_damping: float | None = None,
    known_fits: list[MixedFit] | None = None,
) -> Explanation:
    """Maximum likelihood from candidates ``start``, pruned until each mode passes its tests.

    Parameters
    ----------
    start : list of Candidate
        Candidate poles.
    decays : (n_decay, n) array of float
        Free decays, unfiltered. [m/s²]
    rate : float
        [Hz]
    background : Background
        Background of the first fit.
    settings : IdentifySettings
        Limits of the tests.
    largest_background : Background, optional
        The part of it that is significant beside the modes of the first fit replaces ``background``.
    max_damping : float, optional
        Damping up to which a pole may stay in the fit although it is no mode.
    known_fits : list of MixedFit, optional
        First fits of explanations with this ``background``; this one is added. If it is there already it is not
        continued: ``fit`` is then None.

    Returns
    -------
    Explanation
        Its ``fit`` is None if all candidates failed.
    """
    explanation = Explanation(None, [], background)
    columns = background.columns(decays.shape[1], rate)
    search = ModeSearch(decays, rate, columns, settings, explanation.rejected)
    screened = search.screen(start)
    explanation.fit, explanation.candidates = search.fit_and_prune(screened, max_damping=max_damping)
    if explanation.fit is not None and known_fits is not None:
        if any(_is_same_fit(explanation.fit, known_fit) for known_fit in known_fits):
            return Explanation(None, [], background)
        known_fits.append(explanation.fit)
    if explanation.fit is not None:
        if largest_background is not None:
            explanation.background = significant_background(explanation.fit.theta, decays, rate, largest_background)
        _refine_noise(explanation, decays, rate, settings, max_damping)
        explanation.leaves_common = leaves_common(explanation.fit, settings)
    return explanation


def leaves_common(fit: MixedFit | None, settings: IdentifySettings) -> bool:
    """Whether the part that the residuals of all impacts have in common is coloured.

    It is their combination with the weights of the signal, as large as the sum of what the modes leave of each impact,
    with the noise of one. So a rest shows that is too small to colour the noise of single impacts.

    Parameters
    ----------
    fit : MixedFit or None
        Fit of whitened decays; None has no residual.
    settings : IdentifySettings
        Settings of the identification.

    Returns
    -------
    bool
    """
    if fit is None:
        return False
    return len(noise_filter(common_residual(fit)[None], settings.noise_order_maximum)) > 1


def _is_same_fit(fit: MixedFit, reference: MixedFit) -> bool:
    """Whether two fits of the same decays have converged to the same modes."""
    return len(fit.mean) == len(reference.mean) and abs(fit.rss / reference.rss - 1.0) < RSS_TOLERANCE


def _refine_noise(
    explanation: Explanation, decays: np.ndarray, rate: float, settings: IdentifySettings, max_damping: float | None
) -> None:
    """Fit the decays whitened by the residual noise of the last fit, until the order of the noise is constant."""
    columns = explanation.background.columns(decays.shape[1], rate)
    indispensable: set = set()
    for _ in range(MAX_NOISE_PASSES):
        if explanation.fit is None:
            break
        residual = linearise(explanation.fit.theta, decays, rate, columns).residual
        previous, explanation.whitening = explanation.whitening, noise_filter(residual, settings.noise_order_maximum)
        white = whiten(decays, explanation.whitening)
        white_columns = explanation.background.columns(white.shape[1], rate)
        search = ModeSearch(white, rate, white_columns, settings, explanation.rejected)
        explanation.fit, explanation.candidates = search.fit_and_prune(
            explanation.candidates, explanation.fit.theta, max_damping, indispensable
        )
        if len(explanation.whitening) == 1 or len(explanation.whitening) == len(previous):
            break


def fit_to_convergence(explanation: Explanation, decays: np.ndarray, rate: float) -> Explanation:
    """The same explanation with its fit iterated to convergence.

    Parameters
    ----------
    explanation : Explanation
        An explanation of ``decays``.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    Explanation
        A copy; the same one where there is no fit.
    """
    if explanation.fit is None:
        return explanation
    white = whiten(decays, explanation.whitening)
    columns = explanation.background.columns(white.shape[1], rate)
    return replace(explanation, fit=fit_mixed(None, white, rate, columns, theta=explanation.fit.theta))


def akaike_criterion(explanation: Explanation, decays: np.ndarray) -> float:
    r"""Akaike information criterion of an explanation: the smaller one is the likelier.

    .. math:: N \ln\frac{\sum r^2}{N} + 2 k

    with :math:`N` samples in all. :math:`k` counts the modes and noise of the test, and the amplitudes and background
    of every decay. The modes of single decays count as far as they are not shrunken to the mean. Each mode has passed a
    stricter test, so the criterion need not prevent a mode too many.

    Parameters
    ----------
    explanation : Explanation
        An explanation of ``decays``.
    decays : (n_decay, n) array of float
        Free decays. [m/s²]

    Returns
    -------
    float
        The criterion; only differences for the same decays have a meaning.

    Raises
    ------
    ValueError
        For an explanation without a fit.

    References
    ----------
    Akaike 1974; number of parameters of a shrunken fit after Hodges and Sargent 2001.
    """
    fit, order = explanation.fit, len(explanation.whitening) - 1
    if fit is None:
        raise ValueError("an explanation without modes has no criterion")
    n_decay, n_mode = fit.theta.shape[:2]
    variance = np.einsum("ijj->ij", fit.covariance)
    background = explanation.background.drift_degree + 1 + 2 * len(explanation.background.hum)
    per_decay = n_decay * (2 * n_mode + background) + float(np.sum(fit.spread / (fit.spread + variance)))
    total = n_decay * (decays.shape[1] - order)
    # Per sample, as whitening removes a few of them.
    return decays.size * np.log(fit.rss / total) + 2.0 * (2 * n_mode + order + per_decay)


SPLIT_SHARE = 0.25  # of the statistic of a resonance is left to each of two equal poles that share it


def usable_explanations(explanations: Sequence[Explanation], settings: IdentifySettings) -> list[Explanation]:
    r"""The explanations among which the Akaike criterion decides; the others are no rivals of the chosen one.

    One that leaves white noise is complete, and where there are such explanations only they are used. Where all leave
    coloured noise or a drift, none is complete, and the criterion may prefer a pole too many that splits the strongest
    resonance. Of two equal parts each has half of its amplitude, and so at most a quarter of the statistic

    .. math:: \max_m \sum_i \chi^2_{im}

    over the modes that pass all tests, with :math:`\chi^2` from ``mode_chi_squared``. An explanation below
    ``SPLIT_SHARE`` of the largest one is not used.

    Parameters
    ----------
    explanations : sequence of Explanation
        Explanations of the same decays, each with a fit.
    settings : IdentifySettings
        Limits of the tests.

    Returns
    -------
    list of Explanation
        At least one of them; empty if there are none.
    """
    complete = [e for e in explanations if not e.is_doubtful]
    if complete:
        return complete
    determination = [_determination(e, settings) for e in explanations]
    least = SPLIT_SHARE * max(determination, default=0.0)
    return [e for e, value in zip(explanations, determination) if value >= least]


def _determination(explanation: Explanation, settings: IdentifySettings) -> float:
    """Statistic of the best determined mode that passes all tests; 0 where none does."""
    fit = explanation.fit
    if fit is None:
        return 0.0
    failed = dict(mode_failures(fit, settings))
    statistic = mode_chi_squared(fit.linearisation, fit.sigma2).sum(axis=0)
    return float(max((value for m, value in enumerate(statistic) if m not in failed), default=0.0))
