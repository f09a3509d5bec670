"""Registry rows of a diagnosis: the finding with its sentence and recommendation, its parameters and curves."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout import physics
from turnout.mismatch.engine.evidence import is_at_control_level
from turnout.mismatch.turnout.unproven_panels import as_unproven
from turnout.registry.ids import content_id
from turnout.stages.accepted_effects import describe_term
from turnout.stages.mismatch_curves import (
    band_of,
    band_of_impacts,
    best_comparison,
    channel_comparisons,
    curve_rows,
    reach_of,
)
from turnout.stages.mismatch_text import UNFINISHED, headline, interval, surface_sentence
from turnout.stages.values_off_file import sentences_on_values

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.diagnose import Diagnosis
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.localization import Location
    from turnout.mismatch.engine.verdict import Verdict
    from turnout.mismatch.turnout.campaign import CampaignInput
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.stages.mismatch_groups import Group

MAX_CELL_DISTANCE = 0.3  # m: a cell of the residual closer than this is at the finding
FALSE_DISCOVERY_RATE = 0.05  # expected share of false ones among the frames reported
SUPPORT_SPACING = 0.6  # m between supports
GENERAL_CHECK = "Inspect the track at this position; repeat the measurement after the work"
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
        if not verdict.is_finished:
            return f"{UNFINISHED}: {verdict.reason}. The simulation differs most {location_text(diagnosis)}."
        return f"Something is missing {location_text(diagnosis)}: {verdict.reason}."
    sentences = []
    for term, term_verdict in zip(diagnosis.fit.terms, diagnosis.verdicts):
        sentences.append(f"What the model left out: {term.sentence()}.")
        if term_verdict.answer == "a_or_b":
            sentences.append(f"Or {term_verdict.names[1].replace('_', ' ')}: these recordings cannot distinguish them.")
    return " ".join(
        [*sentences, f"But {verdict.reason}."] if verdict.answer == "named" and verdict.reason else sentences
    )


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
    return ", ".join(f"at {f.frame} {f.level} ({f.effect:+.1f} dB, q = {f.q:.3f})" for f in frames[:2])


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
    return f"Measure {GENERAL_TEST}" if verdict.answer == "unknown" else ""


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
    if location.place is not None:  # an interval of 95 %, not below half a bay
        assert location.low is not None and location.high is not None
        columns |= {"place": location.place, "place_se": max(location.high - location.low, SUPPORT_SPACING) / 4.0}
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


MAX_NOTES = 12


def finding_tables(
    diagnosis: Diagnosis, case: TrackCase, group: Group, about: Mapping[str, Any]
) -> dict[str, list[dict]]:
    """Rows by table of one group's diagnosis.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the engine.
    case : TrackCase
        The case that was diagnosed.
    group : Group
        Its sections.
    about : mapping
        turnout, visit, identity (content id) and notes.

    Returns
    -------
    dict
        Table -> rows.
    """
    identity = _identity(group, about, case)
    comparison = (
        best_comparison(channel_comparisons(case, diagnosis), case, diagnosis) if case.aligned_passages else None
    )
    changed = diagnosis.fit is not diagnosis.base
    row = finding_row(diagnosis, {**identity, "result_id": ""})
    row.pop("result_id")
    band, reach = band_of_impacts(case, diagnosis) or band_of(comparison, changed), reach_of(comparison, changed)
    low, high = band or (row["band_low_hz"], row["band_high_hz"])
    row |= {"band_low_hz": low, "band_high_hz": high, "wheel_within_m": reach}
    row |= _summary_columns(diagnosis, case, group, about)
    of_surface = map(surface_sentence, surface_estimates(case, diagnosis.fit))
    of_values = sentences_on_values(case.nuisances, diagnosis.fit)
    row["sentence"] = " ".join(filter(None, [headline(row), *of_surface, *of_values]))
    if case.reservation:
        row = as_unproven(row, case.reservation)
    key = {"finding_id": row["finding_id"], "turnout_id": row["turnout_id"]}
    return {
        "mismatch_findings": [row],
        "mismatch_parameters": parameter_rows(diagnosis, case, row),
        "mismatch_curves": curve_rows(case, diagnosis, comparison, key),
    }


def _identity(group: Group, about: Mapping[str, Any], case: TrackCase) -> dict[str, Any]:
    turnout = about["turnout"]
    section_id = turnout.section_id(group.labels[0]) if len(group.labels) == 1 else None
    return {
        "finding_id": content_id("finding", turnout.id, about["visit"], *group.labels, about["identity"]),
        "turnout_id": turnout.id,
        "section_id": section_id,
        "found_at_utc": _newest(group.campaign, about),
    }


def _newest(campaign: CampaignInput, about: Mapping[str, Any]) -> datetime:
    """Time of the newest recording, else of the visit."""
    recordings = [r for t in campaign.hammer for r in t.recordings] + [p.recording for p in campaign.passages]
    times = [r.started_at for r in recordings if r.started_at]
    if times:
        return max(times)
    visit = about["visit"]
    return datetime.fromisoformat(visit if len(visit) > 7 else f"{visit}-01")


def _summary_columns(diagnosis: Diagnosis, case: TrackCase, group: Group, about: Mapping[str, Any]) -> dict:
    campaign, fit = group.campaign, diagnosis.fit
    positions = [s.place for s in campaign.sensors] + [t.place for t in campaign.hammer]
    terms = [
        describe_term(t, c, se, case.predictor.track()) | _term_evidence(v)
        for t, c, se, v in zip(fit.terms, fit.candidates, _errors_by_candidate(fit), diagnosis.verdicts)
    ]  # fmt: skip
    return {
        "visit": about["visit"],
        "sections": ", ".join(group.labels),
        "route": group.route,
        "place_low_m": min(positions),
        "place_high_m": max(positions),
        "n_hammer_tests": len(campaign.hammer),
        "n_passages": sum(o.data_type == "passage" for o in (*case.observations, *case.reserved)),
        "n_sensors": len(campaign.sensors),
        "level_before": float(max(diagnosis.base.level.values())),
        "level_after": float(max(fit.level.values())),
        "term_json": json.dumps(terms, sort_keys=True) if terms else None,
        "evidence_json": json.dumps(_evidence(diagnosis), sort_keys=True),
        "notes": "\n".join(_first_notes([*dict.fromkeys([*case.notes, *_visit_notes(about, campaign)])])) or None,
    }


def _first_notes(notes: Sequence[str]) -> list[str]:
    """The first ``MAX_NOTES`` notes and the number of others."""
    more = len(notes) - MAX_NOTES
    return [*notes[:MAX_NOTES], *([f"and {more} more"] if more > 0 else [])]


def _visit_notes(about: Mapping[str, Any], campaign: CampaignInput) -> list[str]:
    """Notes of the visit as texts, those on passages of other groups last."""
    names = {None, *(p.name for p in campaign.passages)}
    return [str(note) for note in sorted(about["notes"], key=lambda note: note.passage not in names)]


def _errors_by_candidate(fit: Fit) -> Iterator[np.ndarray]:
    """Standard errors of each candidate's parameters."""
    first, se = 0, fit.psi_se
    for candidate in fit.candidates:
        yield se[first : first + len(candidate.parameters)]
        first += len(candidate.parameters)


