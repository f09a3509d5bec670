"""Row of a finding in the registry: its sentence, position, recommendation and fitted parameters."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from turnout import physics
from turnout.stages.accepted_effects import SUPPORT_SPACING
from turnout.stages.mismatch_text import UNFINISHED, whole_sentence
from turnout.stages.parameter_text import parameter_estimate

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.diagnose import Diagnosis
    from turnout.mismatch.engine.localization import Location
    from turnout.mismatch.engine.verdict import Verdict

MAX_CELL_DISTANCE = 0.3  # m: a cell of the residual closer than this is at the finding
FALSE_DISCOVERY_RATE = 0.05  # expected share of false ones among the frames reported
GENERAL_CHECK = "Inspect the track at this position; repeat the measurement after the work"
FILES_CHECK = "Compare positions in the layout, the track file and the vehicle files with the site"
OFF_FILE = "strained_value_remains"  # rule of a decision
GENERAL_TEST = "hammer tests at the points between, and a train of another load and speed"


def sentence(diagnosis: Diagnosis) -> str:
    """The verdict as sentences for a track engineer.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the engine.

    Returns
    -------
    str
    """
    verdict = diagnosis.verdict
    if verdict.answer == "none":
        return "Simulation and recordings agree as well as those of intact turnouts do."
    if verdict.answer == "numerics":
        return f"The simulation is not fine enough to be compared: {verdict.reason}."
    if verdict.answer == "unknown":
        if verdict.cause == "all trains":
            return whole_sentence(verdict.reason)
        if not verdict.is_finished:
            return f"{UNFINISHED}: {verdict.reason}. The simulation differs most {location_text(diagnosis)}."
        if verdict.is_ambiguous:
            where = location_text(diagnosis)
            return f"Something is there {where}, and these recordings cannot name it: {verdict.reason}."
        return f"Something is missing {location_text(diagnosis)}: {verdict.reason}."
    fit = diagnosis.fit
    effects = zip(fit.terms, fit.candidates, diagnosis.verdicts)
    sentences = [sentence for effect in effects for sentence in _effect_sentences(diagnosis, *effect)]
    return " ".join(
        [*sentences, f"But {verdict.reason}."] if verdict.answer == "named" and verdict.reason else sentences
    )


def _effect_sentences(diagnosis: Diagnosis, term: Any, candidate: Candidate, verdict: Verdict) -> Iterator[str]:
    """What the simulation lacks, and what may be there instead."""
    yield f"The simulation lacks an effect: {term.sentence()}{_sizes(diagnosis, candidate)}."
    if candidate.site.rival_axles:
        yield f"Or wheel {' or '.join(map(str, candidate.site.rival_axles))} has it."
    if verdict.answer == "a_or_b":
        yield f"Or {verdict.names[1].replace('_', ' ')}: these recordings cannot distinguish them."


def _sizes(diagnosis: Diagnosis, candidate: Candidate) -> str:
    """The fitted parameters of an effect with their 95 % intervals, in brackets."""
    part = diagnosis.fit.part(candidate)
    texts = []
    for p, value, se in zip(candidate.parameters, diagnosis.fit.psi[part], diagnosis.fit.psi_se[part]):
        estimate, limits = parameter_estimate(candidate.family, p.name, float(value), float(se), p.unit)
        texts.append(f"{p.name} {estimate}" + (f", 95 % interval {limits}" if limits else ""))
    return f" ({'; '.join(texts)})" if texts else ""


def location_text(diagnosis: Diagnosis) -> str:
    """Location of the missing effect in words, else the frames in which the residual is concentrated.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the engine.

    Returns
    -------
    str
    """
    if diagnosis.where is not None:
        return str(diagnosis.where)
    frames = [f for f in diagnosis.frames if f.q < FALSE_DISCOVERY_RATE]
    if not frames:
        return "at no position, sensor or train in particular"
    return ", ".join(
        f"at {f.frame} {f.level} ({f.effect:+z.1f} dB, false discovery rate {f.q:.3f})" for f in frames[:2]
    )


def recommendation(diagnosis: Diagnosis) -> str:
    """What to check on site, or which measurement would decide.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the engine.

    Returns
    -------
    str
        "" where nothing has to be done.
    """
    verdict, effects = diagnosis.verdict, physics.effects_by_name()
    if verdict.answer == "named":
        return effects[verdict.names[0]].site_check if verdict.names[0] in effects else GENERAL_CHECK
    if verdict.answer == "a_or_b":
        tests = (effects[name].separating_test for name in verdict.names[:2] if name in effects)
        return f"Measure {next(filter(None, tests), GENERAL_TEST)}"
    if verdict.answer == "unknown":
        if verdict.cause == "all trains":
            return FILES_CHECK
        return f"{FILES_CHECK}; measure {GENERAL_TEST}" if OFF_FILE in verdict.trail else f"Measure {GENERAL_TEST}"
    return ""


def finding_row(diagnosis: Diagnosis, identity: Mapping[str, Any]) -> dict[str, Any]:
    """Row of ``mismatch_findings``.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the engine.
    identity : mapping
        finding_id, turnout_id, section_id, found_at_utc and result_id.

    Returns
    -------
    dict
        Column -> value.
    """
    verdict, check = diagnosis.verdict, diagnosis.verification
    term = next(iter(diagnosis.fit.candidates), None) if verdict.answer in ("named", "a_or_b") else None
    where = term.where if term else location_fields(diagnosis.where)
    locked = term.frame if term else where.get("frame")
    return {
        **identity,
        "verdict": verdict.answer,
        "grade": verdict.grade or None,
        "term": verdict.names[0] if verdict.names else None,
        "rival_term": verdict.names[1] if len(verdict.names) > 1 else None,
        "locked_to": locked,
        **_position(diagnosis, term, where),
        "channel": where.get("sensor"),
        "band_low_hz": None,
        "band_high_hz": None,
        "probability": round(diagnosis.probability, 4),
        "p_value": next((f.q for f in diagnosis.frames if f.frame == locked and _is_at_finding(f.level, where)), None),
        "fit_before_pct": _finite(check.before),
        "fit_after_pct": _finite(check.after),
        "fit_rival_pct": _finite(check.rival),
        "fit_decoy_pct": _finite(check.decoy),
        "fit_gain_se_pct": _finite(check.total_error),
        "n_held_out": check.n,
        "parameters_json": json.dumps(fitted_parameters(diagnosis), sort_keys=True) if term else None,
        "train": train_text(where),
        "axle": int(where["axle"]) if where.get("train") and where.get("axle") else None,
        "sentence": sentence(diagnosis),
        "next_measurement": recommendation(diagnosis) or None,
    }


def train_text(where: Mapping[str, Any]) -> str | None:
    """Train and axle of a location in words, None without a train.

    Parameters
    ----------
    where : mapping
        Position, sensor, train or axle.

    Returns
    -------
    str or None
        None without a train.
    """
    if not where.get("train"):
        return None
    return f"{where['train']}, axle {where['axle']}" if where.get("axle") else where["train"]


def location_fields(location: Location | None) -> dict[str, Any]:
    """Frame, position with standard error, sensor, train and axle of the location of a residual, {} of None.

    Parameters
    ----------
    location : Location or None
        Of the residual.

    Returns
    -------
    dict
        {} without a location.
    """
    if location is None:
        return {}
    columns: dict[str, Any] = {"frame": location.frame, "sensor": location.sensor}
    columns |= {"train": location.train, "axle": location.axle}
    if location.place is not None:  # an interval of 95 %, not below one bay to either side
        assert location.low is not None and location.high is not None
        columns |= {"place": location.place, "place_se": max(location.high - location.low, 2.0 * SUPPORT_SPACING) / 4.0}
    return columns


def fitted_parameters(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Name, value, standard error and unit of each fitted parameter.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the engine.

    Returns
    -------
    list of dict
    """
    fitted = [(c, p) for c in diagnosis.fit.candidates for p in c.parameters]
    values = zip(fitted, diagnosis.fit.psi, diagnosis.fit.psi_se)
    return [
        {"term": c.family, "name": p.name, "value": float(f"{v:.6g}"), "se": float(f"{se:.3g}"), "unit": p.unit}
        for (c, p), v, se in values
    ]


