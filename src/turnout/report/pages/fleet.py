"""Render the first page: tomorrow's worklist, one line per turnout, and what was not used."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from turnout.reasons import REASONS
from turnout.registry.as_of import chart_in_words
from turnout.report.formatting import (
    STIFFNESS_NOTE,
    badge,
    campaign_of,
    diagnoses_once,
    has_stiffness,
    result_and_evidence,
)
from turnout.report.panels.diagram import HATCH
from turnout.report.panels.lines import line_diagrams
from turnout.report.source import BASELINE

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence
    from typing import Any

    from jinja2 import Template

    from turnout.report.source import FleetSource

# The short-term alert of a turnout, the most urgent first.
STATES = (
    "confirm now",
    "inspect this week",
    "plan",
    "learning",
    "cannot tell",
    "not measured",
    "suppressed",
    "ok",
)
NO_CHART = "no chart yet"
ALWAYS_COUNTED = ("inspect this week", "plan", "ok")
# What a chart follows -> its words, for one and for several
CHART_KINDS = {
    "resonance": ("frequency of a resonance", "frequencies of resonances"),
    "damping": ("damping ratio", "damping ratios"),
    "amplitude": ("amplitude under trains", "amplitudes under trains"),
    "whole turnout": ("of a whole turnout", "of whole turnouts"),
}


def fleet_page(source: FleetSource, template: Template, shared: Mapping[str, Any]) -> str:
    """HTML of the fleet's page.

    Parameters
    ----------
    source : FleetSource
        Rows of the fleet.
    template : Template
        Compiled page.
    shared : mapping
        Variables that every page shows.

    Returns
    -------
    str
        HTML.
    """
    turnouts, worklist, reasons = source.turnouts(), source.worklist(), source.reasons()
    charts: dict[str, dict[str, int]] = {}
    for row in source.states():
        charts.setdefault(row["turnout_id"], {})[row["state"]] = row["n"]
    listed: dict[str, set[str]] = {}
    for row in source.listed_states():
        listed.setdefault(row["turnout_id"], set()).add(row["state"])
    scores = {row["turnout_id"]: row for row in source.scores()}
    of_charts: Counter[str] = Counter()
    for states in charts.values():
        of_charts.update(states)
    lines = [
        _line(t, charts.get(t["turnout_id"], {}), listed.get(t["turnout_id"], set()), scores.get(t["turnout_id"]))
        for t in turnouts
    ]
    return template.render(
        n_turnouts=len(turnouts),
        n_sections=sum(t["n_sections"] for t in turnouts),
        today=source.day.split("'")[1][:10],
        latest=campaign_of(max((t for t in turnouts if t["latest"]), key=lambda t: t["latest"], default={}), "latest"),
        cards=_cards(lines),
        n_quarantined=sum(r["rows"] for r in reasons),
        worklist=[_work(w, diagnosis) for w, diagnosis in zip(worklist, diagnoses_once(worklist))],
        has_stiffness=has_stiffness(worklist),
        stiffness_note=STIFFNESS_NOTE,
        n_more=worklist[0]["n_in_all"] - len(worklist) if worklist else 0,
        n_charts=of_charts.total(),
        charts=[f"{of_charts[state]} {state}" for state in STATES if of_charts[state]],
        n_within=of_charts["ok"],
        n_suppressed=of_charts["suppressed"],
        n_unmeasured=of_charts["not measured"],
        learning=source.learning(),
        kinds=[f"{k['n']} {CHART_KINDS[k['kind']][k['n'] != 1]}" for k in source.chart_kinds()],
        n_baseline=BASELINE.baseline_campaigns,
        n_baseline_days=round(BASELINE.baseline_days),
        diagrams=line_diagrams(lines),
        hatch=HATCH,
        turnouts=sorted(lines, key=lambda t: (t["urgency"], -t["score"], t["turnout_id"])),
        reasons=[r | {"meaning": REASONS.get(r["reason"], "")} for r in reasons],
        **shared,
    )


def _cards(lines: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Number of turnouts by their most urgent state: each turnout counts once. The first states are always shown."""
    counts = Counter(line["worst"] for line in lines)
    shown = [s for s in (*STATES, NO_CHART) if counts[s] or s in ALWAYS_COUNTED]
    return [{"state": state, "n": counts[state], "badge": badge(state)} for state in shown]


def _work(row: Mapping[str, Any], diagnosis: str) -> dict[str, Any]:
    """One row of the list; of a diagnosis the first clause, the page of the turnout has all of it."""
    return {
        "turnout_id": row["turnout_id"],
        "label": row["sections"],
        "anchor": (row["section_id"] or "").split("/")[-1].replace("*", ""),
        "component": chart_in_words(row["component"]),
        "state": row["state"],
        "badge": badge(row["state"]),
        "what": row["sentence"],
        "diagnosis": result_and_evidence(diagnosis)[0],
        "how_sure": row["false_alarm_words"],
        "maintenance": row["last_maintenance"] or "none known",
        "look_at": row["look_at"],
    }


def _line(
    turnout: dict[str, Any],
    charts: Mapping[str, int],
    listed: Collection[str],
    score: Mapping[str, Any] | None,
) -> dict[str, Any]:
    """One turnout of the table: the most urgent state of its charts and its rows of the worklist, and its score."""
    worst = next((state for state in STATES if state in charts or state in listed), NO_CHART)
    urgency = [*STATES, NO_CHART].index(worst)
    return turnout | {
        "urgency": urgency,
        "worst": worst,
        "badge": badge(worst),
        "score": score["score"] if score else 0.0,
        "score_text": f"{score['score']:.0f}" if score else "–",
        "score_of": f"{score['section_id'].split('/')[-1]} {score['band']}" if score and score["score"] >= 0.5 else "",
        "name": turnout["name"] or "",
        "km_text": "" if turnout["km"] is None else f"{turnout['km']:.3f}",
        "latest": campaign_of(turnout, "latest"),
        "states": ", ".join(f"{charts[s]} {s}" for s in STATES if s in charts) or "–",
    }
