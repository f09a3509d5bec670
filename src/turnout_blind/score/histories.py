"""Score a revealed set of histories: effects named in time, onsets, false alarms, maintenance called a defect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING, Any

from turnout_blind.reveal import read_revealed
from turnout_blind.score.intervals import clopper_pearson
from turnout_blind.score.matching import MAX_POSITION_ERROR, MIN_CLEAR_GAIN, gain_of
from turnout_blind.score.metrics import Share
from turnout_blind.score.names import right_names

if TYPE_CHECKING:
    from pathlib import Path

MAX_VISITS_LATE = 2  # visits after the first at which the effect is clear, that one included
DAYS_PER_YEAR = 365.25
# Question of a row that asks for the effect: one that was there from the first visit differs from the file
QUESTION = {"start": "file", "step": "change", "growth": "change"}


@dataclass(frozen=True)
class HistoryResult:
    """Result of one site.

    ``clear_visit`` is the first visit at which the effect is clear, None if it never is. ``named`` is "named", "a_or_b"
    or "" within ``MAX_VISITS_LATE`` visits, ``is_located`` whether the position or sensor of that answer is right.
    ``onset_covered``: whether the interval of the last answer contains the onset, None without one. ``wrong_names`` are
    names of answers with no right one among them. ``alarms`` are the first visits of false alarms by question,
    ``maintenance_alarms`` the number of those after recorded work since the visit before. ``years`` is the time from
    the first visit to the last in which a change alarm is false.
    """

    case: str
    pattern: str
    panel: str
    kind: str
    answered: bool
    clear_visit: str | None
    named: str
    is_located: bool
    onset_covered: bool | None
    wrong_names: tuple[str, ...]
    alarms: Mapping[str, str]
    maintenance_alarms: int
    years: float
    last_answer: str


def judge_history(truth: Mapping[str, Any], rows: Sequence[Mapping[str, Any]] | None) -> HistoryResult:
    """Result of a site from its truth and its rows, two for each visit.

    Parameters
    ----------
    truth : mapping
        Truth of the site.
    rows : sequence of mapping or None
        "visit", "question", "verdict", "term", "rival_term", "position_m", "channel", "onset_after" and "onset_by";
        None: the tool gave no answer.

    Returns
    -------
    HistoryResult
        The result.
    """
    visits, pattern = list(truth["visits"]), truth["pattern"]
    effect = truth["effects"][0] if truth["effects"] else None
    clear = [v for v, visible in zip(visits, truth["visible"]) if gain_of(visible) > MIN_CLEAR_GAIN]
    present = [v for v, share in zip(visits, truth["severities"]) if share > 0.0]
    names = right_names(effect["kind"]) if effect else ()
    question = QUESTION.get(pattern, "")
    stated = [r for r in rows or () if r["verdict"] != "none"]
    relevant = [r for r in stated if r["question"] == question and r["visit"] in present]
    in_time = visits[visits.index(clear[0]) :][:MAX_VISITS_LATE] if clear else []
    right = [r for r in relevant if r["visit"] in in_time and set(_names(r)) & set(names)]
    best = next((r for r in right if r["verdict"] == "named"), right[0] if right else None)
    restated = [r for r in stated if r["visit"] in present and _restates(r, question, effect, names)]
    false = [r for r in stated if r not in relevant and r not in restated]
    alarms: dict[str, str] = {}
    for row in false:
        alarms.setdefault(row["question"], row["visit"])
    onset_row = next((r for r in reversed(relevant) if set(_names(r)) & set(names) and r.get("onset_after")), None)
    wrong = [_names(r)[0] for r in stated if _names(r) and not (set(_names(r)) & set(names) and r in relevant)]
    wrong = [n for n in wrong if not (effect and n in names)]
    end = next(iter(clear or present), visits[-1]) if pattern in ("step", "growth") else visits[-1]
    last = next((r for r in reversed(rows or ()) if r["question"] == (question or "change")), None)
    return HistoryResult(
        truth["case"], pattern, truth["panel"], effect["kind"] if effect else "", rows is not None,
        clear[0] if clear else None, best["verdict"] if best else "",
        best is not None and effect is not None and _is_located(effect, best),
        None if onset_row is None or truth["onset"] is None
        else onset_row["onset_after"] <= truth["onset"] <= onset_row["onset_by"],
        tuple(dict.fromkeys(wrong)), alarms,
        sum(_has_work(truth, visits, visit) for question, visit in alarms.items() if question == "change"),
        (date.fromisoformat(end) - date.fromisoformat(visits[0])).days / DAYS_PER_YEAR, _words(last),
    )  # fmt: skip


def _names(row: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(n for n in (row.get("term"), row.get("rival_term")) if n) if row["verdict"] != "unknown" else ()


def _restates(row: Mapping[str, Any], question: str, effect: Mapping[str, Any] | None, names: Sequence[str]) -> bool:
    """Whether a row of the other question states the concealed effect at its position, and no other name."""
    if effect is None or row["question"] == question or not _is_located(effect, row):
        return False
    return not _names(row) or bool(set(_names(row)) & set(names))


def _is_located(effect: Mapping[str, Any], row: Mapping[str, Any]) -> bool:
    where = effect["where"]
    if "sensor" in where:
        return row.get("channel") == where["sensor"]
    position = row.get("position_m")
    return position is not None and abs(position - where["position"]) <= MAX_POSITION_ERROR


def _has_work(truth: Mapping[str, Any], visits: Sequence[str], visit: str) -> bool:
    """Whether work was recorded between the visit before and this one."""
    before = visits[visits.index(visit) - 1] if visit != visits[0] else ""
    return any(before < work["day"] <= visit for work in truth["maintenance"])


def _words(row: Mapping[str, Any] | None) -> str:
    if row is None:
        return "no answer"
    names = " or ".join(_names(row)) or row["verdict"]
    where = row.get("channel") or ("" if row.get("position_m") is None else f"{row['position_m']:.1f} m")
    onset = f", {row['onset_after']} to {row['onset_by']}" if row.get("onset_after") else ""
    return f"{names} {where}".strip() + onset


def score_histories(out: str | Path) -> tuple[list[HistoryResult], dict[str, Any]]:
    """Results of a revealed set of histories; sites that were not diagnosed are left out.

    Parameters
    ----------
    out : str or Path
        Folder of the set.

    Returns
    -------
    (list of HistoryResult, dict)
        Results, and the diagnosis.
    """
    truths, rows, diagnosis = read_revealed(out)
    return [judge_history(truths[c], rows[c]) for c in sorted(truths) if c in diagnosis["cases"]], diagnosis


def history_figures(results: Sequence[HistoryResult]) -> list[Share]:
    """Figures of the histories with their bars.

    Parameters
    ----------
    results : sequence of HistoryResult
        Results.

    Returns
    -------
    list of Share
        In the order of the page.
    """
    clear = [r for r in results if r.clear_visit]
    named = [r for r in clear if r.named]
    onsets = [r for r in results if r.onset_covered is not None]
    years = round(sum(r.years for r in results))
    false_alarms = sum("change" in r.alarms for r in results)
    after_work = sum(r.maintenance_alarms for r in results)
    return [
        Share("clear effects named within two visits", sum(r.named == "named" for r in clear), len(clear), 85.0),
        Share("... named, or half of an a or b", len(named), len(clear)),
        Share("position or sensor right where named", sum(r.is_located for r in named), len(named), 98.0),
        Share("onset inside its 95 % interval", sum(bool(r.onset_covered) for r in onsets), len(onsets), 90.0),
        Share("false alarms of a change, per site-year", false_alarms, years, 2.0, "<="),
        Share("recorded maintenance called a defect", after_work, len(results), 0.0, "<="),
        Share("sites with a wrong name", sum(bool(r.wrong_names) for r in results), len(results), 0.0, "<="),
        Share("sites that falsely differ from the file", sum("file" in r.alarms for r in results), len(results)),
        Share("sites without an answer", sum(not r.answered for r in results), len(results), 0.0, "<="),
    ]  # fmt: skip


def history_text(out: str | Path) -> str:
    """Report of a set of histories as Markdown: every figure with its interval, and every site.

    Parameters
    ----------
    out : str or Path
        Folder of the set.

    Returns
    -------
    str
        The report.
    """
    results, diagnosis = score_histories(out)
    times = sorted(run["cpu_s"] for run in diagnosis["cases"].values())
    lines = [
        f"{len(results)} sites, tool {diagnosis['tool_sha256'][:12]}, commit.json {diagnosis['commit_sha256'][:12]}, "
        f"truth hidden by {diagnosis['isolation']}. {times[len(times) // 2]:.0f} CPU s a site in the median.",
        "", "| figure | cases | share | 95 % interval | bar | met |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for f in history_figures(results):
        low, high = (100.0 * v for v in clopper_pearson(min(f.k, f.n), f.n))
        bar = "" if f.bar is None else f"{f.sense} {f.bar:g} %"
        met = {None: "", True: "yes", False: "no"}[f.is_met]
        share = f"{f.share:.0f} %" if f.n else "-"
        lines.append(f"| {f.name} | {f.k} of {f.n} | {share} | {low:.0f} to {high:.0f} % | {bar} | {met} |")
    lines += ["", "False alarms of a change are counted per site-year until the effect is clear.", ""]
    lines += ["| site | panel | concealed | clear from | last answer | named in time | onset | wrong |"]
    lines += ["|---|---|---|---|---|---|---|---|"]
    for r in results:
        onset = {None: "", True: "inside", False: "outside"}[r.onset_covered]
        wrong = ", ".join([*r.wrong_names, *(f"alarm ({q}) {v}" for q, v in r.alarms.items())])
        lines.append(
            f"| {r.case} | {r.panel} | {r.kind or '-'} ({r.pattern}) | {r.clear_visit or '-'} | {r.last_answer} | "
            f"{r.named.replace('_', ' ') or '-'} | {onset} | {wrong} |"
        )
    return "\n".join(lines) + "\n"
