"""All resonances at once from the unfiltered decays: selection, per-blow modes, their mean, and the model."""

import numpy as np

from turnout.identify.account import fit_diagnostics, stabilisation_rows
from turnout.identify.assemble import assemble, no_decays, no_model
from turnout.identify.band_choice import choose_bands
from turnout.identify.bound import cramer_rao_bound
from turnout.identify.choice import choice_error
from turnout.identify.decays import common_length
from turnout.identify.gate import residues_of_receptance
from turnout.identify.impact_table import ImpactEstimates
from turnout.identify.mixed import LOWEST_DAMPING
from turnout.identify.noise import whiten
from turnout.identify.odd_blow import odd_blows
from turnout.identify.select import select_modes
from turnout.records import ModalModel, Rejection


def identify_joint(decays, rate: float, settings, receptance=None, leads=None) -> ModalModel:
    """Modal model of one section by joint identification; see :func:`turnout.identify.identify`.

    ``leads`` is taken so that both methods can be called alike; it is not used.
    """
    records, index, dropped = common_length(decays, rate, settings)
    if not len(records):
        return no_decays(rate, "joint", dropped)
    selection, records, index, dropped = _select_without_odd_blows(records, index, dropped, rate, settings)
    choice = choose_bands(selection, settings, receptance)
    estimates, modes = _named(selection, choice, records, index, rate, settings)
    told = fit_diagnostics(selection, index, dropped)
    rest = {
        "rejections": tuple(choice.rejections),
        "rejected_modes": tuple(choice.rejected_modes),
        "stabilisation": stabilisation_rows(selection, settings.pole_tolerance),
    }
    if choice.status == "rejected":
        return no_model(rate, "joint", diagnostics=told, **rest)
    residues, scale = _residues(modes, choice, selection, receptance)
    return assemble(
        estimates,
        modes,
        residues,
        (selection.fit.free[:, list(choice.modes.values())], records),
        rate,
        settings,
        method="joint",
        status=choice.status,
        diagnostics=told,
        scale=scale,
        **rest,
    )


def _select_without_odd_blows(records, index, dropped, rate, settings):
    """Modes of all blows, or again of all but those that these modes do not describe."""
    selection = select_modes(records, rate, settings)
    odd = [] if selection.fit is None else odd_blows(selection.residual_power)
    if odd:
        rows = [row for row, _ in odd]
        dropped = [*dropped, *((int(index[row]), rejection) for row, rejection in odd)]
        records, index = np.delete(records, rows, axis=0), np.delete(index, rows)
        selection = select_modes(records, rate, settings)
    return selection, records, index, dropped


def _named(selection, choice, records, index, rate, settings):
    """(estimates, modes) of the bands chosen; one whose mean over the blows is not damped is taken from ``choice``."""
    found = []
    for e in _estimates(selection, choice, records, index, rate, settings) if choice.modes else ():
        mode = e.mode(settings.confidence)
        if mode.damping > LOWEST_DAMPING:
            found.append((e, mode))
            continue
        del choice.modes[e.band]
        detail = f"{e.band} mode at {mode.frequency:.0f} Hz: damping, mean over its blows"
        choice.rejections.append(Rejection("not_identified", mode.damping, LOWEST_DAMPING, detail))
    return [e for e, _ in found], tuple(mode for _, mode in found)


def _estimates(selection, choice, records, index, rate, settings):
    fit = selection.fit
    white = whiten(records, selection.whitening)
    columns = selection.background.columns(white.shape[1], rate)
    bound = cramer_rao_bound(fit.theta, white, rate, fit.sigma2, columns)
    error = np.sqrt(np.einsum("ijj->ij", fit.covariance)).reshape(fit.free.shape)
    strength = np.linalg.norm(records, axis=1)
    return [
        ImpactEstimates(
            band,
            index[shows],
            fit.free[shows, m],
            error[shows, m],
            strength[shows],
            float(selection.energy[m]),
            bound[m],
            choice_error(fit.mean[m], selection.others, settings.spread_maximum),
        )
        for band, m in choice.modes.items()
        for shows in (selection.shows[:, m],)
    ]


def _residues(modes, choice, selection, receptance):
    """From the receptance per unit impulse where there is one, else of the mean decay."""
    named = [(m.frequency, m.damping) for m in modes]
    if receptance is not None:
        for all_modes in (named + _unnamed(choice, selection, receptance), named):
            residues = residues_of_receptance(receptance, *np.transpose(all_modes))
            if residues is not None:
                return residues[: len(named)], "unit impulse [m/s² per N s]"
    return selection.amplitude.mean(axis=0)[list(choice.modes.values())], "mean decay [m/s²]"


def _unnamed(choice, selection, receptance):
    """(frequency [Hz], damping) of the fit's other modes that lie among the lines that passed."""
    lines = receptance.frequency[receptance.passed]
    pairs = [(float(np.exp(f)), float(damping)) for f, damping in selection.fit.mean]
    rest = [pairs[m] for m in range(len(pairs)) if m not in choice.modes.values()]
    return [(f, damping) for f, damping in rest if len(lines) and lines[0] < f < lines[-1] and 0.0 < damping < 0.95]
