"""Impacts, model and modes of one section and campaign as rows of the registry."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from turnout.hammer_test.dynamic_stiffness import dynamic_stiffness
from turnout.modal.block_errors import blocks_with_errors
from turnout.modal.decay_fit import validation_fit
from turnout.modal.mode_shape import two_point_shapes
from turnout.records import Impact, ModalModel, Mode, Receptance

# Hz: rejected poles in this band are reported. Others vary with the noise, far from the track's two resonances.
REPORTED_POLE_BAND = (30.0, 1000.0)


def impact_row(impact: Impact, base: dict[str, Any], test: int, recording_id: str) -> dict[str, Any]:
    """Row of ``impacts``.

    Parameters
    ----------
    impact : Impact
        An impact, accepted or rejected.
    base : dict of str to any
        Columns turnout_id, section_id and campaign_id.
    test : int
        Number of the test.
    recording_id : str
        Id of the file.

    Returns
    -------
    dict of str to any
        The row.
    """
    first = impact.rejections[0] if impact.rejections else None
    detail = "; ".join(r.detail or r.reason for r in (*impact.rejections, *impact.notes))
    return {
        **base,
        "impact_id": f"{recording_id}:{impact.record}",
        "recording_id": recording_id,
        "test": test,
        "record": impact.record,
        "status": "accepted" if impact.accepted else "rejected",
        "reason": first.reason if first else None,
        "measured_value": first.value if first else None,
        "limit_value": first.limit if first else None,
        "detail": detail or None,
        "peak_n": impact.peak,
        "contact_ms": 1e3 * impact.contact,
        "impulse_ns": impact.impulse,
        "noise_ms2": impact.noise_acceleration,
        "band_edge_hz": impact.band_edge,
    }


def model_row(
    model: ModalModel,
    base: dict[str, Any],
    identity: dict[str, Any],
    counts: tuple[int, int],
    coherence_minimum: float | None,
) -> dict[str, Any]:
    """Row of ``models``.

    Parameters
    ----------
    model : ModalModel
        Model of the section.
    base : dict of str to any
        Columns turnout_id, section_id and campaign_id.
    identity : dict of str to any
        Columns model_id, measured_at_utc, code_version and config_hash.
    counts : tuple of (int, int)
        Numbers of accepted and of rejected impacts.
    coherence_minimum : float or None
        Lowest gate level within the bandwidths of the modes, None without modes.

    Returns
    -------
    dict of str to any
        The row.
    """
    first = model.rejections[0] if model.rejections else None
    return {
        **base,
        **identity,
        "method": model.method,
        "status": model.status,
        "reason": first.reason if first else None,
        "measured_value": first.value if first else None,
        "limit_value": first.limit if first else None,
        "detail": _model_detail(model),
        "model_order": model.order,
        "sampling_rate_hz": model.rate,
        "a_matrix": np.ravel(model.a),
        "b_vector": np.ravel(model.b),
        "c_vector": np.ravel(model.c),
        "n_impacts_used": counts[0],
        "n_impacts_rejected": counts[1],
        "coherence_minimum": coherence_minimum,
        "hammer_fit_pct": model.fit,
        "hammer_fit_null_pct": model.diagnostics.get("fit_null"),
    }


def mode_rows(
    model: ModalModel,
    receptance: Receptance,
    base: dict[str, Any],
    identity: dict[str, Any],
    temperature: float | None,
) -> list[dict[str, Any]]:
    """Rows of ``modes``: every mode with its block of the state space and the stiffness at its resonance.

    Parameters
    ----------
    model : ModalModel
        Model of the section.
    receptance : Receptance
        Receptance of the accepted impacts.
    base : dict of str to any
        Columns turnout_id, section_id and campaign_id.
    identity : dict of str to any
        Columns model_id, measured_at_utc, code_version and config_hash.
    temperature : float or None
        Rail temperature. [°C]

    Returns
    -------
    list of dict
        One row per mode.
    """
    return [
        mode_row(mode, base, identity, temperature) | _block_columns(*block) | _stiffness_columns(mode, receptance)
        for mode, block in zip(model.modes, blocks_with_errors(model), strict=True)
    ]


def _block_columns(entries: np.ndarray, errors: np.ndarray) -> dict[str, Any]:
    """Columns of Tables 1 and 2 of the paper; errors that are not known are empty."""
    known = [None if np.isnan(errors[part]).any() else errors[part] for part in (slice(0, 4), slice(4, 6))]
    return {"a_block": entries[:4], "a_block_se": known[0], "c_block": entries[4:], "c_block_se": known[1]}


def _stiffness_columns(mode: Mode, receptance: Receptance) -> dict[str, float | None]:
    """Dynamic stiffness at the resonance [MN/m]; empty behind an exponential window, which changes it."""
    names = "stiffness_mn_m", "stiffness_low_mn_m", "stiffness_high_mn_m"
    stiffness = None
    if not receptance.decay:
        stiffness = dynamic_stiffness(
            receptance.frequency, receptance.h1, receptance.coherence, receptance.passed, receptance.n, mode.frequency
        )
    values = stiffness or (np.inf,) * 3
    return {name: value / 1e6 if np.isfinite(value) else None for name, value in zip(names, values, strict=True)}


def mode_row(mode: Mode, base: dict[str, Any], identity: dict[str, Any], temperature: float | None) -> dict[str, Any]:
    """Row of ``modes`` without the columns of the state space and the stiffness.

    Parameters
    ----------
    mode : Mode
        A mode of the model.
    base : dict of str to any
        Columns turnout_id, section_id and campaign_id.
    identity : dict of str to any
        Columns model_id, measured_at_utc, code_version and config_hash.
    temperature : float or None
        Rail temperature. [°C]

    Returns
    -------
    dict of str to any
        The row.
    """
    return {
        "model_id": identity["model_id"],
        "band": mode.band,
        "turnout_id": base["turnout_id"],
        "section_id": base["section_id"],
        "measured_at_utc": identity["measured_at_utc"],
        "frequency_hz": mode.frequency,
        "frequency_se_hz": mode.frequency_se,
        "frequency_sd_hz": mode.frequency_sd,
        "damping_ratio": mode.damping,
        "damping_se": mode.damping_se,
        "frequency_repeatability_hz": mode.frequency_repeatability,
        "frequency_systematic_hz": mode.frequency_systematic,
        "damping_repeatability": mode.damping_repeatability,
        "damping_systematic": mode.damping_systematic,
        "rail_temperature_c": temperature,
        "n_impacts": mode.n,
        "source": "hammer",
    }


def impact_mode_row(
    entry: Mapping[str, Any], base: dict[str, Any], identity: dict[str, Any], impact_id: str
) -> dict[str, Any]:
    """Row of ``impact_modes``.

    Parameters
    ----------
    entry : mapping of str to any
        One entry of ``ModalModel.per_impact``.
    base : dict of str to any
        Columns turnout_id, section_id and campaign_id.
    identity : dict of str to any
        Columns model_id, measured_at_utc, code_version and config_hash.
    impact_id : str
        Id of the impact.

    Returns
    -------
    dict of str to any
        The row.
    """
    return {
        "model_id": identity["model_id"],
        "impact_id": impact_id,
        "band": entry["band"],
        "section_id": base["section_id"],
        "measured_at_utc": identity["measured_at_utc"],
        "frequency_hz": entry["frequency"],
        "frequency_se_hz": entry["frequency_se"],
        "damping_ratio": entry["damping"],
        "damping_se": entry["damping_se"],
    }


def validation_columns(model: ModalModel, responses: Sequence[Impact]) -> dict[str, Any]:
    """Columns of ``models`` with the fit of the modes to a response that took no part in the identification.

    Frequencies and damping ratios are those of the model. Only the amplitudes are estimated, per impact.

    Parameters
    ----------
    model : ModalModel
        Model of the section.
    responses : sequence of Impact
        Accepted impacts with the second response; empty where there is none.

    Returns
    -------
    dict of str to any
        Median fit [%] and number of impacts; empty without modes or responses.
    """
    fits = validation_fit(model, [i.decay for i in responses]) if responses and model.modes else np.empty(0)
    fits = fits[np.isfinite(fits)]
    return {
        "validation_fit_pct": float(np.median(fits)) if fits.size else None,
        "n_validation": int(fits.size) if fits.size else None,
    }


def shape_columns(model: ModalModel, pairs: Sequence[tuple[Impact, Impact]]) -> list[dict[str, Any]]:
    """Columns of ``modes`` with the ratio of the amplitudes at the second and at the first response.

    Parameters
    ----------
    model : ModalModel
        Model of the section.
    pairs : sequence of (Impact, Impact)
        Accepted impacts with both responses; empty where there is no second one.

    Returns
    -------
    list of dict
        One per mode of the model; empty without shapes.
    """
    first, second = ([pair[k].acceleration[pair[0].decay_start :] for pair in pairs] for k in (0, 1))
    shapes = two_point_shapes(model, first, second)
    if shapes is None:
        return [{} for _ in model.modes]
    return [
        {
            "shape_ratio": np.array([s.ratio.real, s.ratio.imag]),
            "shape_covariance": s.covariance[[0, 0, 1], [0, 1, 1]],
            "n_shape": len(pairs),
        }
        for s in shapes
    ]


def _pole_row(pole: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "order": int(pole["order"]),
        "frequency": round(float(pole["frequency"]), 2),
        "damping": round(float(pole["damping"]), 4),
        "emac": round(float(pole["emac"]), 3),
        "energy": round(float(pole["energy"]), 4),
        "status": pole["status"],
    }


def _model_detail(model: ModalModel) -> str | None:
    in_band = [m for m in model.rejected_modes if REPORTED_POLE_BAND[0] <= m["frequency"] <= REPORTED_POLE_BAND[1]]
    rejected = [f"{m['frequency']:.0f} Hz not used: {m['reason']}" for m in in_band]
    reasons = [r.detail or r.reason for r in model.rejections]
    bias = model.diagnostics.get("bias_words")
    return "; ".join([*reasons, *rejected, *([bias] if bias else [])]) or None
