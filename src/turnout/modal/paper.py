"""Identify modes by the paper's procedure (method "paper"): two filtered bands, a second-order realisation of each.

It exists for comparison. Its bias is simulated at the identified model and reported with the result.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from turnout.modal.bands import accepted_modes, fit_receptance, passed_share
from turnout.modal.era import era
from turnout.modal.joint import common_length, fit_diagnostics, stabilisation_rows
from turnout.modal.least_squares import drift_columns, linearise
from turnout.modal.poles import continuous_pole
from turnout.modal.pulse_response import pulse_response
from turnout.modal.selection import select_modes
from turnout.modal.state_space import assemble, no_decays, no_model
from turnout.modal.summary import ImpactEstimates
from turnout.records import ModalModel, Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from turnout.config.settings.identify import IdentifySettings
    from turnout.modal.selection import Selection
    from turnout.records import Mode, Receptance

MAX_EDGE_SHARE = 0.45  # highest edge of a filter as a share of the sampling rate


def split_bands(records: ArrayLike, rate: float, settings: IdentifySettings) -> tuple[np.ndarray, ...]:
    """Records below and above the split frequency, filtered over their whole length.

    At a low sampling rate the upper band ends earlier; if nothing remains of it there is only the lower one.

    Butterworth low-pass at ``split_frequency`` and band-pass from there to ``paper_band_high``, forwards and
    backwards if ``paper_zero_phase``. The paper names neither filter nor order nor phase.

    Parameters
    ----------
    records : (n, n_sample) array of float
        Records with their contact. [m/s²]
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Settings of the identification.

    Returns
    -------
    tuple of (n, n_sample) arrays of float
        Lower and upper band; only the lower one at a low sampling rate.

    References
    ----------
    Barkhordari et al., section on model validation: 10-200 Hz and 200-800 Hz.
    """
    order, edge = settings.paper_filter_order, settings.split_frequency
    upper_edge = min(settings.paper_band_high, MAX_EDGE_SHARE * rate)
    filters = [scipy.signal.butter(order, min(edge, upper_edge), fs=rate, output="sos")]
    if upper_edge > edge:
        filters.append(scipy.signal.butter(order, [edge, upper_edge], btype="band", fs=rate, output="sos"))
    apply_filter = scipy.signal.sosfiltfilt if settings.paper_zero_phase else scipy.signal.sosfilt
    return tuple(apply_filter(sos, np.asarray(records, dtype=float), axis=-1) for sos in filters)


def second_order_mode(decay: np.ndarray, rate: float) -> tuple[float, float]:
    """Mode of a square, order-2 realisation.

    Parameters
    ----------
    decay : (n,) array of float
        Filtered decay. [m/s²]
    rate : float
        Sampling rate. [Hz]

    Returns
    -------
    (float, float)
        Frequency [Hz] and damping ratio, nan if the poles are real.

    References
    ----------
    Barkhordari et al., eq. 8-16.
    """
    frequency, damping = era(decay, 2, rows=len(decay) // 2, rate=rate).modes()
    return (float(frequency[0]), float(damping[0])) if len(frequency) else (np.nan, np.nan)


def band_modes(
    records: Sequence[np.ndarray] | np.ndarray,
    starts: Sequence[int] | np.ndarray,
    n: int,
    rate: float,
    settings: IdentifySettings,
) -> np.ndarray:
    """Mode of each band of each record.

    Parameters
    ----------
    records : sequence of (n_sample,) arrays of float
        Records with their contact. [m/s²]
    starts : (n_record,) array of int
        First sample of each decay.
    n : int
        Samples of a decay.
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Settings of the identification.

    Returns
    -------
    (2, n_record, 2) array of float
        Frequency [Hz] and damping ratio in ballast and railpad band, nan without a mode.
    """
    modes = np.full((2, len(records), 2), np.nan)
    for i, (record, start) in enumerate(zip(records, starts, strict=True)):
        for band, filtered in enumerate(split_bands(record, rate, settings)):
            modes[band, i] = second_order_mode(filtered[start : start + n], rate)
    return modes


CONTACT_DURATION = 1.5e-3  # s, mean contact time of the simulated impacts, that of a soft tip
LEAD_TIME = 0.01  # s before contact
DECAY_DELAY = 2e-4  # s from the end of contact to the start of the decay


def simulated_bias(
    frequency: np.ndarray,
    damping: np.ndarray,
    amplitude: np.ndarray,
    noise: float,
    n: int,
    rate: float,
    settings: IdentifySettings,
    bands: Sequence[str] = ("ballast", "railpad"),
) -> dict:
    """Bias of the procedure on decays of known modes.

    Impacts of a soft tip (1.5 ms, 8 % spread, start between samples) on a model with these modes are simulated, and
    white noise is added. They pass the same filters and realisations.

    Parameters
    ----------
    frequency, damping : (n_mode,) arrays
        Modes of the decays, those of ``bands`` first. [Hz], [-]
    amplitude : (n_mode,) array of complex
        At the start of the free decay. [m/s²]
    noise : float
        Standard deviation of the noise. [m/s²]
    n : int
        Samples of a decay.
    rate : float
        [Hz]
    settings : IdentifySettings
        ``paper_bias_tests`` impacts are simulated.
    bands : tuple of str
        Which of the two bands the first modes belong to.

    Returns
    -------
    dict
        For each of ``bands``: ``frequency_percent`` and ``damping_percent``, the mean error over the true value [%],
        ``found``, the share of impacts in which a mode is found, and ``n``, the number of impacts.
    """
    rng = np.random.default_rng(20171001)
    draws = settings.paper_bias_tests
    s = continuous_pole(np.asarray(frequency), np.asarray(damping))
    contact = CONTACT_DURATION * (1.0 + 0.08 * rng.standard_normal(draws))
    lead = round(LEAD_TIME * rate)
    time = (np.arange(lead + round((2.0 * CONTACT_DURATION + DECAY_DELAY) * rate) + n) - lead) / rate
    time = time - rng.random(draws)[:, None] / rate
    # The residue that gives this amplitude at the start of the decay.
    turn = 2.0 * np.pi / CONTACT_DURATION
    spectrum = -np.expm1(-s * CONTACT_DURATION) / s * 0.5 * turn**2 / (s**2 + turn**2)
    residue = amplitude * np.exp(-s * (CONTACT_DURATION + DECAY_DELAY)) / spectrum
    clean = pulse_response(
        time, np.broadcast_to(s, (draws, len(s))), np.broadcast_to(residue, (draws, len(s))), contact
    )
    records = clean + noise * rng.standard_normal(clean.shape)
    starts = lead + np.ceil((contact + DECAY_DELAY) * rate).astype(int)
    modes = band_modes(records, starts, n, rate, settings)
    bias = {}
    for m, name in enumerate(bands):
        band = modes[("ballast", "railpad").index(name)]
        is_found = np.isfinite(band[:, 0])
        error = 100.0 * (band[is_found] / (frequency[m], damping[m]) - 1.0)
        mean = error.mean(axis=0) if is_found.any() else np.full(2, np.nan)
        bias[name] = {
            "frequency_percent": float(mean[0]),
            "damping_percent": float(mean[1]),
            "found": float(is_found.mean()),
            "n": draws,
        }
    return bias


def bias_sentence(bias: dict) -> str:
    """The bias as a sentence, printed with every result of the paper's procedure.

    Parameters
    ----------
    bias : dict
        Result of ``simulated_bias``.

    Returns
    -------
    str
        The sentence.

    Examples
    --------
    >>> bias_sentence({"ballast": {"frequency_percent": -10.9, "damping_percent": -10.0, "found": 1.0, "n": 12}})
    'simulated bias of method paper at this model (12 impacts): ballast f -10.9 %, zeta -10.0 %, found 100 %'
    """
    n = next(iter(bias.values()))["n"] if bias else 0
    clauses = [
        f"{band} f {b['frequency_percent']:+z.1f} %, zeta {b['damping_percent']:+z.1f} %, "
        f"found {100 * b['found']:.0f} %"
        for band, b in bias.items()
    ]
    return f"simulated bias of method paper at this model ({n} impacts): " + "; ".join(clauses)


def identify_paper(
    decays: Sequence[np.ndarray],
    rate: float,
    settings: IdentifySettings,
    receptance: Receptance | None = None,
    leads: Sequence[np.ndarray] | None = None,
) -> ModalModel:
    """The paper's procedure; the settings supply what the paper leaves open. See :func:`turnout.modal.identify`.

    Parameters
    ----------
    decays : sequence of (n,) arrays of float
        Free decays, unfiltered. [m/s²]
    rate : float
        Sampling rate. [Hz]
    settings : IdentifySettings
        Settings of the identification.
    receptance : Receptance or None
        Receptance whose gate rejects modes; None: no gate.
    leads : sequence of (n_lead,) arrays of float, or None
        Samples before each decay: pre-trigger and contact. The filters run over them too. Without them the filters
        start at the decay, which adds an error. [m/s²]

    Returns
    -------
    ModalModel
        Its ``diagnostics`` hold ``simulated_bias`` per band and ``bias_words``, the same to print.
    """
    records, index, rejected = common_length(decays, rate, settings)
    if not len(records):
        return no_decays(rate, "paper", rejected)
    lead_ins = [np.asarray(leads[i], dtype=float) if leads is not None else np.empty(0) for i in index]
    full_records = [
        np.concatenate([lead, np.asarray(decays[i], float)]) for lead, i in zip(lead_ins, index, strict=True)
    ]
    band_values = band_modes(full_records, [len(lead) for lead in lead_ins], records.shape[1], rate, settings)
    selection = select_modes(records, rate, settings)
    diagnostics = fit_diagnostics(selection, index, rejected) | {
        "filters_start_at": "decay" if leads is None else "record"
    }
    estimates, rejections = _estimates(band_values, records, index, settings, receptance)
    accepted, failed = accepted_modes(estimates, settings)
    rejections += [rejection for _, rejection in failed]
    model_fields: dict[str, Any] = {
        "rejections": tuple(rejections),
        "stabilisation": stabilisation_rows(selection, settings.pole_tolerance),
    }
    if not accepted:
        return no_model(rate, "paper", diagnostics=diagnostics, **model_fields)
    estimates, modes = [e for e, _ in accepted], tuple(mode for _, mode in accepted)
    if receptance is not None:
        values = [m.frequency for m in modes], [m.damping for m in modes]
        model_fields["fitted_receptance"] = fit_receptance(receptance, *values)
    amplitude = _amplitude(modes, records, rate)
    diagnostics |= _model_bias(selection, modes, amplitude, records.shape[1], rate, settings)
    return assemble(
        estimates,
        modes,
        amplitude,
        _common_impacts(estimates, records, index),
        rate,
        settings,
        method="paper",
        status="accepted" if len(modes) == 2 else "second_order_only",
        diagnostics=diagnostics,
        scale="mean decay [m/s²]",
        **model_fields,
    )


def _band_edges(band: str, settings: IdentifySettings) -> tuple[float, float]:
    return next((low, high) for name, low, high in settings.bands() if name == band)


def _estimates(
    band_values: np.ndarray,
    records: np.ndarray,
    index: np.ndarray,
    settings: IdentifySettings,
    receptance: Receptance | None,
) -> tuple[list[ImpactEstimates], list[Rejection]]:
    """Second-order estimates of each band over the impacts, without errors: the procedure gives none."""
    strength = np.linalg.norm(records, axis=1)
    estimates, rejections = [], []
    for band, values in zip(("ballast", "railpad"), band_values, strict=True):
        low, high = _band_edges(band, settings)
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


def _amplitude(modes: Sequence[Mode], records: np.ndarray, rate: float) -> np.ndarray:
    theta = np.array([[np.log(m.frequency), m.damping] for m in modes])
    common = np.broadcast_to(theta, (len(records), *theta.shape))
    return linearise(common, records, rate, drift_columns(records.shape[1], -1)).amplitude.mean(axis=0)


def _model_bias(
    selection: Selection, modes: Sequence[Mode], amplitude: np.ndarray, n: int, rate: float, settings: IdentifySettings
) -> dict[str, Any]:
    """Bias at the modes of the joint fit if it has modes in these bands, else at those of the procedure."""
    truth = {m.band: (m.frequency, m.damping, amplitude[i]) for i, m in enumerate(modes)}
    noise = np.sqrt(selection.mode_fit.sigma2) if selection.fit is not None else 0.0
    if selection.fit is not None:
        frequency = np.exp(selection.mode_fit.mean[:, 0])
        for band in truth:
            low, high = _band_edges(band, settings)
            inside = np.flatnonzero((frequency >= low) & (frequency < high))
            if len(inside):
                m = max(inside, key=lambda k: np.median(selection.chi_squared[:, k]))
                mean_amplitude = selection.amplitude[:, m].mean()
                truth[band] = (frequency[m], selection.mode_fit.mean[m, 1], mean_amplitude)
    named = [band for band in ("ballast", "railpad") if band in truth]
    f, zeta, alpha = (np.array(column) for column in zip(*(truth[band] for band in named), strict=True))
    bias = simulated_bias(f, zeta, alpha, float(noise), n, rate, settings, named)
    return {"simulated_bias": bias, "bias_words": bias_sentence(bias)}


def _common_impacts(
    estimates: Sequence[ImpactEstimates], records: np.ndarray, index: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Modes and decays of the impacts in which every band has a mode, for the validation fit."""
    common = set(index)
    for e in estimates:
        common &= set(e.impact)
    rows = np.array([i for i, impact in enumerate(index) if impact in common], dtype=int)
    theta = np.stack([e.estimate[np.isin(e.impact, index[rows])] for e in estimates], axis=1)
    return theta, records[rows]
