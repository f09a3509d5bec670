"""Score revealed sets of histories: effects named in time, onsets, false alarms, maintenance called a defect."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from math import log
from typing import TYPE_CHECKING, Any

from turnout_blind.history import parameters_at
from turnout_blind.reveal import read_revealed, set_labels
from turnout_blind.score.matching import MAX_POSITION_ERROR, MIN_CLEAR_GAIN, gain_of
from turnout_blind.score.metrics import Rate, Share
from turnout_blind.score.names import right_names

if TYPE_CHECKING:
    from pathlib import Path

MAX_VISITS_LATE = 2  # visits after the first at which the effect is clear, that one included
DAYS_PER_YEAR = 365.25
Z95 = 1.96  # standard errors on each side of a 95 % interval
# Kind of effect -> size that the tool states of it, from its parameters; the tool has no such number of other kinds
SIZES: dict[str, Callable[[Mapping[str, Any]], float]] = {
    "ballast": lambda p: log(p["factor"]),
    "pad": lambda p: log(p["factor"]),
    "gain": lambda p: p["gain"] - 1.0,
    "position": lambda p: p["shift"],
}
# Question of a row that asks for the effect: one that was there from the first visit differs from the file
QUESTION = {"start": "file", "step": "change", "growth": "change"}


@dataclass(frozen=True)
class HistoryResult:
    """Result of one site.

    ``clear_visit`` is the first visit at which the effect is clear, None if it never is. ``named`` is "named", "a_or_b"
    or "" within ``MAX_VISITS_LATE`` visits, ``is_located`` whether the position or sensor of that answer is right.
    ``onset_covered``: whether the interval of the last answer contains the onset, None without one. ``size_covered``:
    whether that of the size at its visit contains the true one, None of a kind without ``SIZES``. ``wrong_names`` are
    names of answers with no right one among them. ``alarms`` are the visits at which a false alarm begins, by question;
    one that is repeated at the next visit is the same. ``n_works`` counts the visits without the effect after recorded
    work, ``maintenance_alarms`` those of them at which a false alarm of a change begins. ``years`` is the time from the
    first visit to the last in which a change alarm is false.
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
    size_covered: bool | None
    wrong_names: tuple[str, ...]
    alarms: Mapping[str, tuple[str, ...]]
    n_works: int
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
        "visit", "question", "verdict", "term", "rival_term", "position_m", "channel", "onset_after", "onset_by",
        "grows", "size", "size_se", "total" and "total_se"; None: the tool gave no answer.

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
    alarms = _episodes(false, visits)
    onset_row = next((r for r in reversed(relevant) if set(_names(r)) & set(names) and r.get("onset_after")), None)
    wrong = [_names(r)[0] for r in stated if _names(r) and not (set(_names(r)) & set(names) and r in relevant)]
    wrong = [n for n in wrong if not (effect and n in names)]
    # at a visit with the effect no row of this question is a false alarm: nothing is exposed after the last one without
    absent = visits[: visits.index(present[0])] if present and question == "change" else visits
    works = [v for v in absent if _has_work(truth, visits, v)]
    last = next((r for r in reversed(rows or ()) if r["question"] == (question or "change")), None)
    return HistoryResult(
        truth["case"], pattern, truth["panel"], effect["kind"] if effect else "", rows is not None,
        clear[0] if clear else None, best["verdict"] if best else "",
        best is not None and effect is not None and _is_located(effect, best),
        None if onset_row is None or truth["onset"] is None
        else onset_row["onset_after"] <= truth["onset"] <= onset_row["onset_by"],
        None if onset_row is None or effect is None
        else _is_size_covered(effect, dict(zip(visits, truth["severities"])), onset_row),
        tuple(dict.fromkeys(wrong)), alarms, len(works), len(set(works) & set(alarms.get("change", ()))),
        (date.fromisoformat(absent[-1]) - date.fromisoformat(visits[0])).days / DAYS_PER_YEAR if absent else 0.0,
        _words(last),
    )  # fmt: skip


def _is_size_covered(effect: Mapping[str, Any], shares: Mapping[str, float], row: Mapping[str, Any]) -> bool | None:
    """Whether the interval of the size at the visit of a row contains the true one; None where none is stated."""
    number = ("size", "size_se") if row.get("total_se") is None and not row.get("grows") else ("total", "total_se")
    value, se = (row.get(n) for n in number)
    if value is None or se is None or effect["kind"] not in SIZES:
        return None
    true = SIZES[effect["kind"]](parameters_at(effect["kind"], effect["parameters"], shares[row["visit"]]))
    return abs(value - true) <= Z95 * se


