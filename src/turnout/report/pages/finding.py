"""Render the page of a turnout's findings: the answer first, the evidence below."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout.report.finding_text import (
    ANSWERS,
    accepted_parameters,
    answer,
    check,
    facts,
    parameters,
    rivals,
    title,
    unmet_requirements,
)
from turnout.report.formatting import day
from turnout.report.panels.finding import curve_panel, fit_panel, history_of_parameter, residual_panel
from turnout.report.panels.position import STYLES, position_panel

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from typing import Any

    from jinja2 import Template

SEVERITY_ORDER = tuple(ANSWERS)
BADGES = {"named": "inspect", "a_or_b": "plan", "unknown": "plan", "numerics": "learning", "none": "ok"}


def finding_page(
    turnout: Mapping[str, Any],
    rows: Mapping[str, Sequence[Mapping[str, Any]]],
    template: Template,
    shared: Mapping[str, Any],
) -> str:
    """HTML of one turnout's diagnosis.

    Parameters
    ----------
    turnout : mapping
        Row of ``turnouts``.
    rows : mapping
        Rows of "sections", "mismatch_findings" (of one visit), "mismatch_curves", "mismatch_parameters" (of all visits)
        and "quarantine".
    template : Template
        Compiled page.
    shared : mapping
        Variables that every page shows.

    Returns
    -------
    str
        HTML.
    """
    findings = sorted(rows["mismatch_findings"], key=_order)
    first = findings[0] if findings else None
    return template.render(
        turnout=turnout,
        agreeing="recordings" if any(f["n_passages"] for f in findings) else "hammer tests",
        visit=first["visit"] if first else "",
        newest=day(max((f["found_at_utc"] for f in findings), default=None)),
        drawing=position_panel(rows["sections"], findings, first) if findings else "",
        legend=[(STYLES[verdict], word, meaning) for verdict, (word, meaning) in ANSWERS.items()],
        findings=[_finding(f, rows, k) for k, f in enumerate(findings)],
        silent=[q for q in rows["quarantine"] if q["stage"] == "mismatch"],
        notes=list(dict.fromkeys(n for f in findings for n in (f["notes"] or "").splitlines())),
        **shared,
    )


def _order(finding: Mapping[str, Any]) -> tuple[int, float, float]:
    return SEVERITY_ORDER.index(finding["verdict"]), -(finding["probability"] or 0.0), finding["place_low_m"] or 0.0


def _finding(
    finding: Mapping[str, Any], rows: Mapping[str, Sequence[Mapping[str, Any]]], number: int
) -> dict[str, Any]:
    curves = [c for c in rows["mismatch_curves"] if c["finding_id"] == finding["finding_id"]]
    named = finding["verdict"] in ("named", "a_or_b")
    changed = ("the effect" if named else "the rejected effect") if finding["term_json"] is not None else ""
    drawings = [(c["curve"], curve_panel(c, changed)) for c in sorted(curves, key=lambda c: c["curve_no"])]
    residuals = "".join(residual_panel(c, changed) for c in curves)
    return {
        "number": number,
        "id": finding["finding_id"][:12],
        "sections": finding["sections"],
        "headline": title(finding),
        "badge": BADGES[finding["verdict"]],
        "answer": answer(finding),
        "quiet": finding["verdict"] == "none",
        "acceptable": named and finding["term_json"] is not None,
        "changed": changed,
        "facts": facts(finding),
        "check": check(finding),
        "parameters": parameters(finding),
        "filed": accepted_parameters(_parameters_of(rows, finding)),
        "not_examined": unmet_requirements(finding),
        "rivals": rivals(finding),
        "wide": "".join(svg for curve, svg in drawings if curve == "waveform") + residuals,
        "panels": "".join([*(svg for curve, svg in drawings if curve != "waveform"), fit_panel(finding)]),
        "history": "".join(_histories(rows, finding)),
    }


def _parameters_of(
    rows: Mapping[str, Sequence[Mapping[str, Any]]], finding: Mapping[str, Any]
) -> list[Mapping[str, Any]]:
    return [p for p in rows["mismatch_parameters"] if p["finding_id"] == finding["finding_id"]]


def _histories(rows: Mapping[str, Sequence[Mapping[str, Any]]], finding: Mapping[str, Any]) -> Iterator[str]:
    """A chart for each parameter of this finding that earlier visits have estimated, too."""
    for parameter in _parameters_of(rows, finding):
        same = [p for p in rows["mismatch_parameters"] if _is_same_parameter(p, parameter)]
        yield history_of_parameter(sorted(same, key=lambda p: p["found_at_utc"]))


def _is_same_parameter(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    near = a["position_m"] == b["position_m"] or (
        None not in (a["position_m"], b["position_m"]) and abs(a["position_m"] - b["position_m"]) < 0.35
    )
    return near and all(a[k] == b[k] for k in ("term", "parameter", "channel"))
