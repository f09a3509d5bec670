"""One explanation of the decays of a test (modes, background and noise), and how good it is for its size."""

from dataclasses import dataclass, field, replace

import numpy as np

from turnout.identify.background import Background, needed_background
from turnout.identify.linearise import linearise
from turnout.identify.mixed import MixedFit, fit_mixed
from turnout.identify.noise import noise_filter, whiten
from turnout.identify.screening import fit_and_prune, screen

NOISE_PASSES = 3
# Two optima of as many modes differ by more: each residual sum is known to a hundredth.
SAME = 1e-4


@dataclass
class Explanation:
    """``fit`` of the modes ``kept``, beside ``background``, of the decays whitened by ``whitening``.

    ``rejected`` lists the candidates that failed a test; ``fit`` is None if all did.
    """

    fit: MixedFit | None
    kept: list
    background: Background
    whitening: np.ndarray = field(default_factory=lambda: np.ones(1))
    rejected: list = field(default_factory=list)

    @property
    def doubtful(self) -> bool:
        """Noise that is not white or a drift may be what is left of modes that were overlooked."""
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
        Of the first fit.
    settings : IdentifySettings
    most : Background, optional
        What is needed of it, beside the modes of the first fit, replaces ``background``.
    heaviest : float, optional
        Damping up to which a pole may stay in the fit although it is no mode.
    known : list of MixedFit, optional
        First fits of explanations with this ``background``; this one is added. One that is there already is not
        followed again: ``fit`` is then None.
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
    """Whether two fits of the same decays have settled in the same modes."""
    return len(fit.mean) == len(other.mean) and abs(fit.rss / other.rss - 1.0) < SAME


def _settle_noise(told, decays, rate, settings, heaviest):
    """Fit the decays whitened by the noise that the last fit left, until its order settles."""
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
    """The same explanation with its fit iterated until it settles."""
    if told.fit is None:
        return told
    white = whiten(decays, told.whitening)
    columns = told.background.columns(white.shape[1], rate)
    return replace(told, fit=fit_mixed(None, white, rate, columns, theta=told.fit.theta))


def criterion(told: Explanation, decays) -> float:
    r"""Akaike information criterion of an explanation: of two, the smaller is the likelier.

    .. math:: N \ln\frac{\sum r^2}{N} + 2 k

    with :math:`N` samples in all. :math:`k` counts modes and noise of the test, amplitudes and background of every
    decay, and its own modes as far as they are not drawn to the mean. A mode has passed a stricter test of its own,
    so the criterion need not guard against one too many.

    References
    ----------
    Akaike 1974; number of parameters of a drawn fit after Hodges and Sargent 2001.
    """
    fit, order = told.fit, len(told.whitening) - 1
    if fit is None:
        raise ValueError("an explanation without modes has no criterion")
    n_decay, n_mode = fit.theta.shape[:2]
    own = np.einsum("ijj->ij", fit.covariance)
    background = told.background.drift_degree + 1 + 2 * len(told.background.hum)
    each = n_decay * (2 * n_mode + background) + float(np.sum(fit.spread / (fit.spread + own)))
    total = n_decay * (decays.shape[1] - order)
    # Per sample, as whitening costs a few of them.
    return decays.size * np.log(fit.rss / total) + 2.0 * (2 * n_mode + order + each)