def _term_evidence(verdict: Verdict) -> dict:
    """Probability of a term, and the other effect of an "a_or_b" verdict."""
    alternative = {"or": verdict.names[1]} if len(verdict.names) > 1 else {}
    return {"probability": _plain(verdict.probability), **alternative}


def _evidence(diagnosis: Diagnosis) -> dict:
    """Frames, and the evidence of each verdict: of the first effect, and of further ones under ``beside``."""
    frames = [
        {"frame": f.frame, "level": str(f.level), "effect_db": _plain(f.effect), "q": _plain(f.q), "n": f.n}
        for f in diagnosis.frames[:6]
    ]
    first, *further = (_verdict_evidence(v) for v in diagnosis.verdicts)
    return {"frames": frames, **first, "beside": further}


def _verdict_evidence(verdict: Verdict) -> dict:
    """Probabilities, ranking of rivals, and evidence [nats] by condition."""
    top_scores = verdict.scores[:4]
    return {
        "term": verdict.names[0] if verdict.names else None,
        "probability": _plain(verdict.probability),
        "reason": verdict.reason,
        "is_finished": verdict.is_finished,
        "posterior": {k: _plain(v) for k, v in _largest(verdict.posterior)},
        "ranking": [{"family": s.family, "nats": _plain(s.gain), "explained": _plain(s.explained)} for s in top_scores],
        "by_condition": {k: _plain(v) for k, v in top_scores[0].by_condition.items()} if top_scores else {},
    }


