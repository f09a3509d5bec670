"""Render the page of one turnout: its state, the history of its resonances, and the latest measurements."""

from __future__ import annotations

import math
import re
from collections import Counter
from typing import TYPE_CHECKING

from turnout.counts import count_of, first_texts
from turnout.registry.as_of import chart_in_words
from turnout.report import panels
from turnout.report.departures import departure_rows, departure_sentences
from turnout.report.formatting import (
    STIFFNESS_NOTE,
    badge,
    campaign_of,
    day_and_time,
    diagnoses_once,
    has_stiffness,
    number_ranges,
    result_and_evidence,
    sorted_statements,
    with_half_width,
)
from turnout.report.panels.calibrated_model import calibrated_panels, visits_in_words
from turnout.report.panels.diagram import diagram
from turnout.report.panels.hammer import HammerTest
from turnout.report.panels.history import DAMPING, FREQUENCY, history_panel, interval
from turnout.report.trains import trains_part

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from jinja2 import Template

BANDS = ("ballast", "railpad")
MAX_UNUSED_SHOWN = 5  # earlier unused tests that are listed per section
NUMBER = re.compile(r"\d+(?:\.\d+)?")
RECORD_PLACE = re.compile(r"record (\d+)(?: of (\d+))?((?:, .*)?)")  # place of a row of the quarantine
TRACKS = {"main": "main track", "diverging": "diverging track", "both": "both tracks"}
PANELS = {
    "OT": "open track",
    "SP": "switch panel",
    "CLP": "closure panel",
    "CP": "crossing panel",
    "AS": "after the crossing",
}


def turnout_page(
    rows: Mapping[str, Sequence[Mapping[str, Any]]],
    turnout: Mapping[str, Any],
    template: Template,
    shared: Mapping[str, Any],
) -> str:
    """HTML of one turnout.

    Parameters
    ----------
    rows : mapping
        Rows of this turnout for each kind of ``source.ROWS``.
    turnout : mapping
        Row of ``turnouts``.
    template : Template
        Compiled page.
    shared : mapping
        Variables that every page shows.

    Returns
    -------
    str
        HTML.
    """
    models = {m["section_id"]: m for m in rows["models"]}
    states = _worst_states(rows["chart_states"])
    unread = {q.get("section_id") for q in rows["quarantine"] if q["kind"] == "hammer"}
    return template.render(
        turnout=turnout,
        place=_position_words(turnout),
        latest=campaign_of(max(models.values(), key=lambda m: m["measured_at_utc"], default={})),
        diagram=_diagram(rows) if rows["sections"] else "",
        has_train_charts=any(c["source"] == "passage" for c in rows["chart_states"]),
        findings=lines_of(rows["worklist"]),
        has_stiffness=has_stiffness(rows["worklist"]),
        stiffness_note=STIFFNESS_NOTE,
        mismatches=mismatches_with_limits(rows["mismatches"], rows.get("limits", ())),
        summary=[
            _summary(s, models.get(s["section_id"]), _rows_of(rows, "modes", s), s["section_id"] in unread)
            for s in rows["sections"]
        ],
        sections=[_section(rows, s, models, states) for s in rows["sections"]],
        calibrated=calibrated_panels(rows.get("calibrated", [])),
        calibrated_visits=visits_in_words(rows.get("calibrated", [])),
        part=trains_part(rows, rows["sections"]),
        quarantine=_by_file(rows["quarantine"]),
        unshown=_hidden_counts(rows["quarantine"]),
        events=[_event(e) for e in rows["events"]],
        **shared,
    )


def _rows_of(
    rows: Mapping[str, Sequence[Mapping[str, Any]]], table: str, section: Mapping[str, Any]
) -> list[Mapping[str, Any]]:
    """Rows of one table that belong to one section."""
    return [r for r in rows[table] if r["section_id"] == section["section_id"]]


def mismatches_with_limits(
    findings: Sequence[Mapping[str, Any]], limits: Sequence[Mapping[str, Any]]
) -> list[tuple[str, list[str]]]:
    """Findings as lines of the page, each with the dates at which what grows in it reaches its limit.

    Parameters
    ----------
    findings : sequence of mapping
        Rows of ``findings_newest`` of one turnout.
    limits : sequence of mapping
        Rows of ``growth_to_limit`` of one turnout with ``term``, only of significant growth.

    Returns
    -------
    list of (str, list of str)
        Sentence and dates in words. An accepted effect beyond which its visit shows nothing has the sentence "".
    """
    dates: dict[str, list[str]] = {}
    for limit in limits:
        position = "" if limit["position_m"] is None else f" at {limit['position_m']:.1f} m"
        words = f"{limit['term'].replace('_', ' ')}{position}: {limit['words']}"
        dates.setdefault(limit["finding_id"], []).append(words)
    lines = [(f["sentence"], dates.pop(f["finding_id"], [])) for f in findings]
    return lines + [("", words) for words in dates.values()]


