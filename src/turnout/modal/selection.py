"""Select the modes of a test from its decays without knowing their number or frequencies.

An explanation of the decays consists of modes, background and noise. Several explanations are compared by the Akaike
information criterion.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2

from turnout.modal.era import hankel_rows
from turnout.modal.least_squares import linearise
from turnout.modal.mixed_effects import MixedFit, fit_mixed
from turnout.modal.mode_tests import fit_and_prune, mode_chi_squared, mode_failures, reappearing, screen, start_of
from turnout.modal.noise import (
    Background,
    highest_drift,
    hum_frequencies,
    needed_background,
    noise_filter,
    of_the_blow,
    whiten,
)
from turnout.modal.stabilization import DAMPING, Stabilisation, candidates, likely_poles, stabilisation

NOISE_PASSES = 3  # fits with a new whitening filter
# Relative difference of residual sums up to which two fits are the same. Two distinct optima differ by more.
SAME = 1e-4


@dataclass
class Explanation:
    """``fit`` of the modes ``candidates`` and the ``background`` to the decays whitened by ``whitening``.

    ``rejected`` lists the candidates that failed a test; ``fit`` is None if all failed.
    """

    fit: MixedFit | None
    kept: list
    background: Background
    whitening: np.ndarray = field(default_factory=lambda: np.ones(1))
    rejected: list = field(default_factory=list)

    @property
    def doubtful(self) -> bool:
        """Whether there is coloured noise or a drift: it may be the remainder of overlooked modes."""
        return len(self.whitening) > 1 or self.background.drift_degree >= 0


def explain(start, decays, rate, background, settings, most=None, heaviest=None, known=None) -> Explanation:
    """Maximum likelihood from candidates ``start``, pruned until each mode passes its tests.

    Parameters
    ----------
    start : list of Candidate
    decays : (n_decay, n) array of float
    rate : float
        [Hz]
    background : Background
        Background of the first fit.
    settings : IdentifySettings
    largest_background : Background, optional
        The part of it that is significant beside the modes of the first fit replaces ``background``.
    max_damping : float, optional
        Damping up to which a pole may stay in the fit although it is no mode.
    known_fits : list of MixedFit, optional
        First fits of explanations with this ``background``; this one is added. If it is there already it is not
        continued: ``fit`` is then None.
    """
    told = Explanation(None, [], background)
    columns = background.columns(decays.shape[1], rate)
    kept = screen(start, decays, rate, columns, settings, told.rejected)
    told.fit, told.kept = fit_and_prune(kept, decays, rate, columns, settings, told.rejected, heaviest=heaviest)
    if told.fit is not None and known is not None:
        if any(_same(told.fit, other) for other in known):
            return Explanation(None, [], background)
        known.append(told.fit)
    if told.fit is not None:
        if most is not None:
            told.background = needed_background(told.fit.theta, decays, rate, most)
        _settle_noise(told, decays, rate, settings, heaviest)
    return told


def _same(fit, other):
    """Whether two fits of the same decays have converged to the same modes."""
    return len(fit.mean) == len(other.mean) and abs(fit.rss / other.rss - 1.0) < SAME


def _settle_noise(told, decays, rate, settings, heaviest):
    """Fit the decays whitened by the residual noise of the last fit, until the order of the noise is constant."""
    columns = told.background.columns(decays.shape[1], rate)
    needed: set = set()
    for _ in range(NOISE_PASSES):
        residual = linearise(told.fit.theta, decays, rate, columns).residual
        before, told.whitening = told.whitening, noise_filter(residual, settings.noise_order_maximum)
        white = whiten(decays, told.whitening)
        short = told.background.columns(white.shape[1], rate)
        told.fit, told.kept = fit_and_prune(
            told.kept, white, rate, short, settings, told.rejected, told.fit, heaviest, needed
        )
        if told.fit is None or len(told.whitening) == 1 or len(told.whitening) == len(before):
            break


def polished(told: Explanation, decays, rate) -> Explanation:
    """The same explanation with its fit iterated to convergence."""
    if told.fit is None:
        return told
    white = whiten(decays, told.whitening)
    columns = told.background.columns(white.shape[1], rate)
    return replace(told, fit=fit_mixed(None, white, rate, columns, theta=told.fit.theta))


def criterion(told: Explanation, decays) -> float:
    r"""Akaike information criterion of an explanation: the smaller one is the likelier.

    .. math:: N \ln\frac{\sum r^2}{N} + 2 k

    with :math:`N` samples in all. :math:`k` counts the modes and noise of the test, and the amplitudes and background
    of every decay. The modes of single decays count as far as they are not shrunken to the mean. Each mode has passed a
    stricter test, so the criterion need not prevent a mode too many.

    References
    ----------
    Akaike 1974; number of parameters of a shrunken fit after Hodges and Sargent 2001.
    """
    fit, order = told.fit, len(told.whitening) - 1
    if fit is None:
        raise ValueError("an explanation without modes has no criterion")
    n_decay, n_mode = fit.theta.shape[:2]
    own = np.einsum("ijj->ij", fit.covariance)
    background = told.background.drift_degree + 1 + 2 * len(told.background.hum)
    each = n_decay * (2 * n_mode + background) + float(np.sum(fit.spread / (fit.spread + own)))
    total = n_decay * (decays.shape[1] - order)
    # Per sample, as whitening removes a few of them.
    return decays.size * np.log(fit.rss / total) + 2.0 * (2 * n_mode + order + each)


STARTS = (0.0, 5e-4, 1e-3)  # s, times at which the realisations start
BUILD_DRIFT = 2  # degree of the drift of the first fit
MOST_STARTS = 2  # lists of likely poles that are tried


@dataclass
class Selection:
    """Modes of a test, their fit, and all rejected candidates.

    ``fit`` is None if there are no modes. Per mode of it: ``presence`` over orders and starts, ``energy`` share,
    ``chi_squared`` and ``amplitude`` (n_decay, n_mode). ``residual_power`` (n_decay,) is the power of the residual.
    ``failed_tests`` maps modes that stay in the fit but belong to no band to (reason, value, limit).
    ``rival_modes`` are the modes (n_mode, 2) of the explanations that were not chosen.
    ``rejected`` lists mappings of frequency, damping, reason, value and limit. ``whitening`` and ``background``
    describe the rest of the model.
    """

    table: Stabilisation
    rejected: list
    fit: MixedFit | None = None
    presence: np.ndarray = field(default_factory=lambda: np.empty(0))
    energy: np.ndarray = field(default_factory=lambda: np.empty(0))
    chi_squared: np.ndarray | None = None
    amplitude: np.ndarray | None = None
    residual_power: np.ndarray | None = None
    whitening: np.ndarray = field(default_factory=lambda: np.ones(1))
    background: Background = field(default_factory=Background)
    unfit: dict = field(default_factory=dict)
    others: list = field(default_factory=list)

    @property
    def shows(self) -> np.ndarray:
        """(n_decay, n_mode) bool: the mode is significant in this impact alone, at 1 %."""
        return self.chi_squared > chi2.isf(0.01, 2)


def select_modes(decays, rate, settings) -> Selection:
    """Select modes: over-ordered realisations, candidate poles, maximum likelihood, and tests of each mode.

    The first explanation starts from poles that recur over the orders. If it leaves coloured noise or needs a drift,
    further ones start from :func:`~turnout.modal.stabilization.likely_poles`. The likeliest one is chosen.

    Parameters
    ----------
    decays : (n_decay, n) array of float
        Free decays, unfiltered.
    rate : float
        [Hz]
    settings : IdentifySettings
    """
    n = decays.shape[1]
    rows = hankel_rows(n)
    order = min(settings.order_maximum, rows // 2)
    table = stabilisation(decays, rate, rows, order, tuple(round(t * rate) for t in STARTS))
    found = candidates(table, settings.pole_tolerance, settings.damping_maximum)
    kept, rejected = reappearing(found, rate, settings)
    hum = hum_frequencies(table, n, rate, settings)
    hum = tuple(f for f in hum if not of_the_blow(f, start_of(kept), decays, rate))
    most = Background(highest_drift(n, rate, settings), hum)
    told = explain(kept, decays, rate, Background(min(BUILD_DRIFT, most.drift_degree), hum), settings, most)
    told_all = [told]
    if told.fit is not None and told.doubtful:
        told_all += _others(told, table, decays, rate, settings)
        told = min(told_all, key=lambda e: criterion(e, decays))
    others = [e.fit.mean for e in told_all if e is not told and e.fit is not None]
    told = polished(told, decays, rate)
    result = Selection(table, rejected + told.rejected, others=others)
    if told.fit is not None:
        fit = result.fit = told.fit
        result.background, result.whitening = told.background, told.whitening
        result.unfit = dict(mode_failures(fit, settings))
        result.presence = np.array([c.presence for c in told.kept])
        result.chi_squared = mode_chi_squared(fit.at, fit.sigma2)
        raw = linearise(fit.theta, decays, rate, told.background.columns(n, rate))
        result.amplitude, result.residual_power = raw.amplitude, raw.rss
        result.energy = energy_shares(raw.amplitude, fit.theta)
    return result


def _others(told, table, decays, rate, settings):
    """Explanations from the likeliest poles until one is not doubtful: without a drift, then with the one found."""
    hum, drift = told.background.hum, told.background.drift_degree
    for background, most in ((Background(-1, hum), MOST_STARTS), (Background(drift, hum), 1))[: 1 + (drift >= 0)]:
        columns = background.columns(decays.shape[1], rate)
        known: list = []
        for start in likely_poles(table, decays, rate, columns, settings, most):
            # a pole that stands for many weak modes stays in the fit, even if it is too uncertain to be a mode
            other = explain(start, decays, rate, background, settings, heaviest=DAMPING[1], known=known)
            if other.fit is not None:
                yield other
                if not other.doubtful:
                    return


def energy_shares(amplitude, theta) -> np.ndarray:
    r"""Share of each mode in the sum of their energies, :math:`\sum_i |a_{im}|^2 / (4 \zeta \omega)`, (n_mode,).

    ``amplitude`` (n_decay, n_mode) complex; ``theta`` (n_decay, n_mode, 2) holds ln f and damping.

    >>> theta = np.array([[[np.log(100.0), 0.1], [np.log(400.0), 0.1]]])
    >>> energy_shares(np.array([[1.0 + 0j, 1.0]]), theta)
    array([0.8, 0.2])
    """
    energy = np.sum(np.abs(amplitude) ** 2 / (theta[..., 1] * np.exp(theta[..., 0])), axis=0)
    return energy / energy.sum()
