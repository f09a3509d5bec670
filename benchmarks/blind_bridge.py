"""One case of a blind set -> finding rows, by the diagnosis as a library: all visits together, and lesser tools.

    turnout blind diagnose --out proof --command "{python} -m benchmarks.blind_bridge {folder} {case} {out}"
    turnout blind diagnose --out proof --ablation in_sample \\
        --command "{python} -m benchmarks.blind_bridge {folder} {case} {out} --lesser in_sample"

Reads FOLDER/config and FOLDER/raw as any user's; neither truth nor generator. Run it with the checkout on PYTHONPATH.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from turnout.config.campaign_notes import with_raw
from turnout.config.load import load_configuration
from turnout.config.settings.mismatch import MismatchSettings
from turnout.mismatch.engine.candidate_search import shortlist
from turnout.mismatch.engine.diagnose import diagnose
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.search import Search
from turnout.mismatch.turnout.case import TrackCase
from turnout.stages.finding_row import location_fields
from turnout.stages.mismatch_groups import groups
from turnout.stages.mismatch_inputs import gather_inputs
from turnout.stages.track_files import track_of
from turnout.workflow.scan import scan

LESSER_TOOLS = {
    "in_sample": "names by the fit to what was fitted, not by conditions left out",
    "score_test": "names by the score test on the fitted base model, nothing refitted",
    "single_start": "every term is refitted from its first start alone",
    "no_materiality": "differences of half a percent count",
    "hammer_only": "hammer tests alone",
    "passages_only": "passages alone",
}


def campaigns_of(folder, case):
    """Campaigns for the engine, one per group of neighbouring sections, over all visits of a case."""
    folder = Path(folder)
    raw = folder / "raw"
    turnout = with_raw(load_configuration(folder / "config").turnout(case), raw)
    track, _ = track_of(turnout)
    gathered = gather_inputs(scan(turnout, raw).units, turnout, raw, track, {})
    return [group.campaign for group in groups(turnout, track, gathered)]


def case_of(campaign, settings=None, lesser=None):
    """(``TrackCase``, settings) of a campaign, reduced as ``lesser`` says."""
    settings = settings or MismatchSettings()
    if lesser == "no_materiality":
        settings = replace(settings, materiality=0.005, pair_tolerance=0.005)
    if lesser == "hammer_only":
        campaign = replace(campaign, passages=(), reserved=tuple(t.name for t in campaign.hammer[-1:]))
    if lesser == "passages_only":
        campaign = replace(campaign, hammer=())
    case = TrackCase(campaign, settings)
    if lesser == "single_start":
        case.candidates = tuple(replace(c, refit=replace(c.refit, points=c.starts[:1])) for c in case.candidates)
    return case, settings


def finding_rows(folder, case, lesser=None):
    """Finding rows of all groups, one per effect, or one "none"."""
    result = []
    for campaign in campaigns_of(folder, case):
        track_case, settings = case_of(campaign, lesser=lesser)
        result += (
            _by_score_test(track_case, settings)
            if lesser == "score_test"
            else _by_diagnosis(track_case, settings, lesser)
        )
    return result


def _by_diagnosis(case, settings, lesser):
    diagnosis = diagnose(case, settings)
    if lesser != "in_sample" or not diagnosis.verdict.scores:
        return rows_of(diagnosis)
    best_score = min(diagnosis.verdict.scores, key=lambda s: s.fit.cost)
    gain = 0.5 * (diagnosis.base.cost - best_score.fit.cost) - len(best_score.candidate.parameters)
    if gain <= settings.threshold:
        return [_row("none", None, None, diagnosis.verification)]
    return [_row("named", best_score.candidate, best_score.fit, diagnosis.verification)]


def _by_score_test(case, settings):
    """Row of the first candidate of the shortlist, if the residual exceeds the control level."""
    base = fit_jointly(case, iterations=settings.base_iterations)
    plan = shortlist(Search(case, settings), base)
    if not plan or max(base.level.values()) <= settings.control_level:
        return [_row("none", None, None, None)]
    return [_row("named", plan[0].candidate, None, None)]


def rows_of(diagnosis):
    """Finding rows of a diagnosis."""
    result = []
    for verdict in diagnosis.verdicts:
        candidate = verdict.scores[0].candidate if verdict.scores and verdict.names else None
        row = _row(verdict.answer, candidate, diagnosis.fit, diagnosis.verification, diagnosis.where)
        frame = diagnosis.frames[0].frame if diagnosis.frames else None
        result.append(
            row
            | {
                "grade": verdict.grade or None, "rival_term": verdict.names[1] if len(verdict.names) > 1 else None,
                "locked_to": row["locked_to"] or frame, "probability": verdict.probability, "sentence": verdict.reason,
            }
        )  # fmt: skip
    return result


def _row(verdict, candidate, fit, verification, location=None):
    where = dict(candidate.where) if candidate else location_fields(location) if verdict == "unknown" else {}
    parameters = fit.part(candidate) if candidate and fit else None
    values = zip(candidate.parameters, fit.psi[parameters], fit.psi_se[parameters]) if parameters else ()
    numbers = {p.name: {"value": float(v), "se": float(s), "unit": p.unit} for p, v, s in values}
    fits = {
        f"fit_{name}_pct": _number(getattr(verification, name, None)) for name in ("before", "after", "rival", "decoy")
    }
    return {
        "verdict": verdict, "term": candidate.family if candidate else None,
        "locked_to": candidate.frame if candidate else where.get("frame"), "position_m": where.get("place"),
        "channel": where.get("sensor"), **fits, "n_held_out": getattr(verification, "n", 0),
        "parameters_json": json.dumps({**numbers, "where": {k: _plain(v) for k, v in where.items()}}),
    }  # fmt: skip


def _plain(value):
    return value.item() if isinstance(value, np.generic) else value


def _number(value):
    return None if value is None or value != value else float(value)


def main():
    """Diagnose and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("case")
    parser.add_argument("out")
    parser.add_argument("--lesser", choices=sorted(LESSER_TOOLS), help="a poorer tool, for the ablations")
    args = parser.parse_args()
    result = finding_rows(args.folder, args.case, args.lesser)
    Path(args.out).write_text(json.dumps(result, indent=1) + "\n")
    print(", ".join(f"{r['verdict']} {r['term'] or ''}".strip() for r in result))


if __name__ == "__main__":
    main()
