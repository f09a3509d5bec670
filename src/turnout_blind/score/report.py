"""Write the report of revealed sets as Markdown. Several sets are pooled: their cases count as those of one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from turnout_blind.reveal import read_revealed, set_labels
from turnout_blind.score.answers import answers_of
from turnout_blind.score.calibration import by_answer, reliability
from turnout_blind.score.matching import judge
from turnout_blind.score.metrics import Share, confusion, figures, is_handled_right, severity
from turnout_blind.score.tables import answer_table, confusion_table, figure_table, severity_table
from turnout_blind.seal import BlindError, read_commit

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from turnout_blind.score.matching import CaseResult

KEY_FIGURES = (
    "controls: false alarms", "what: top-1 (clear singles)", "what: a wrong name (all singles)",
    "outside the library: named wrongly", "two effects: both right", "cases without an answer",
)  # fmt: skip


def score_set(
    out: str | Path, extra_names: Mapping[str, Sequence[str]] | None = None, label: str | None = None
) -> tuple[list[CaseResult], dict[str, Any]]:
    """Score a revealed set or an ablation on it; cases not run are left out.

    Parameters
    ----------
    out : str or Path
        Folder of the set.
    extra_names : mapping or None
        Right names of added effects by kind.
    label : str or None
        Name of an ablation; None: the tool itself.

    Returns
    -------
    (list of CaseResult, dict)
        Results of the cases that were run, and the diagnosis.
    """
    truths, rows, diagnosis = read_revealed(out, label)
    return [
        judge(truths[case], answers_of(rows[case]), extra_names)
        for case in sorted(truths)
        if case in diagnosis["cases"]
    ], diagnosis


def score_sets(
    outs: Sequence[str | Path], extra_names: Mapping[str, Sequence[str]] | None = None
) -> list[tuple[list[CaseResult], dict[str, Any]]]:
    """Score revealed sets that are pooled.

    Parameters
    ----------
    outs : sequence of str or Path
        Folders of the sets.
    extra_names : mapping or None
        Right names of added effects by kind.

    Returns
    -------
    list of (list of CaseResult, dict)
        Result of ``score_set`` of each. The ids of the cases of several sets begin with the name of their set.

    Raises
    ------
    BlindError
        If a case is in two of the sets.
    """
    scored = []
    for label, out in zip(set_labels(outs), outs):
        results, diagnosis = score_set(out, extra_names)
        scored.append(([replace(j, case=label + j.case) for j in results], diagnosis))
    return scored


def provenance(record: Mapping[str, Any]) -> dict[str, str]:
    """Hashes of the tool and of the set, from a diagnosis or an oracle file.

    Parameters
    ----------
    record : mapping
        Content of the file.

    Returns
    -------
    dict
        "tool_sha256" and "commit_sha256".
    """
    return {name: record[name] for name in ("tool_sha256", "commit_sha256")}


def read_oracle(out: str | Path) -> dict[str, tuple[float, float]]:
    """Fits with the true effect, from ``out``/oracle.json.

    Parameters
    ----------
    out : str or Path
        Folder of the set.

    Returns
    -------
    dict of (float, float)
        Held-out fit without and with the true effect [%], by case; {} if there is no such file.

    Raises
    ------
    BlindError
        If it was computed with another tool or for another set.
    """
    path = Path(out) / "oracle.json"
    if not path.exists():
        return {}
    oracle, diagnosis = json.loads(path.read_text()), json.loads((Path(out) / "diagnosis.json").read_text())
    if provenance(diagnosis) != {name: oracle.get(name) for name in provenance(diagnosis)}:
        raise BlindError(path, "tool_sha256", "not the tool and set of diagnosis.json", "Ask the oracle with that tool")
    return {case: (r["before"], r["oracle"]) for case, r in oracle["fits"].items() if r.get("oracle") is not None}


def oracle_text(out: str | Path) -> list[str]:
    """Number of cases asked of the oracle, and those without an answer.

    Parameters
    ----------
    out : str or Path
        Folder of the set.

    Returns
    -------
    list of str
        One sentence, [] if there is no oracle file.
    """
    path = Path(out) / "oracle.json"
    if not path.exists():
        return []
    oracle, answered = json.loads(path.read_text()), read_oracle(out)
    reasons = {c: oracle["fits"][c].get("error", "no such candidate") for c in oracle["asked"] if c in oracle["fits"]}
    unanswered = {c: why for c, why in reasons.items() if c not in answered}
    why = "; ".join(f"{c}: {reason}" for c, reason in unanswered.items())
    waiting = len(oracle["asked"]) - len(reasons)
    return [
        f"Oracle: {len(reasons)} of {len(oracle['asked'])} clear singles asked, in the order of their ids"
        f"{f' ({waiting} not yet)' if waiting else ''}, "
        f"{len(unanswered)} without an answer{f' ({why})' if why else ''}."
    ]


def ablation_labels(out: str | Path) -> list[str]:
    """Labels of the ablations of this set.

    Parameters
    ----------
    out : str or Path
        Folder of the set.

    Returns
    -------
    list of str
        Labels, sorted.
    """
    return sorted(p.parent.name for p in (Path(out) / "ablations").glob("*/diagnosis.json"))


def read_oracles(outs: Sequence[str | Path]) -> dict[str, tuple[float, float]]:
    """Fits with the true effect of several sets (``read_oracle``).

    Parameters
    ----------
    outs : sequence of str or Path
        Folders of the sets.

    Returns
    -------
    dict of (float, float)
        Held-out fit without and with the true effect [%], by case as in ``score_sets``.

    Raises
    ------
    BlindError
        If one was computed with another tool or for another set.
    """
    return {label + case: fits for label, out in zip(set_labels(outs), outs) for case, fits in read_oracle(out).items()}


def report_text(outs: Sequence[str | Path], extra_names: Mapping[str, Sequence[str]] | None = None) -> str:
    """Markdown: figures with their bars, confusion, severity, reliability, failures, ablations, cost.

    Fits with the true effect are read from oracle.json of each set.

    Parameters
    ----------
    outs : sequence of str or Path
        Folders of the sets.
    extra_names : mapping or None
        Right names of added effects by kind.

    Returns
    -------
    str
        Markdown.
    """
    scored = score_sets(outs, extra_names)
    results = [result for of_set, _ in scored for result in of_set]
    sections = [
        *(
            cost_text(of_set, diagnosis, len(read_commit(out)["cases"]))
            for out, (of_set, diagnosis) in zip(outs, scored)
        ),
        *(text for out in outs for text in oracle_text(out)),
        figure_table(figures(results, read_oracles(outs))),
        "First answer (columns) by concealed effect (rows):",
        confusion_table(confusion(results)),
        "Answers by size of the effect, the smallest first (visibility in points: answer; * = with the right name):",
        severity_table(severity(results)),
        "Stated probability and share right, in up to five groups of the cases, equal ones together:",
        "\n".join(f"- {p:.2f}: {share:.2f} of {n}" for p, share, n in reliability(results)) or "- none stated",
        "The same by kind of the first answer:",
        answer_table(by_answer(results)),
        "False alarms, wrong names, clear effects that were not named or not reported, cases without an answer:",
        failure_table(results),
    ]
    if any(ablation_labels(out) for out in outs):
        sections += ["Ablations, each over its own cases:", ablation_table(outs, results, extra_names)]
    return "\n\n".join(sections) + "\n"


def cost_text(results: Sequence[CaseResult], diagnosis: Mapping[str, Any], total: int) -> str:
    """One paragraph: number of cases, hashes, and CPU time.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.
    diagnosis : mapping
        Content of diagnosis.json.
    total : int
        Number of cases of the set.

    Returns
    -------
    str
        The paragraph.
    """
    cpu = sorted(run["cpu_s"] for run in diagnosis["cases"].values()) or [float("nan")]
    commit, tool = diagnosis["commit_sha256"][:16], diagnosis["tool_sha256"][:16]
    return (
        f"{len(results)} of {total} sealed cases; commit {commit}, tool {tool}, "
        f"truth hidden by {diagnosis['isolation']}; "
        f"CPU per case: median {cpu[len(cpu) // 2]:.0f} s, most {cpu[-1]:.0f} s."
    )


def failure_table(results: Sequence[CaseResult]) -> str:
    """A row per failed case: alarm on a control, wrong name, clear effect missed, or no answer.

    An unidentifiable effect fails with any answer but none or "a or b" with the truth among them.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.

    Returns
    -------
    str
        Markdown, "None." without a failure.
    """
    lines = [
        "| case | concealed | visibility [points] | first answer | wrong names | probability |",
        "|---|---|---|---|---|---|",
    ]
    for j in sorted(results, key=lambda j: (j.stratum, j.kinds, j.rungs)):
        if _is_failure(j):
            concealed = " + ".join(f"{k} {r}" for k, r in zip(j.kinds, j.rungs)) or "nothing"
            probability = "" if j.probability is None else f"{j.probability:.2f}"
            lines.append(
                f"| {j.case} | {concealed} | {j.gain:.1f} | {j.first_answer} | "
                f"{', '.join(j.wrong_names)} | {probability} |"
            )
    return "\n".join(lines) if len(lines) > 2 else "None."


def _is_failure(j: CaseResult) -> bool:
    checks = {
        "control": lambda: j.alarm,
        "outside": lambda: j.is_clear and not j.alarm,
        "unidentifiable": lambda: not is_handled_right(j),
    }
    return not j.answered or bool(j.wrong_names) or checks.get(j.stratum, lambda: j.is_clear and not all(j.matches))()


def ablation_table(
    outs: Sequence[str | Path], results: Sequence[CaseResult], extra_names: Mapping[str, Sequence[str]] | None = None
) -> str:
    """A row per key figure and a column per ablation, each over its own cases.

    Parameters
    ----------
    outs : sequence of str or Path
        Folders of the sets.
    results : sequence of CaseResult
        Results of the tool itself.
    extra_names : mapping or None
        Right names of added effects by kind.

    Returns
    -------
    str
        Markdown.
    """
    columns = {"the tool": list(results)}
    for out in outs:
        for label in ablation_labels(out):
            columns.setdefault(label, []).extend(score_set(out, extra_names, label)[0])
    by_column = {name: {f.name: f for f in figures(cases) if isinstance(f, Share)} for name, cases in columns.items()}
    lines = ["| figure | " + " | ".join(f"{n} (n = {len(c)})" for n, c in columns.items()) + " |"]
    lines.append("|---" * (len(columns) + 1) + "|")
    for name in KEY_FIGURES:
        cells = [f"{f[name].k} of {f[name].n}" if f[name].n else "–" for f in by_column.values()]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)
