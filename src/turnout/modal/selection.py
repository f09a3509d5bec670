"""Select the modes of a test from its decays without knowing their number or frequencies.

An explanation of the decays consists of modes, background and noise. Several explanations are compared by the Akaike
information criterion.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from turnout.modal.era import hankel_rows
from turnout.modal.explanation import (
    Explanation,
    akaike_criterion,
    explain,
    fit_to_convergence,
    leaves_common,
    usable_explanations,
)
from turnout.modal.least_squares import linearise
from turnout.modal.mixed_effects import MixedFit
from turnout.modal.mode_candidates import ModeSearch, filter_reappearing, start_values
from turnout.modal.mode_tests import mode_chi_squared, mode_failures
from turnout.modal.noise import (
    Background,
    hum_frequencies,
    is_locked_to_impact,
    max_drift_degree,
    noise_filter,
    whiten,
)
from turnout.modal.similar_decays import combine, group_similar
from turnout.modal.stabilization import DAMPING_RANGE, Stabilisation, candidates, likely_poles, stabilisation
from turnout.modal.systematic_error import own_estimates

if TYPE_CHECKING:
    from collections.abc import Iterator

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.systematic_error import OwnEstimates

START_TIMES = (0.0, 5e-4, 1e-3)  # s, times at which the realisations start


INITIAL_DRIFT_DEGREE = 2  # degree of the drift of the first fit


MAX_START_LISTS = 2  # lists of likely poles that are tried


@dataclass
class Selection:
    """Modes of a test, their fit, and all rejected candidates.

    ``fit`` is None if there are no modes. Per mode of it: ``presence`` over orders and starts, ``energy`` share,
    ``chi_squared`` and ``amplitude`` (n_decay, n_mode). ``residual_power`` (n_decay,) is the power of the residual.
    ``failed_tests`` maps modes that stay in the fit but belong to no band to (reason, value, limit).
    ``rival_modes`` are the modes of the explanations that were not chosen, with their own errors.
    ``bound`` (n_mode, 2) is the Cramér-Rao bound where more than these decays were used, None otherwise.
    ``rejected`` lists mappings of frequency, damping, reason, value and limit. ``whitening`` and ``background``
    describe the rest of the model.
    """

    table: Stabilisation
    rejected: list
    fit: MixedFit | None = None
    presence: np.ndarray = field(default_factory=lambda: np.empty(0))
    energy: np.ndarray = field(default_factory=lambda: np.empty(0))
    chi_squared: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    amplitude: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    residual_power: np.ndarray = field(default_factory=lambda: np.empty(0))
    whitening: np.ndarray = field(default_factory=lambda: np.ones(1))
    background: Background = field(default_factory=Background)
    failed_tests: dict = field(default_factory=dict)
    rival_modes: list[OwnEstimates] = field(default_factory=list)
    bound: np.ndarray | None = None

    @property
    def mode_fit(self) -> MixedFit:
        """The fit of a selection that has modes; ValueError for one that has none."""
        if self.fit is None:
            raise ValueError("a selection without modes has no fit")
        return self.fit

    @property
    def is_visible(self) -> np.ndarray:
        """(n_decay, n_mode) bool: the mode is significant in this impact alone, at 1 %, and determined by it."""
        visible = self.chi_squared > chdtri(2, 0.01)
        return visible if self.fit is None else visible & ~self.fit.is_limited


def select_modes(decays: np.ndarray, rate: float, settings: IdentifySettings) -> Selection:
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
        Limits of the tests, bands and orders.

    Returns
    -------
    Selection
        Its ``fit`` is None if there are no modes.
    """
    n = decays.shape[1]
    rows = hankel_rows(n)
    order = min(settings.order_maximum, rows // 2)
    table = stabilisation(decays, rate, rows, order, tuple(round(t * rate) for t in START_TIMES))
    poles = candidates(table, settings.pole_tolerance, settings.damping_maximum)
    accepted, rejected = filter_reappearing(poles, rate, settings)
    hum = hum_frequencies(table, n, rate, settings)
    hum = tuple(f for f in hum if not is_locked_to_impact(f, start_values(accepted), decays, rate))
    largest_background = Background(max_drift_degree(n, rate, settings), hum)
    explanation = explain(
        accepted,
        decays,
        rate,
        Background(min(INITIAL_DRIFT_DEGREE, largest_background.drift_degree), hum),
        settings,
        largest_background,
    )
    explanation, rival_modes = _choose(explanation, table, decays, rate, settings)
    explanation = fit_to_convergence(explanation, decays, rate)
    result = Selection(table, rejected + explanation.rejected, rival_modes=rival_modes)
    if explanation.fit is not None:
        fit = result.fit = explanation.fit
        result.background, result.whitening = explanation.background, explanation.whitening
        result.failed_tests = dict(mode_failures(fit, settings))
        result.presence = np.array([c.presence for c in explanation.candidates])
        result.chi_squared = mode_chi_squared(fit.linearisation, fit.sigma2)
        raw = linearise(fit.theta, decays, rate, explanation.background.columns(n, rate))
        result.amplitude, result.residual_power = raw.amplitude, raw.rss
        result.energy = energy_shares(raw.amplitude, fit.theta)
    return result


def _choose(
    first: Explanation, table: Stabilisation, decays: np.ndarray, rate: float, settings: IdentifySettings
) -> tuple[Explanation, list[OwnEstimates]]:
    """The likeliest explanation of ``decays``, and the modes of the others.

    Others than the first are searched for in the combined decays of impacts with similar poles.
    """
    if first.fit is None or not first.is_doubtful:
        return first, []
    # The phase of hum is another one in each impact, so combined decays would hide it.
    group = np.arange(len(decays)) if first.background.hum else group_similar(first.fit)
    is_combined = group.max() + 1 < len(decays)
    combined, of_combined = decays, first
    if is_combined:
        combined = combine(decays, group)
        of_combined = _refit(first, combined, _group_means(first.fit.theta, group), rate, settings)
    explanations = [of_combined, *_alternative_explanations(of_combined, table, combined, rate, settings)]
    usable = usable_explanations([e for e in explanations if e.fit is not None], settings)
    chosen = min(usable, key=lambda e: akaike_criterion(e, combined), default=first)
    rival_modes = [own_estimates(e.fit, rate) for e in usable if e is not chosen and e.fit is not None]
    if chosen is of_combined:
        return first, rival_modes
    if is_combined and chosen.fit is not None:
        chosen = _refit(chosen, decays, chosen.fit.theta[group], rate, settings, DAMPING_RANGE[1])
    return chosen, rival_modes


def _group_means(theta: np.ndarray, group: np.ndarray) -> np.ndarray:
    """(n_group, n_mode, 2) means of the modes (n_decay, n_mode, 2) of the decays in each group."""
    return np.array([theta[group == number].mean(axis=0) for number in range(group.max() + 1)])


def _refit(
    explanation: Explanation,
    decays: np.ndarray,
    theta: np.ndarray,
    rate: float,
    settings: IdentifySettings,
    max_damping: float | None = None,
) -> Explanation:
    """The same explanation fitted to other decays from modes ``theta``, its noise and new tests of its modes.

    The noise is that of the residual after a first fit: at ``theta`` it would contain the scatter of the poles.
    """
    columns = explanation.background.columns(decays.shape[1], rate)
    result = replace(explanation, rejected=list(explanation.rejected))
    for _ in range(2):
        white = whiten(decays, result.whitening)
        white_columns = explanation.background.columns(white.shape[1], rate)
        search = ModeSearch(white, rate, white_columns, settings, result.rejected)
        result.fit, result.candidates = search.fit_and_prune(
            result.candidates, theta, max_damping, {id(candidate) for candidate in explanation.candidates}
        )
        if result.fit is None:
            break
        theta = result.fit.theta
        previous = result.whitening
        result.whitening = noise_filter(linearise(theta, decays, rate, columns).residual, settings.noise_order_maximum)
        if len(result.whitening) == len(previous) == 1:
            break
    else:
        result.whitening = previous
    result.leaves_common = leaves_common(result.fit, settings)
    return result


def _alternative_explanations(
    explanation: Explanation, table: Stabilisation, decays: np.ndarray, rate: float, settings: IdentifySettings
) -> Iterator[Explanation]:
    """Explanations from the likeliest poles until one is not doubtful: without a drift, then with the one found."""
    hum, drift = explanation.background.hum, explanation.background.drift_degree
    for background, max_lists in ((Background(-1, hum), MAX_START_LISTS), (Background(drift, hum), 1))[
        : 1 + (drift >= 0)
    ]:
        columns = background.columns(decays.shape[1], rate)
        known_fits: list = []
        for start in likely_poles(table, decays, rate, columns, settings, max_lists):
            # a pole that stands for many weak modes stays in the fit, even if it is too uncertain to be a mode
            alternative = explain(
                start, decays, rate, background, settings, max_damping=DAMPING_RANGE[1], known_fits=known_fits
            )
            if alternative.fit is not None:
                yield alternative
                if not alternative.is_doubtful:
                    return


def energy_shares(amplitude: np.ndarray, theta: np.ndarray) -> np.ndarray:
    r"""Share of each mode in the sum of their energies, :math:`\sum_i |a_{im}|^2 / (4 \zeta \omega)`.

    Parameters
    ----------
    amplitude : (n_decay, n_mode) array of complex
        Amplitudes at the start of the decays. [m/s²]
    theta : (n_decay, n_mode, 2) array of float
        Ln f [Hz] and zeta of each decay.

    Returns
    -------
    (n_mode,) array of float
        Share of each mode; their sum is 1.

    Examples
    --------
    >>> theta = np.array([[[np.log(100.0), 0.1], [np.log(400.0), 0.1]]])
    >>> energy_shares(np.array([[1.0 + 0j, 1.0]]), theta)
    array([0.8, 0.2])
    """
    energy = np.sum(np.abs(amplitude) ** 2 / (theta[..., 1] * np.exp(theta[..., 0])), axis=0)
    return energy / energy.sum()