def lines_of(worklist: Sequence[Mapping[str, Any]]) -> list[dict[str, str]]:
    """Rows of the worklist as lines of the page; a sentence that names no section gets section and band in front.

    Behind an alarm stands what the newest diagnosis of the section says, or why there is no decision. Alarms that rest
    on the same diagnosis show it once.

    Parameters
    ----------
    worklist : sequence of mapping
        Rows of the worklist of one turnout.

    Returns
    -------
    list of dict
        ``state``, ``badge``, ``words``, ``diagnosis`` ("" without one), ``evidence`` (what it rests on), ``look_at``
        (what to look at) and ``anchor``, the label of the section that it concerns.
    """
    return [
        {
            "state": work["state"],
            "badge": badge(work["state"]),
            "words": (
                ""
                if work["change_pct"] is not None and work["state"] != "confirm now"
                else f"{work['sections']}, {chart_in_words(work['band'])}: "
            )
            + work["sentence"],
            "diagnosis": result_and_evidence(diagnosis)[0],
            "evidence": result_and_evidence(diagnosis)[1],
            "look_at": work.get("look_at") or "",
            "anchor": (work.get("section_id") or "").split("/")[-1].replace("*", ""),
        }
        for work, diagnosis in zip(worklist, diagnoses_once(worklist))
    ]


def _position_words(turnout: Mapping[str, Any]) -> str:
    words = [
        f"line {turnout['line']}," if turnout["line"] else "",
        "" if turnout["km"] is None else f"km {turnout['km']:.3f};",
    ]
    return " ".join(p for p in words if p)


