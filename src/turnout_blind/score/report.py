"""The report of a revealed set, as Markdown."""

import json
from pathlib import Path

from turnout_blind.reveal import revealed
from turnout_blind.score.answers import answers_of
from turnout_blind.score.figures import Share, confusion, figures, reliability, severity
from turnout_blind.score.judged import judge


def judged_set(out, more=None):
    """(judged cases, diagnosis) of a revealed set."""
    truths, rows, held = revealed(out)
    return [judge(truths[case], answers_of(rows[case]), more) for case in sorted(truths)], held


def report_of(out, more=None):
    """Markdown: figures beside their bars, confusion, severity, reliability, cost. ``more`` {kind: [right names]}.

    The fits with the true effect are read from ``out``/oracle.json, {case: %}, where somebody has made them.
    """
    judged, held = judged_set(out, more)
    path = Path(out) / "oracle.json"
    oracle = json.loads(path.read_text()) if path.exists() else {}
    runs = [run for run in held["cases"].values()]
    cpu = sorted(run["cpu_s"] for run in runs)
    parts = [
        f"{len(judged)} cases; commit {held['commit_sha256'][:16]}, tool {held['tool_sha256'][:16]}, truth hidden by "
        f"{held['isolation']}; CPU per case: median {cpu[len(cpu) // 2]:.0f} s, most {cpu[-1]:.0f} s.",
        figure_table(figures(judged, oracle)),
        "What was said first, by what was concealed:",
        confusion_table(confusion(judged)),
        "Along the ladder (points of held-out fit that the effect costs: what was said; * = the right name among it):",
        severity_table(severity(judged)),
        "Stated probability and share right, by fifths:",
        "\n".join(f"- {p:.2f}: {share:.2f} of {n}" for p, share, n in reliability(judged)) or "- none stated",
    ]
    return "\n\n".join(parts) + "\n"


def figure_table(found):
    """A row per figure: figure, 95 % interval, n, bar, met or missed."""
    lines = ["| figure | measured | 95 % | n | bar | |", "|---|---|---|---|---|---|"]
    for f in found:
        word = {True: "met", False: "missed", None: ""}[f.met]
        bar = "" if f.bar is None else f"{f.sense} {f.bar:.3g}"
        if isinstance(f, Share):
            shown = f"{f.share:.1f} % ({f.k})" if f.n else "not measured"
            low, high = f.interval
            lines.append(f"| {f.name} | {shown} | {low:.1f} to {high:.1f} % | {f.n} | {bar and bar + ' %'} | {word} |")
        else:
            shown = f"{f.value:.3g} {f.unit}".strip() if f.n else "not measured"
            lines.append(f"| {f.name} | {shown} | | {f.n} | {bar and bar + ' ' + f.unit} | {word} |")
    return "\n".join(lines)


def confusion_table(table):
    """Rows of what was concealed, columns of what was said."""
    columns = sorted({said for row in table.values() for said in row}, key=lambda s: (s not in ("none", "unknown"), s))
    lines = ["| concealed | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for kind in sorted(table, key=lambda k: (k != "control", k)):
        cells = [str(table[kind][c] or "") for c in columns]
        lines.append(f"| {kind} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def severity_table(table):
    """One line per kind, rung by rung."""
    lines = []
    for kind, rows in table.items():
        told = ", ".join(f"{gain:.1f}: {said}{'*' if right else ''}" for _, gain, said, right in rows)
        lines.append(f"- {kind}: {told}")
    return "\n".join(lines)
