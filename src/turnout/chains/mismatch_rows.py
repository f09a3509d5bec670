"""A diagnosis as rows of the registry: the finding, its parameters, the curves that show it."""

import json
from datetime import datetime

import numpy as np

from turnout.chains.accepted_terms import described
from turnout.chains.guided_case import visit_of
from turnout.chains.mismatch_curves import band_of, band_of_blows, best_shown, curve_rows, passages_shown, reach_of
from turnout.chains.mismatch_words import headline, interval, otherwise
from turnout.registry.ids import content_id
from turnout.stages.mismatch_rows import finding_row

NOTES_KEPT = 12


def finding_tables(found, case, group, about) -> dict[str, list[dict]]:
    """Rows by table of one group's diagnosis; ``about`` holds turnout, visit, identity (content id), notes."""
    identity = _identity(group, about, case)
    shown = best_shown(passages_shown(case, found), case, found) if case.rollings else None
    changed = found.fit is not found.base
    row = finding_row(found, {**identity, "result_id": ""})
    row.pop("result_id")
    band, reach = band_of_blows(case, found) or band_of(shown, changed), reach_of(shown, changed)
    low, high = band or (row["band_low_hz"], row["band_high_hz"])
    row |= {"band_low_hz": low, "band_high_hz": high, "wheel_within_m": reach}
    row |= _numbers(found, case, group, about)
    row["sentence"] = " ".join(filter(None, [headline(row), *map(otherwise, surface_told(case, found.fit))]))
    key = {"finding_id": row["finding_id"], "turnout_id": row["turnout_id"]}
    return {
        "mismatch_findings": [row],
        "mismatch_parameters": parameter_rows(found, case, row),
        "mismatch_curves": curve_rows(case, found, shown, key),
    }


def _identity(group, about, case):
    turnout = about["turnout"]
    one = turnout.section_id(group.labels[0]) if len(group.labels) == 1 else None
    return {
        "finding_id": content_id("finding", turnout.id, about["visit"], *group.labels, about["identity"]),
        "turnout_id": turnout.id,
        "section_id": one,
        "found_at_utc": _newest(group.campaign, about),
    }


def _newest(campaign, about) -> datetime:
    """Time of the newest recording, else of the visit."""
    recordings = [r for t in campaign.hammer for r in t.recordings] + [p.recording for p in campaign.passages]
    times = [r.started_at for r in recordings if r.started_at]
    if times:
        return max(times)
    visit = about["visit"]
    return datetime.fromisoformat(visit if len(visit) > 7 else f"{visit}-01")


def _numbers(found, case, group, about) -> dict:
    campaign, fit = group.campaign, found.fit
    places = [s.place for s in campaign.sensors] + [t.place for t in campaign.hammer]
    terms = [
        described(t, c, se, case.track()) | _said_of(v)
        for t, c, se, v in zip(fit.terms, fit.candidates, _errors(fit), found.verdicts)
    ]  # fmt: skip
    return {
        "visit": about["visit"],
        "sections": ", ".join(group.labels),
        "route": group.route,
        "place_low_m": min(places),
        "place_high_m": max(places),
        "n_hammer_tests": len(campaign.hammer),
        "n_passages": sum(o.kind == "passage" for o in (*case.observations, *case.reserved)),
        "n_sensors": len(campaign.sensors),
        "level_before": float(max(found.base.level.values())),
        "level_after": float(max(fit.level.values())),
        "term_json": json.dumps(terms, sort_keys=True) if terms else None,
        "evidence_json": json.dumps(_evidence(found), sort_keys=True),
        "notes": "\n".join(_kept([*dict.fromkeys([*case.notes, *_of_visit(about, campaign)])])) or None,
    }


def _kept(notes):
    """The first notes, and how many more there are."""
    more = len(notes) - NOTES_KEPT
    return [*notes[:NOTES_KEPT], *([f"and {more} more"] if more > 0 else [])]