def _latest(modes: Sequence[Mapping[str, Any]], band: str, model: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """The mode of ``band`` that belongs to the latest model, or None."""
    return next((m for m in modes if m["band"] == band and model and m["model_id"] == model["model_id"]), None)


def _summary(
    section: Mapping[str, Any], model: Mapping[str, Any] | None, modes: Sequence[Mapping[str, Any]], is_unread: bool
) -> dict[str, Any]:
    """Row of the table of resonances. ``is_unread``: files of a hammer test are there, and some are in quarantine."""
    status = "not read, see quarantine" if is_unread else "not measured"
    row = {"label": section["label"], "panel": section["panel"] or "–", "n": 0, "when": "–", "status": status}
    if model:
        row |= {"n": model["n_impacts_used"], "when": campaign_of(model)}
        row["status"] = model["status"].replace("_", " ") + (f": {model['reason']}" if model["reason"] else "")
    for band in BANDS:
        mode = _latest(modes, band, model) or {}
        for quantity, key, digits in ((FREQUENCY, band, 1), (DAMPING, f"{band}_damping", 4)):
            value = mode.get(quantity.value)
            row[key] = with_half_width(value, None if value is None else interval(mode, quantity).half_width, digits)
    return row


def _section(
    rows: Mapping[str, Sequence[Mapping[str, Any]]],
    section: Mapping[str, Any],
    models: Mapping[str, Any],
    states: Mapping[str, str],
) -> dict[str, Any]:
    key = section["section_id"]
    model, modes = models.get(key), _rows_of(rows, "modes", section)
    receptances = (r for r in _rows_of(rows, "receptances", section) if model and r["model_id"] == model["model_id"])
    receptance = next(receptances, None)  # a test with too few impacts has none
    charts, events = _rows_of(rows, "charts", section), [e for e in rows["events"] if e["section_id"] in (None, key)]
    tables = {FREQUENCY: charts, DAMPING: _rows_of(rows, "damping_charts", section)}
    recursive = _rows_of(rows, "recursive_modes", section)
    history = "".join(
        history_panel(
            band,
            [m for m in modes if m["band"] == band and m[quantity.value] is not None],
            [c for c in table if c["band"] == band],
            events,
            quantity=quantity,
            recursive=[r for r in recursive if r["band"] == band],
        )
        for quantity, table in tables.items()
        for band in BANDS
    )
    unused = _unused_tests(_rows_of(rows, "unused", section))
    off_track = _rows_of(rows, "off_track", section)
    return {
        "label": section["label"],
        "measured": bool(model or history or unused),
        "panel": PANELS.get(section["panel"], "panel not configured"),
        "track": TRACKS.get(section["track"], "track not configured"),
        "position": f"{section['position_m']:.1f}" if section["position_m"] is not None else "–",
        "open": states.get(key) in ("confirm now", "inspect this week", "plan"),
        "when": campaign_of(model) if model else "none",
        "history": history or "<p>No model yet.</p>",
        "panels": _panels(rows, section, model, receptance, modes) if model and receptance else "",
        "detail": "; ".join(sorted_statements(model["detail"])) if model else "",
        "unused": unused,
        "departures": departure_sentences(off_track, modes),
        "departure_rows": departure_rows(off_track),
    }


def _by_file(quarantine: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """One row for each file, reason, channels and remedy, with its records together; those of a record come first.

    The details are those of the first record. Remedies that differ only in a number are one.
    """
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for row in sorted(quarantine, key=lambda q: (q["path"], _place_of(q)[0] or math.inf)):
        remedy = NUMBER.sub("", row["remedy"] or "")
        groups.setdefault((row["path"], row["reason_code"], str(row.get("channels")), remedy), []).append(row)
    return [dict(same[0]) | _records(same) for same in groups.values()]


def _records(same: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Words for where and what in rows of one file and reason, if they are of several records."""
    places = [_place_of(q) for q in same]
    numbers = sorted({number for number, _, _ in places if number is not None})
    if len(numbers) < 2:
        return {}
    further = {place[2] for place in places}
    is_all = {total for _, total, _ in places} == {len(numbers)}
    place = f"all {len(numbers)} records" if is_all else f"{count_of(len(numbers), 'record')}: {number_ranges(numbers)}"
    alike = len({q["found"] for q in same}) == 1
    what = same[0]["found"] if alike else f"{same[0]['found']} (first of {len(numbers)})"
    return {"place": place + (further.pop() if len(further) == 1 else ""), "found": what}


def _place_of(row: Mapping[str, Any]) -> tuple[int | None, int | None, str]:
    """Number of the record from 1 and of all records of the file, and what else its place states.

    >>> _place_of({"record": None, "place": "record 4 of 10, channel 'rail'"}), _place_of({"record": 3, "place": None})
    ((4, 10, ", channel 'rail'"), (4, None, ''))
    """
    stated = RECORD_PLACE.fullmatch(row.get("place") or "")
    number, total, further = stated.groups() if stated else (None, None, "")
    if row["record"] is not None:
        number = row["record"] + 1
    return (None if number is None else int(number)), (None if total is None else int(total)), further


def _hidden_counts(quarantine: Sequence[Mapping[str, Any]]) -> list[tuple[str, int]]:
    """(reason, number of its rows that are not shown), for reasons with more rows than are shown."""
    n_shown = Counter((q["kind"], q["reason_code"]) for q in quarantine)
    more = {(q["kind"], q["reason_code"]): q["n_alike"] for q in quarantine}
    return [
        (reason, more[test_type, reason] - n)
        for (test_type, reason), n in n_shown.items()
        if more[test_type, reason] > n
    ]


def _unused_tests(tests: Sequence[Mapping[str, Any]]) -> str:
    """Earlier tests of a section that gave no model, the newest first; they are not in its history."""
    entries = [f"{campaign_of(t)} ({_reason(t)})" for t in tests]
    return first_texts(entries, MAX_UNUSED_SHOWN, others="before")


def _reason(test: Mapping[str, Any]) -> str:
    words = (test["reason"] or "no reason").replace("_", " ")
    return f"{words}: {test['detail']}" if test["detail"] else words


def _panels(
    rows: Mapping[str, Sequence[Mapping[str, Any]]],
    section: Mapping[str, Any],
    model: Mapping[str, Any],
    receptance: Mapping[str, Any],
    modes: Sequence[Mapping[str, Any]],
) -> str:
    current = [m for m in modes if m["model_id"] == model["model_id"]]
    test = HammerTest(receptance, model, current, _rows_of(rows, "impacts", section))
    return "".join(panel(test) for panel in panels.HAMMER_PANELS)


def _diagram(rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """The turnout with the states of the charts of hammer tests and of trains, each by itself."""
    hammer, trains = (
        _worst_states([c for c in rows["chart_states"] if c["source"] == source]) for source in ("hammer", "passage")
    )
    return diagram(rows["sections"], hammer, trains)


def _worst_states(charts: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    order = ["confirm now", "inspect this week", "plan", "cannot tell", "learning", "not measured", "suppressed", "ok"]
    worst: dict[str, str] = {}
    for chart in charts:
        if chart["state"] in order:
            worst_so_far = worst.get(chart["section_id"], "ok")
            worst[chart["section_id"]] = min(worst_so_far, chart["state"], key=order.index)
    return worst


def _event(event: Mapping[str, Any]) -> dict[str, str]:
    resets = [band for band in BANDS if event[f"resets_{band}"]]
    return {
        "day": day_and_time(event["event_at_utc"]),
        "section": (event["section_id"] or "/all").split("/")[-1],
        "kind": event["kind"].replace("_", " "),
        "resets": ", ".join(resets) or "nothing",
        "note": event["note"] or "",
    }
