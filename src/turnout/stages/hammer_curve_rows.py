"""Rows of the curves of a hammer test: receptance, densities and decay, thinned for the pages."""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from turnout.records import Impact, ModalModel, Receptance
from turnout.signal.spectra import cross_spectra, density_interval
from turnout.stages.hammer_rows import _pole_row

PLOT_BAND = (20.0, 1600.0)  # Hz: band of the receptances in the registry
MAX_PLOT_LINES = 240  # lines of a receptance in the registry
PLOT_DECAY_TIME = 0.04  # s of a decay in the registry


def receptance_row(
    receptance: Receptance,
    required: float,
    model: ModalModel,
    decay: np.ndarray | None,
    base: dict[str, Any],
    identity: dict[str, Any],
) -> dict[str, Any]:
    """Row of ``receptances``, at the resolution of a figure.

    Parameters
    ----------
    receptance : Receptance
        Receptance of the accepted impacts.
    required : float
        Level that the gate requires.
    model : ModalModel
        Model of the section.
    decay : (n_sample,) array of float or None
        Decay of one impact. [m/s²]
    base : dict of str to any
        Columns turnout_id, section_id and campaign_id.
    identity : dict of str to any
        Columns model_id, measured_at_utc, code_version and config_hash.

    Returns
    -------
    dict of str to any
        The row.
    """
    lines = plot_lines(receptance.frequency)
    measured, predicted = plot_decay(model, decay)
    return {
        **base,
        "model_id": identity["model_id"],
        "measured_at_utc": identity["measured_at_utc"],
        "n_impacts": receptance.n,
        "gate": receptance.gate,
        "gate_required": required,
        "valid_to_hz": receptance.valid_to,
        "window_decay_per_s": receptance.decay,
        "frequency_hz": receptance.frequency[lines].astype(np.float32),
        "h1_real_m_n": receptance.h1.real[lines].astype(np.float32),
        "h1_imag_m_n": receptance.h1.imag[lines].astype(np.float32),
        "h2_abs_m_n": np.abs(receptance.h2[lines]).astype(np.float32),
        "hv_abs_m_n": np.abs(receptance.hv[lines]).astype(np.float32),
        "coherence": receptance.coherence[lines].astype(np.float32),
        "coherence_low": receptance.coherence_low[lines].astype(np.float32),
        "coherence_high": receptance.coherence_high[lines].astype(np.float32),
        "passed": receptance.passed[lines],
        "decay_rate_hz": model.rate,
        "decay_ms2": measured,
        "decay_model_ms2": predicted,
        "stabilisation_json": json.dumps([_pole_row(p) for p in model.stabilisation]),
    }


def density_columns(impacts: Sequence[Impact], frequency: np.ndarray) -> dict[str, Any]:
    """Columns of ``receptances`` with the averaged spectral density of the response and its 95 % limits.

    Parameters
    ----------
    impacts : sequence of Impact
        Accepted impacts of one sampling rate.
    frequency : (n_line,) array of float
        Lines at which the density is stored. [Hz]

    Returns
    -------
    dict of str to any
        Density [(m/s²)²/Hz] and the factors of its limits.

    References
    ----------
    Barkhordari et al., eq. 18, with 10 log10 and two degrees of freedom per impact.
    """
    n = min(len(i.acceleration) for i in impacts)
    records = np.array([i.acceleration[:n] for i in impacts])
    lines, density, _, _ = cross_spectra(records, records, impacts[0].rate, n)
    low, high = density_interval(len(impacts))
    return {
        "response_density_m2_s3": np.interp(frequency, lines, density.real).astype(np.float32),
        "density_low_factor": low,
        "density_high_factor": high,
    }


def plot_lines(frequency: np.ndarray) -> np.ndarray:
    """Lines of a figure: at most ``MAX_PLOT_LINES``, evenly spaced over the logarithm of ``PLOT_BAND``.

    Parameters
    ----------
    frequency : (n_line,) array of float
        Frequencies of the receptance, ascending. [Hz]

    Returns
    -------
    (n,) array of int
        Indices into ``frequency``, ascending.

    Examples
    --------
    >>> frequency = np.arange(1.0, 4000.0)
    >>> lines = plot_lines(frequency)
    >>> frequency[lines[0]], frequency[lines[-1]], len(lines) <= MAX_PLOT_LINES
    (np.float64(20.0), np.float64(1600.0), True)
    """
    wanted = np.geomspace(*PLOT_BAND, MAX_PLOT_LINES)
    nearest = np.searchsorted(0.5 * (frequency[1:] + frequency[:-1]), wanted)
    return np.unique(nearest)


def plot_decay(model: ModalModel, decay: np.ndarray | None) -> tuple[np.ndarray, np.ndarray] | tuple[None, None]:
    """The first part of a decay, and the model's decay fitted to it by its initial state.

    Parameters
    ----------
    model : ModalModel
        Model of the section.
    decay : (n_sample,) array of float or None
        Decay of one impact. [m/s²]

    Returns
    -------
    two (n,) arrays of float32
        Measured and fitted [m/s²]; None, None without a decay or a model.
    """
    if decay is None or not model.order:
        return None, None
    n = min(len(decay), int(PLOT_DECAY_TIME * model.rate))
    basis = np.empty((n, model.order))
    row = np.array(model.c, dtype=float)
    for k in range(n):
        basis[k] = row
        row = row @ model.a
    state, *_ = np.linalg.lstsq(basis, decay[:n], rcond=None)
    return decay[:n].astype(np.float32), (basis @ state).astype(np.float32)