def _of_visit(about, campaign):
    """Notes of the visit, those on passages that this group has before those that say nothing of it."""
    mine = tuple(f"passage {p.name}: " for p in campaign.passages)
    return sorted(about["notes"], key=lambda note: not note.startswith(mine) if note.startswith("passage ") else False)


def _errors(fit):
    """Standard errors of each candidate's parameters."""
    first, se = 0, fit.psi_se
    for candidate in fit.candidates:
        yield se[first : first + len(candidate.parameters)]
        first += len(candidate.parameters)


def _said_of(verdict) -> dict:
    """Probability of a term of its own, and the family that it may be as well, if there is one."""
    other = {"or": verdict.names[1]} if len(verdict.names) > 1 else {}
    return {"probability": _plain(verdict.probability), **other}


def _evidence(found) -> dict:
    """Frames, and what each verdict rests on: that on the first effect, those on others ``beside`` it."""
    frames = [
        {"frame": f.frame, "level": str(f.level), "effect_db": _plain(f.effect), "q": _plain(f.q), "n": f.n}
        for f in found.frames[:6]
    ]
    first, *others = (_rests_on(v) for v in found.verdicts)
    return {"frames": frames, **first, "beside": others}


def _rests_on(verdict) -> dict:
    """Probabilities, rivals, and nats by condition."""
    best = verdict.scores[:4]
    return {
        "term": verdict.names[0] if verdict.names else None,
        "probability": _plain(verdict.probability),
        "reason": verdict.reason,
        "posterior": {k: _plain(v) for k, v in _largest(verdict.posterior)},
        "ranking": [{"family": s.family, "nats": _plain(s.gain), "explained": _plain(s.explained)} for s in best],
        "by_condition": {k: _plain(v) for k, v in best[0].by_condition.items()} if best else {},
    }


def _largest(posterior):
    return sorted(posterior.items(), key=lambda item: -item[1])[:6]


def _plain(value):
    return float(f"{value:.5g}") if np.isfinite(value) else None


def parameter_rows(found, case, row) -> list[dict]:
    """Rows of ``mismatch_parameters``: of what was found, and of what the track's file has, as it is now: effects that
    were accepted before, and uncertain numbers of the running surface."""
    base = {k: row[k] for k in ("finding_id", "turnout_id", "found_at_utc")}
    rows = []
    for term in json.loads(row["term_json"] or "[]"):
        place = _place(term["fixed"])
        for name, p in term["parameters"].items():
            channel = term["fixed"].get("channel_name")
            rows.append(_parameter(term["term"], place, channel, name, p["value"], p["se"], p["unit"], False))
    for v in visit_of(case, found.fit):
        a = v["accepted"]
        channel = a.fixed.get("channel_name")
        rows.append(_parameter(a.family, a.place, channel, v["name"], v["value"], v["se"], v["unit"], True))
    for s in surface_told(case, found.fit):
        rows.append(_parameter(s["term"], s["place"], None, s["name"], s["value"], s["se"], s["unit"], True))
    return [{**base, "parameter_no": k, **r} for k, r in enumerate(rows)]


def surface_told(case, fit) -> list[dict]:
    """What recordings say of uncertain numbers of the running surface in the track's file."""
    surface = getattr(case, "surface", None)
    return list(surface.told(case, fit)) if surface else []


def _place(fixed):
    places = [fixed[k] for k in ("sleeper", "support", "first", "last", "place") if k in fixed]
    return float(np.mean(places)) if places else None


def _parameter(term, place, channel, name, value, se, unit, accepted):
    known = se is not None and np.isfinite(se)
    low, high = interval(term, name, float(value), se) if known else (None, None)
    return {
        "term": term,
        "position_m": place,
        "channel": channel,
        "parameter": name,
        "value": float(value),
        "value_se": float(se) if known else None,
        "value_low": low,
        "value_high": high,
        "unit": unit,
        "accepted": bool(accepted),
    }
