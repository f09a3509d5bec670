"""Choose the modes that the decays of a test really hold, knowing neither their number nor their frequencies."""

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi2

from turnout.identify.background import Background, highest_drift, hum_frequencies, of_the_blow
from turnout.identify.explanation import criterion, explain, polished
from turnout.identify.hankel import hankel_rows
from turnout.identify.likely_poles import DAMPING, likely_poles
from turnout.identify.linearise import linearise
from turnout.identify.mixed import MixedFit
from turnout.identify.screening import mode_failures, reappearing, start_of
from turnout.identify.significance import mode_chi_squared
from turnout.identify.stabilise import Stabilisation, candidates, stabilisation

STARTS = (0.0, 5e-4, 1e-3)
BUILD_DRIFT = 2
MOST_STARTS = 2


@dataclass
class Selection:
    """Modes found in a test, the fit that holds them and all others that were looked at.

    ``fit`` is None if nothing was found. Per mode of it: ``presence`` over orders and starts, ``energy`` share,
    ``chi_squared`` and ``amplitude`` (n_decay, n_mode); ``residual_power`` (n_decay,) is what they leave.
    ``unfit`` maps modes that stay in the fit but cannot be named to (reason, value, limit).
    ``others`` are the modes (n_mode, 2) of the explanations that were not chosen.
    ``rejected`` lists mappings of frequency, damping, reason, value and limit; ``whitening`` and ``background``
    describe what else was modelled.
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
        """(n_decay, n_mode) bool: the mode shows in this blow by itself, at 1 %."""
        return self.chi_squared > chi2.isf(0.01, 2)


def select_modes(decays, rate, settings) -> Selection:
    """Over-ordered realisations, candidate poles, maximum likelihood, and tests that each mode must pass.

    The first explanation starts from poles that reappear over orders. If it leaves coloured noise or needs a
    drift, further ones start from :func:`~turnout.identify.likely_poles.likely_poles`; the likeliest counts.

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
    """Explanations by the likeliest poles until one leaves no doubt: without a drift, then with that of ``told``."""
    hum, drift = told.background.hum, told.background.drift_degree
    for background, most in ((Background(-1, hum), MOST_STARTS), (Background(drift, hum), 1))[: 1 + (drift >= 0)]:
        columns = background.columns(decays.shape[1], rate)
        known: list = []
        for start in likely_poles(table, decays, rate, columns, settings, most):
            # a pole that may stand for many weak modes stays in the fit, though it is not known well enough for a name
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