def _episodes(false: Sequence[Mapping[str, Any]], visits: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Visits at which a false alarm begins, by question: the visit before has none, or one of other names."""
    alarms: dict[str, tuple[str, ...]] = {}
    for question in dict.fromkeys(r["question"] for r in false):
        stated = {r["visit"]: (r["verdict"], set(_names(r))) for r in false if r["question"] == question}
        before = dict(zip(visits[1:], visits))
        begins = [v for v in visits if v in stated and not _is_repeated(stated[v], stated.get(before.get(v, "")))]
        alarms[question] = tuple(begins)
    return alarms


def _is_repeated(now: tuple[str, set[str]], before: tuple[str, set[str]] | None) -> bool:
    """Whether an alarm is that of the visit before: a common name, or no name in both."""
    return before is not None and bool(now[1] & before[1] or not (now[1] or before[1]))


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


def history_figures(results: Sequence[HistoryResult]) -> list[Share | Rate]:
    """Figures of the histories with their bars.

    Parameters
    ----------
    results : sequence of HistoryResult
        Results.

    Returns
    -------
    list of Share or Rate
        In the order of the page.
    """
    clear = [r for r in results if r.clear_visit]
    named = [r for r in clear if r.named]
    onsets = [r for r in results if r.onset_covered is not None]
    sizes = [r for r in results if r.size_covered is not None]
    years = sum(r.years for r in results)
    false_alarms = sum(len(r.alarms.get("change", ())) for r in results)
    worked = [r for r in results if r.n_works]
    after_work = sum(r.maintenance_alarms > 0 for r in worked)
    return [
        Share("clear effects named within two visits", sum(r.named == "named" for r in clear), len(clear), 85.0),
        Share("... named, or half of an a or b", len(named), len(clear)),
        Share("position or sensor right where named", sum(r.is_located for r in named), len(named), 98.0),
        Share("onset inside its 95 % interval", sum(bool(r.onset_covered) for r in onsets), len(onsets), 90.0),
        Share("present size inside its 95 % interval", sum(bool(r.size_covered) for r in sizes), len(sizes), 90.0),
        Rate("false alarms of a change, per site-year", false_alarms, years, 2.0),
        Share("sites with recorded maintenance called a defect", after_work, len(worked), 0.0, "<="),
        Share("sites with a wrong name", sum(bool(r.wrong_names) for r in results), len(results), 0.0, "<="),
        Share("sites that falsely differ from the file", sum("file" in r.alarms for r in results), len(results)),
        Share("sites without an answer", sum(not r.answered for r in results), len(results), 0.0, "<="),
    ]  # fmt: skip


def _cost_text(n: int, diagnosis: Mapping[str, Any]) -> str:
    times = sorted(run["cpu_s"] for run in diagnosis["cases"].values())
    return (
        f"{n} sites, tool {diagnosis['tool_sha256'][:12]}, commit.json {diagnosis['commit_sha256'][:12]}, "
        f"truth hidden by {diagnosis['isolation']}. {times[len(times) // 2]:.0f} CPU s a site in the median."
    )


def history_text(outs: Sequence[str | Path]) -> str:
    """Report of sets of histories as Markdown: every figure with its interval, and every site. Sets are pooled.

    Parameters
    ----------
    outs : sequence of str or Path
        Folders of the sets.

    Returns
    -------
    str
        The report.
    """
    scored = [score_histories(out) for out in outs]
    results = [replace(r, case=label + r.case) for label, (of_set, _) in zip(set_labels(outs), scored) for r in of_set]
    lines = [
        *(_cost_text(len(of_set), diagnosis) for of_set, diagnosis in scored),
        "", "| figure | cases | share | 95 % interval | bar | met |", "|---|---|---|---|---|---|",
    ]  # fmt: skip
    for f in history_figures(results):
        low, high = f.interval
        met = {None: "", True: "yes", False: "no"}[f.is_met]
        if isinstance(f, Rate):
            share = f"{f.rate:.0f} % a year | {low:.0f} to {high:.0f} % a year" if f.years else "- | -"
            lines.append(f"| {f.name} | {f.k} in {f.years:.1f} years | {share} | <= {f.bar:g} % a year | {met} |")
            continue
        bar = "" if f.bar is None else f"{f.sense} {f.bar:g} %"
        share = f"{f.share:.0f} %" if f.n else "-"
        lines.append(f"| {f.name} | {f.k} of {f.n} | {share} | {low:.0f} to {high:.0f} % | {bar} | {met} |")
    lines += [
        "",
        "False alarms of a change are counted up to the last visit without the effect, each once when it begins.",
        "",
    ]
    lines += ["| site | panel | concealed | clear from | last answer | named in time | onset | wrong |"]
    lines += ["|---|---|---|---|---|---|---|---|"]
    for r in results:
        onset = {None: "", True: "inside", False: "outside"}[r.onset_covered]
        wrong = ", ".join([*r.wrong_names, *(f"alarm ({q}) {v}" for q, begins in r.alarms.items() for v in begins)])
        lines.append(
            f"| {r.case} | {r.panel} | {r.kind or '-'} ({r.pattern}) | {r.clear_visit or '-'} | {r.last_answer} | "
            f"{r.named.replace('_', ' ') or '-'} | {onset} | {wrong} |"
        )
    return "\n".join(lines) + "\n"
