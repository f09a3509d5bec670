"""Identify all resonances of a test together from its unfiltered decays, and build the modal model.

The steps: cut the decays to one length, select the modes, reject outlier impacts, assign modes to bands, average over
the impacts. The model also holds the error of the choice between explanations, the stabilisation table and the noise.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.modal.bands import accepted_modes, choose_bands, fit_receptance
from turnout.modal.noise import whiten
from turnout.modal.second_response import second_records, with_second_response
from turnout.modal.selection import Selection, select_modes
from turnout.modal.state_space import assemble, no_decays, no_model
from turnout.modal.summary import ImpactEstimates, cramer_rao_bound
from turnout.modal.systematic_error import own_estimates, systematic_error
from turnout.modal.unresolved_pole import unresolved_pole_error
from turnout.records import ModalModel, Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.bands import BandChoice
    from turnout.records import FittedReceptance, Mode, Receptance


def stabilisation_rows(selection: Selection, tolerance: float) -> tuple[dict, ...]:
    """Poles of all orders from the first sample on; "stable" where they belong to a mode of the fit.

    Parameters
    ----------
    selection : Selection
        Modes of the test and its stabilisation table.
    tolerance : float
        Relative distance in frequency, and distance in damping, up to which a pole belongs to a mode.

    Returns
    -------
    tuple of dict
        ``order``, ``frequency`` [Hz], ``damping``, ``emac``, ``energy`` and ``status`` of each pole.
    """
    table = selection.table
    mean = selection.mode_fit.mean if selection.fit is not None else np.empty((0, 2))
    rows = []
    for i in np.flatnonzero((table.start == 0) & (table.damping > 0.0)):
        near = np.abs(table.frequency[i] / np.exp(mean[:, 0]) - 1.0) < tolerance
        near &= np.abs(table.damping[i] - mean[:, 1]) < tolerance
        rows.append(
            {
                "order": int(table.order[i]),
                "frequency": float(table.frequency[i]),
                "damping": float(table.damping[i]),
                "emac": float(table.emac[i]),
                "energy": float(table.energy[i]),
                "status": "stable" if near.any() else "unstable",
            }
        )
    return tuple(rows)


def fit_diagnostics(
    selection: Selection, index: Sequence[int] | np.ndarray, rejected: Sequence[tuple[int, Rejection]]
) -> dict:
    """Diagnostics of the fit.

    Parameters
    ----------
    selection : Selection
        Modes of the test and their fit.
    index : (n_impact,) array of int
        Numbers of the impacts in the fit.
    rejected : sequence of (int, Rejection)
        Impacts that are not in it.

    Returns
    -------
    dict
        Entries of ``ModalModel.diagnostics``; only the impacts where there is no fit.
    """
    diagnostics = {"impacts": tuple(int(i) for i in index), "rejected_impacts": tuple(rejected)}
    fit = selection.fit
    if fit is None:
        return diagnostics
    absent = np.argwhere(~selection.is_visible)
    return diagnostics | {
        "noise": float(np.sqrt(fit.sigma2)),
        "noise_order": len(selection.whitening) - 1,
        "drift_degree": selection.background.drift_degree,
        "hum": selection.background.hum,
        "modes_in_fit": tuple(float(f) for f in np.exp(fit.mean[:, 0])),
        "damping_in_fit": tuple(float(zeta) for zeta in fit.mean[:, 1]),
        "converged": fit.converged,
        "explanations": 1 + len(selection.rival_modes),
        "impacts_without_mode": tuple((int(index[i]), float(np.exp(fit.mean[m, 0]))) for i, m in absent),
    }


MAX_POWER_RATIO = 9.0  # residual power of an impact over that of the median impact
MAX_OUTLIER_SHARE = 1.0 / 3.0  # share of the impacts that may be outliers; beyond it the model is wrong, not they


def outlier_impacts(residual_power: np.ndarray) -> list[tuple[int, Rejection]]:
    """Impacts whose residual is three times (in power nine) that of the median impact.

    The power of white noise over some hundred samples is known to ten per cent, so such a ratio is not due to chance.
    Empty where more than a third would be rejected: then the model is wrong.

    Parameters
    ----------
    residual_power : (n_impact,) array of float
        Sum of squared residuals of each impact.

    Returns
    -------
    list of (int, Rejection)
        Row of each outlier, and its rejection.

    Examples
    --------
    >>> [row for row, _ in outlier_impacts(np.array([1.0, 1.1, 20.0, 0.9]))]
    [2]
    """
    median = float(np.median(residual_power))
    outliers = np.flatnonzero(residual_power > MAX_POWER_RATIO * median)
    if not 0 < len(outliers) <= MAX_OUTLIER_SHARE * len(residual_power):
        return []
    detail = "power of what the modes of the test leave of this impact, over the median of all"
    return [
        (int(i), Rejection("odd_one_out", float(residual_power[i] / median), MAX_POWER_RATIO, detail)) for i in outliers
    ]


def common_length(
    decays: Sequence[np.ndarray], rate: float, settings: IdentifySettings
) -> tuple[np.ndarray, np.ndarray, list[tuple[int, Rejection]]]:
    """Cut the usable decays to one length, and list those that cannot be used.

    Parameters
    ----------
    decays : sequence of (n,) arrays of float
        Decays of any length. [m/s²]
    rate : float
        [Hz]
    settings : IdentifySettings
        ``duration`` is the target length [s], ``shortest_decay`` the shortest that is accepted [s].

    Returns
    -------
    usable : (n_usable, n) array of float
    index : (n_usable,) array of int
        Index of each in ``decays``.
    rejected : list of (index, Rejection)
    """
    target_length, min_length = round(settings.duration * rate), round(settings.shortest_decay * rate)
    usable, rejected = [], []
    for i, decay in enumerate(decays):
        decay = np.asarray(decay, dtype=float)
        if len(decay) < min_length:
            rejected.append((i, Rejection("late", len(decay) / rate, settings.shortest_decay, "decay too short [s]")))
        elif not np.all(np.isfinite(decay[:target_length])):
            first_bad = int(np.argmin(np.isfinite(decay)))
            rejected.append(
                (i, Rejection("not_finite", first_bad, None, "first sample of the decay that is not finite"))
            )
        elif np.ptp(decay[:target_length]) == 0.0:
            rejected.append((i, Rejection("dead_channel", 0.0, 0.0, "the decay is constant")))
        else:
            usable.append((i, decay))
    if not usable:
        return np.empty((0, 0)), np.empty(0, dtype=int), rejected
    n = min(target_length, *(len(d) for _, d in usable))
    return np.array([d[:n] for _, d in usable]), np.array([i for i, _ in usable]), rejected


def identify_joint(
    decays: Sequence[np.ndarray],
    rate: float,
    settings: IdentifySettings,
    receptance: Receptance | None = None,
    leads: Sequence[np.ndarray] | None = None,
    second: Sequence[np.ndarray] | None = None,
) -> ModalModel:
    """Modal model of one section by joint identification; see :func:`turnout.modal.identify`.

    ``leads`` is not used. It exists because both methods have the same parameters.

    Parameters
    ----------
    decays : sequence of (n,) arrays of float
        Free decays, unfiltered. [m/s²]
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Settings of the identification.
    receptance : Receptance or None
        Receptance whose gate rejects modes and whose H1 gives the residues; None: no gate.
    leads : sequence of (n_lead,) arrays of float or None
        Not used.
    second : sequence of (n,) arrays of float, optional
        Decays of a second response to the same impacts, which has the same modes. [m/s²]

    Returns
    -------
    ModalModel
        Status "rejected" with reasons where no mode is identified.
    """
    records, index, rejected = common_length(decays, rate, settings)
    if not len(records):
        return no_decays(rate, "joint", rejected)
    selection, records, index, rejected = _select_without_outliers(records, index, rejected, rate, settings)
    pair = None if second is None or selection.fit is None else second_records(second, index, records.shape[1])
    if pair is not None:
        selection = with_second_response(selection, records, pair, rate, settings)
    choice = choose_bands(selection, settings, receptance)
    estimates, modes = _band_modes(selection, choice, records, index, rate, settings)
    diagnostics = fit_diagnostics(selection, index, rejected) | {"responses": 1 + (pair is not None)}
    model_fields: dict[str, Any] = {
        "rejections": tuple(choice.rejections),
        "rejected_modes": tuple(choice.rejected_modes),
        "stabilisation": stabilisation_rows(selection, settings.pole_tolerance),
    }
    if choice.status == "rejected":
        return no_model(rate, "joint", diagnostics=diagnostics, **model_fields)
    residues, scale, model_fields["fitted_receptance"] = _residues(modes, choice, selection, receptance)
    return assemble(
        estimates,
        modes,
        residues,
        (selection.mode_fit.unshrunken[:, list(choice.modes.values())], records),
        rate,
        settings,
        method="joint",
        status=choice.status,
        diagnostics=diagnostics,
        scale=scale,
        **model_fields,
    )


def _select_without_outliers(
    records: np.ndarray,
    index: np.ndarray,
    rejected: list[tuple[int, Rejection]],
    rate: float,
    settings: IdentifySettings,
) -> tuple[Selection, np.ndarray, np.ndarray, list[tuple[int, Rejection]]]:
    """Select the modes from all impacts, and once more without the outliers if there are any."""
    selection = select_modes(records, rate, settings)
    outliers = [] if selection.fit is None else outlier_impacts(selection.residual_power)
    if outliers:
        rows = [row for row, _ in outliers]
        rejected = [*rejected, *((int(index[row]), rejection) for row, rejection in outliers)]
        records, index = np.delete(records, rows, axis=0), np.delete(index, rows)
        selection = select_modes(records, rate, settings)
    return selection, records, index, rejected


def _band_modes(
    selection: Selection,
    choice: BandChoice,
    records: np.ndarray,
    index: np.ndarray,
    rate: float,
    settings: IdentifySettings,
) -> tuple[list[ImpactEstimates], tuple[Mode, ...]]:
    """(estimates, modes) of the chosen bands; a mode that fails ``failure_of_mode`` leaves ``choice``."""
    estimates = _estimates(selection, choice, records, index, rate, settings) if choice.modes else []
    accepted, failed = accepted_modes(estimates, settings)
    for band, rejection in failed:
        del choice.modes[band]
        choice.rejections.append(rejection)
    return [e for e, _ in accepted], tuple(mode for _, mode in accepted)


def _estimates(
    selection: Selection,
    choice: BandChoice,
    records: np.ndarray,
    index: np.ndarray,
    rate: float,
    settings: IdentifySettings,
) -> list[ImpactEstimates]:
    fit = selection.mode_fit
    white = whiten(records, selection.whitening)
    columns = selection.background.columns(white.shape[1], rate)
    bound = selection.bound
    if bound is None:
        bound = cramer_rao_bound(fit.theta, white, rate, fit.sigma2, columns)
    error = np.sqrt(np.einsum("ijj->ij", fit.covariance)).reshape(fit.unshrunken.shape)
    strength = np.linalg.norm(records, axis=1)
    systematic = np.hypot(
        systematic_error(own_estimates(fit, rate), selection.rival_modes),
        unresolved_pole_error(fit, columns, rate),
    )
    return [
        ImpactEstimates(
            band,
            index[visible],
            fit.unshrunken[visible, m],
            error[visible, m],
            strength[visible],
            float(selection.energy[m]),
            bound[m],
            systematic[m],
        )
        for band, m in choice.modes.items()
        for visible in (selection.is_visible[:, m],)
    ]


def _residues(
    modes: Sequence[Mode], choice: BandChoice, selection: Selection, receptance: Receptance | None
) -> tuple[np.ndarray, str, FittedReceptance | None]:
    """Residues per unit impulse from the receptance if there is one, else those of the mean decay."""
    named = [(m.frequency, m.damping) for m in modes]
    if receptance is not None:
        for all_modes in (named + _unassigned_modes(choice, selection, receptance), named):
            fitted = fit_receptance(receptance, *np.transpose(all_modes))
            if fitted is not None:
                return fitted.residue[: len(named)], "unit impulse [m/s² per N s]", fitted
    return selection.amplitude.mean(axis=0)[list(choice.modes.values())], "mean decay [m/s²]", None


def _unassigned_modes(choice: BandChoice, selection: Selection, receptance: Receptance) -> list[tuple[float, float]]:
    """(frequency [Hz], damping) of the fit's modes without a band that lie among the lines that passed the gate."""
    lines = receptance.frequency[receptance.passed]
    pairs = [(float(np.exp(f)), float(damping)) for f, damping in selection.mode_fit.mean]
    unassigned = [pairs[m] for m in range(len(pairs)) if m not in choice.modes.values()]
    return [
        (f, damping) for f, damping in unassigned if len(lines) and lines[0] < f < lines[-1] and 0.0 < damping < 0.95
    ]