def _position(diagnosis: Diagnosis, term: Candidate | None, where: Mapping[str, Any]) -> dict[str, Any]:
    """Position [m] and its standard error; a fitted ``shift`` from the scanned position is added."""
    position, se = where.get("place"), where.get("place_se")
    names = [p.name for p in term.parameters] if term else []
    if term is not None and position is not None and (ends := diagnosis.possible_positions[0]) is not None:
        se = max(position - ends[0], ends[1] - position) / 2.0
    if term is not None and position is not None and "shift" in names:
        k = diagnosis.fit.part(term).start + names.index("shift")
        position, se = round(float(position + diagnosis.fit.psi[k]), 3), float(f"{diagnosis.fit.psi_se[k]:.3g}")
    return {"position_m": position, "position_se_m": se}


def _is_at_finding(level: Any, where: Mapping[str, Any]) -> bool:
    """Whether the level of a frame is at the finding; True for a finding without position, sensor and train.

    >>> [_is_at_finding("12.0", {"place": position}) for position in (12.2, 18.0)]
    [True, False]
    >>> _is_at_finding("A1", {"sensor": "A2"})
    False
    """
    if where.get("place") is not None:
        try:
            return abs(float(level) - where["place"]) <= MAX_CELL_DISTANCE
        except ValueError:
            return False
    names = (where.get("sensor"), where.get("train"), train_text(where))
    return str(level) in names or not any(names)


def _finite(value: float | None) -> float | None:
    return None if value is None or value != value else round(float(value), 2)
