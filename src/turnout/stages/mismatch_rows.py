"""Registry rows of a diagnosis: the finding with its notes and evidence, its parameters and curves."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.evidence import is_at_control_level
from turnout.mismatch.turnout.unproven_panels import as_unproven
from turnout.registry.ids import content_id
from turnout.stages.accepted_effects import describe_term
from turnout.stages.finding_row import finding_row
from turnout.stages.mismatch_curves import (
    band_of,
    band_of_impacts,
    best_comparison,
    channel_comparisons,
    curve_rows,
    reach_of,
)
from turnout.stages.mismatch_text import headline, requirements_in_words, surface_sentence
from turnout.stages.parameter_text import interval
from turnout.stages.possible_effect import agreement_sentence, scope_of_agreement, sentence_on_possible_effect
from turnout.stages.values_off_file import sentences_on_values
from turnout.stages.visit_notes import texts_of_notes

if TYPE_CHECKING:
    from turnout.mismatch.engine.diagnose import Diagnosis
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.verdict import Verdict
    from turnout.mismatch.turnout.campaign import CampaignInput
    from turnout.mismatch.turnout.case import TrackCase
    from turnout.stages.mismatch_groups import Group

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
    row["sentence"] = _sentence(diagnosis, case, row, len(group.campaign.passages))
    ambiguity = case.ambiguity() if diagnosis.verdict.is_ambiguous else None
    if ambiguity:
        row["next_measurement"] = f"Measure {ambiguity.measurement}"
    if case.reservation:
        row = as_unproven(row, case.reservation)
    key = {"finding_id": row["finding_id"], "turnout_id": row["turnout_id"]}
    return {
        "mismatch_findings": [row],
        "mismatch_parameters": parameter_rows(diagnosis, case, row),
        "mismatch_curves": curve_rows(case, diagnosis, comparison, key),
    }


def _sentence(diagnosis: Diagnosis, case: TrackCase, row: Mapping[str, Any], n_recorded: int) -> str:
    """The finding in words, with what follows from the values of the fit and what these recordings cannot show."""
    surface = (surface_sentence(s) for s in surface_estimates(case, diagnosis.fit))
    channels = [f"{note}." for faults in case.data.layout_faults for note in faults.sentences()]
    values = [*filter(None, surface), *sentences_on_values(case.nuisances, diagnosis.fit)]
    if row["verdict"] != "none":
        return " ".join([headline(row), *channels, *values])
    possible = sentence_on_possible_effect(diagnosis.verdict, case, row)
    limits = requirements_in_words(case.unmet_requirements)
    agreement = agreement_sentence(headline(row), bool(values))
    agreement = scope_of_agreement(agreement, row["n_passages"], n_recorded)
    return " ".join([agreement, *channels, *filter(None, [*values, possible, limits])])


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
        describe_term(t, c, se, case.predictor.track()) | _term_evidence(v) | _possible_positions(ends)
        for t, c, se, v, ends in zip(
            fit.terms, fit.candidates, _errors_by_candidate(fit), diagnosis.verdicts, diagnosis.possible_positions
        )
    ]
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
        "evidence_json": json.dumps(_evidence(diagnosis, case), sort_keys=True),
        "notes": "\n".join(_first_notes([*dict.fromkeys([*case.notes, *_visit_notes(about, campaign)])])) or None,
    }


def _first_notes(notes: Sequence[str]) -> list[str]:
    """The first ``MAX_NOTES`` notes and the number of others."""
    more = len(notes) - MAX_NOTES
    return [*notes[:MAX_NOTES], *([f"and {more} more"] if more > 0 else [])]


def _visit_notes(about: Mapping[str, Any], campaign: CampaignInput) -> list[str]:
    """Notes of the visit as texts, those on passages of other groups last."""
    names = {None, *(p.name for p in campaign.passages)}
    first, last = ([n for n in about["notes"] if (n.passage in names) == in_group] for in_group in (True, False))
    return texts_of_notes(first) + texts_of_notes(last)


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


def _possible_positions(ends: tuple[float, float] | None) -> dict:
    """First and last position that a term may have, where that is more than one."""
    return {"possible_positions": list(ends)} if ends is not None else {}


def _evidence(diagnosis: Diagnosis, case: TrackCase) -> dict:
    """Frames, the evidence of each verdict (of further effects under ``beside``), and what was not examined."""
    frames = [
        {"frame": f.frame, "level": str(f.level), "effect_db": _plain(f.effect), "q": _plain(f.q), "n": f.n}
        for f in diagnosis.frames[:6]
    ]
    first, *further = (_verdict_evidence(v) for v in diagnosis.verdicts)
    unexamined = [
        {"effect": u.effect, "what": u.words, "lack": u.lack, "measurement": u.measurement}
        for u in case.unmet_requirements
    ]
    return {"frames": frames, **first, "beside": further, "not_examined": unexamined}


def _verdict_evidence(verdict: Verdict) -> dict:
    """Probabilities, ranking of rivals, and evidence [nats] by condition."""
    top_scores = verdict.scores[:4]
    return {
        "term": verdict.names[0] if verdict.names else None,
        "probability": _plain(verdict.probability),
        "reason": verdict.reason,
        "is_finished": verdict.is_finished,
        "is_ambiguous": verdict.is_ambiguous,
        "cause": verdict.cause,
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
