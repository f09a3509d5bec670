"""Render the first page: tomorrow's worklist, one line per turnout, and what was not used."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from turnout.errors import REASONS
from turnout.report.formatting import badge, day

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from jinja2 import Template

    from turnout.report.source import FleetSource

STATES = {
    "confirm now": "confirm_now",
    "inspect this week": "inspect",
    "plan": "plan",
    "learning": "learning",
    "cannot tell": "cannot_tell",
    "not measured": "not_measured",
    "suppressed": "suppressed",
    "ok": "ok",
}
LISTED_STATES = ("confirm now", "inspect this week", "plan", "learning", "cannot tell")


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
    states: dict[str, dict[str, int]] = {}
    counts: Counter[str] = Counter()
    for row in source.states():
        states.setdefault(row["turnout_id"], {})[row["state"]] = row["n"]
        counts[row["state"]] += row["n"]
    listed = source.worklist_counts()
    totals = counts | {state: listed.get(state, 0) for state in LISTED_STATES}
    return template.render(
        n_turnouts=len(turnouts),
        n_sections=sum(t["n_sections"] for t in turnouts),
        today=source.day.split("'")[1][:10],
        latest=day(max((t["latest"] for t in turnouts if t["latest"]), default=None)),
        count={key: totals.get(state, 0) for state, key in STATES.items()},
        n_quarantined=sum(r["rows"] for r in reasons),
        worklist=[_work(w) for w in worklist],
        n_more=worklist[0]["n_in_all"] - len(worklist) if worklist else 0,
        n_charts=counts.total(),
        learning=source.learning(),
        turnouts=[_line(t, states.get(t["turnout_id"], {})) for t in turnouts],
        reasons=[r | {"meaning": REASONS.get(r["reason"], "")} for r in reasons],
        **shared,
    )


def _work(row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "turnout_id": row["turnout_id"],
        "label": row["sections"],
        "anchor": (row["section_id"] or "").split("/")[-1].replace("*", ""),
        "component": row["component"],
        "state": row["state"],
        "badge": badge(row["state"]),
        "what": row["sentence"],
        "how_sure": row["false_alarm_words"],
        "maintenance": row["last_maintenance"] or "none known",
        "look_at": row["look_at"],
    }


def _line(turnout: dict[str, Any], states: Mapping[str, int]) -> dict[str, Any]:
    urgency = next((k for k, state in enumerate(STATES) if state in states), len(STATES))
    worst = next((state for state in STATES if state in states), "no chart yet")
    return turnout | {
        "urgency": urgency,
        "worst": worst,
        "badge": badge(worst),
        "name": turnout["name"] or "",
        "km_text": "" if turnout["km"] is None else f"{turnout['km']:.3f}",
        "latest": day(turnout["latest"]),
        "states": ", ".join(f"{states[s]} {s}" for s in STATES if s in states) or "–",
    }
