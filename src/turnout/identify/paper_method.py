"""Method "paper": 200 Hz split, 2 + 2 states, validation fit; kept to compare with, its bias beside it."""

import numpy as np

from turnout.identify.account import fit_diagnostics, stabilisation_rows
from turnout.identify.assemble import assemble, no_decays, no_model
from turnout.identify.decays import common_length
from turnout.identify.gate import passed_share
from turnout.identify.impact_table import ImpactEstimates
from turnout.identify.linearise import drift_columns, linearise
from turnout.identify.paper_bias import in_words, simulated_bias
from turnout.identify.select import select_modes
from turnout.identify.split_bands import band_modes
from turnout.records import ModalModel, Rejection


def identify_paper(decays, rate: float, settings, receptance=None, leads=None) -> ModalModel:
    """The paper's procedure with its holes filled as the settings say; see :func:`turnout.identify.identify`.

    ``leads`` are the samples before each decay (pre-trigger and contact), one (n_lead,) array each: the filters
    run over them too. Without them the filters start at the decay, which adds an error of its own.

    The result's ``diagnostics`` hold ``simulated_bias`` per band and ``bias_words``, the same to print.
    """
    records, index, dropped = common_length(decays, rate, settings)
    if not len(records):
        return no_decays(rate, "paper", dropped)
    before = [np.asarray(leads[i], dtype=float) if leads is not None else np.empty(0) for i in index]
    whole = [np.concatenate([lead, np.asarray(decays[i], float)]) for lead, i in zip(before, index, strict=True)]
    found = band_modes(whole, [len(lead) for lead in before], records.shape[1], rate, settings)
    selection = select_modes(records, rate, settings)
    told = fit_diagnostics(selection, index, dropped) | {"filters_start_at": "decay" if leads is None else "record"}
    estimates, rejections = _estimates(found, records, index, settings, receptance)
    rest = {
        "rejections": tuple(rejections),
        "stabilisation": stabilisation_rows(selection, settings.pole_tolerance),
    }
    if not estimates:
        return no_model(rate, "paper", diagnostics=told, **rest)
    modes = tuple(e.mode(settings.confidence) for e in estimates)
    amplitude = _amplitude(modes, records, rate)
    told |= _bias(selection, modes, amplitude, records.shape[1], rate, settings)
    return assemble(
        estimates,
        modes,
        amplitude,
        _in_common(estimates, records, index),
        rate,
        settings,
        method="paper",
        status="accepted" if len(modes) == 2 else "second_order_only",
        diagnostics=told,
        scale="mean decay [m/s²]",
        **rest,
    )


def _edges(band, settings):
    return next((low, high) for name, low, high in settings.bands() if name == band)


def _estimates(found, records, index, settings, receptance):
    """Second-order estimates of each band over the blows, without errors, for the procedure states none."""
    strength = np.linalg.norm(records, axis=1)
    estimates, rejections = [], []
    for band, values in zip(("ballast", "railpad"), found, strict=True):
        low, high = _edges(band, settings)
        use = np.isfinite(values[:, 0]) & (values[:, 0] >= low) & (values[:, 0] < high) & (values[:, 1] < 0.95)
        if np.mean(use) < settings.impact_share:
            detail = f"{band} band: share of impacts in which order 2 finds a mode there"
            rejections.append(Rejection("not_identified", float(np.mean(use)), settings.impact_share, detail))
            continue
        theta = np.stack([np.log(values[use, 0]), values[use, 1]], axis=1)
        if receptance is not None:
            f, zeta = np.exp(theta[:, 0].mean()), theta[:, 1].mean()
            share, level = passed_share(receptance, float(f), float(zeta))
            if share < settings.gate_share:
                detail = f"{band} mode: share of its half-power band that passes the gate; lowest level {level:.2f}"
                rejections.append(Rejection("low_coherence", share, settings.gate_share, detail))
                continue
        error = np.full_like(theta, np.nan)
        estimates.append(ImpactEstimates(band, index[use], theta, error, np.ones_like(strength[use])))
    return estimates, rejections


def _amplitude(modes, records, rate):
    theta = np.array([[np.log(m.frequency), m.damping] for m in modes])
    common = np.broadcast_to(theta, (len(records), *theta.shape))
    return linearise(common, records, rate, drift_columns(records.shape[1], -1)).amplitude.mean(axis=0)


def _bias(selection, modes, amplitude, n, rate, settings):
    """Simulated at the modes of the joint fit where it has these bands, else at the procedure's own."""
    truth = {m.band: (m.frequency, m.damping, amplitude[i]) for i, m in enumerate(modes)}
    noise = np.sqrt(selection.fit.sigma2) if selection.fit is not None else 0.0
    if selection.fit is not None:
        frequency = np.exp(selection.fit.mean[:, 0])
        for band in truth:
            low, high = _edges(band, settings)
            inside = np.flatnonzero((frequency >= low) & (frequency < high))
            if len(inside):
                m = max(inside, key=lambda k: np.median(selection.chi_squared[:, k]))
                mean_amplitude = selection.amplitude[:, m].mean()
                truth[band] = (frequency[m], selection.fit.mean[m, 1], mean_amplitude)
    named = [band for band in ("ballast", "railpad") if band in truth]
    f, zeta, alpha = (np.array(column) for column in zip(*(truth[band] for band in named), strict=True))
    bias = simulated_bias(f, zeta, alpha, float(noise), n, rate, settings, named)
    return {"simulated_bias": bias, "bias_words": in_words(bias)}


def _in_common(estimates, records, index):
    """Modes and decays of the blows in which every band gave a mode, for the validation fit."""
    common = set(index)
    for e in estimates:
        common &= set(e.impact)
    rows = np.array([i for i, impact in enumerate(index) if impact in common], dtype=int)
    theta = np.stack([e.estimate[np.isin(e.impact, index[rows])] for e in estimates], axis=1)
    return theta, records[rows]