def _largest(posterior: Mapping[str, float]) -> list[tuple[str, float]]:
    return sorted(posterior.items(), key=lambda item: -item[1])[:6]


def _plain(value: float) -> float | None:
    return float(f"{value:.5g}") if np.isfinite(value) else None


def parameter_rows(diagnosis: Diagnosis, case: TrackCase, row: Mapping[str, Any]) -> list[dict]:
    """Rows of ``mismatch_parameters``.

    They hold the new terms, and the present estimates of the track file: accepted effects and uncertain numbers of the
    running surface.

    Parameters
    ----------
    diagnosis : Diagnosis
        Result of the engine.
    case : TrackCase
        The case that was diagnosed.
    row : mapping
        Its row of ``mismatch_findings``.

    Returns
    -------
    list of dict
    """
    base = {k: row[k] for k in ("finding_id", "turnout_id", "found_at_utc")}
    rows = []
    for term in json.loads(row["term_json"] or "[]"):
        position = _mean_position(term["fixed"])
        for name, p in term["parameters"].items():
            channel = term["fixed"].get("channel_name")
            rows.append(_parameter_row(term["term"], position, channel, name, p["value"], p["se"], p["unit"], False))
    for v in case.accepted.estimates(case.nuisances, diagnosis.fit):
        a = v["accepted"]
        channel = a.fixed.get("channel_name")
        rows.append(_parameter_row(a.family, a.place, channel, v["name"], v["value"], v["se"], v["unit"], True))
    for s in surface_estimates(case, diagnosis.fit):
        rows.append(_parameter_row(s["term"], s["place"], None, s["name"], s["value"], s["se"], s["unit"], True))
    return [{**base, "parameter_no": k, **r} for k, r in enumerate(rows)]


def surface_estimates(case: TrackCase, fit: Fit) -> list[dict]:
    """Estimates of uncertain numbers of the running surface in the track's file.

    A fit that leaves more of the passages than intact track does is no measurement of them: what is missing in the
    model has moved these numbers.

    Parameters
    ----------
    case : TrackCase
        The case.
    fit : Fit
        Of the case.

    Returns
    -------
    list of dict
        As those of ``SurfaceParameter.estimate``; [] for such a fit.
    """
    surface = case.predictor.site.surface
    return list(surface.estimate(case, fit)) if surface and is_at_control_level(case, fit, "passage") else []


def _mean_position(fixed: Mapping[str, Any]) -> float | None:
    positions = [fixed[k] for k in ("sleeper", "support", "first", "last", "place") if k in fixed]
    return float(np.mean(positions)) if positions else None


def _parameter_row(
    term: str,
    position: float | None,
    channel: str | None,
    name: str,
    value: float,
    se: float | None,
    unit: str,
    accepted: bool,
) -> dict[str, Any]:
    error = float(se) if se is not None and np.isfinite(se) else None
    low, high = (None, None) if error is None else interval(term, name, float(value), error)
    return {
        "term": term,
        "position_m": position,
        "channel": channel,
        "parameter": name,
        "value": float(value),
        "value_se": error,
        "value_low": low,
        "value_high": high,
        "unit": unit,
        "accepted": bool(accepted),
    }
