"""Write the report of a revealed set as Markdown."""

import json
from pathlib import Path

from turnout_blind.reveal import revealed
from turnout_blind.score.answers import answers_of
from turnout_blind.score.matching import judge
from turnout_blind.score.metrics import Share, as_it_should, confusion, figures, reliability, severity
from turnout_blind.seal import BlindError, read_commit

KEY = (
    "controls: false alarms", "what: top-1 (clear singles)", "what: a wrong name (all singles)",
    "outside the library: named wrongly", "two effects: both right", "cases without an answer",
)  # fmt: skip


def judged_set(out, more=None, label=None):
    """(results of cases, diagnosis) of a revealed set or of an ablation on it; cases not run are left out."""
    truths, rows, held = revealed(out, label)
    return [judge(truths[case], answers_of(rows[case]), more) for case in sorted(truths) if case in held["cases"]], held


def provenance(held):
    """Hashes of the tool and of the set, from a diagnosis or an oracle file."""
    return {name: held[name] for name in ("tool_sha256", "commit_sha256")}


def oracle_of(out):
    """{case: held-out fit (without, with) the true effect [%]} from ``out``/oracle.json, {} if there is none.

    Errors: BlindError if it was computed with another tool or for another set.
    """
    path = Path(out) / "oracle.json"
    if not path.exists():
        return {}
    told, held = json.loads(path.read_text()), json.loads((Path(out) / "diagnosis.json").read_text())
    if provenance(held) != {name: told.get(name) for name in provenance(held)}:
        raise BlindError(path, "tool_sha256", "not the tool and set of diagnosis.json", "Ask the oracle with that tool")
    return {case: (r["before"], r["oracle"]) for case, r in told["fits"].items() if r.get("oracle") is not None}


def oracle_words(out):
    """Number of cases asked of the oracle, and those without an answer; [] if there is no oracle file."""
    path = Path(out) / "oracle.json"
    if not path.exists():
        return []
    told, known = json.loads(path.read_text()), oracle_of(out)
    asked = {c: told["fits"][c].get("error", "no such candidate") for c in told["asked"] if c in told["fits"]}
    left = {c: why for c, why in asked.items() if c not in known}
    why = "; ".join(f"{c}: {reason}" for c, reason in left.items())
    waiting = len(told["asked"]) - len(asked)
    return [
        f"Oracle: {len(asked)} of {len(told['asked'])} clear singles asked, in the order of their ids"
        f"{f' ({waiting} not yet)' if waiting else ''}, "
        f"{len(left)} without an answer{f' ({why})' if why else ''}."
    ]


def labels_of(out):
    """Labels of the ablations of this set."""
    return sorted(p.parent.name for p in (Path(out) / "ablations").glob("*/diagnosis.json"))


def report_of(out, more=None):
    """Markdown: figures with their bars, confusion, severity, reliability, failures, ablations, cost.

    ``extra_names`` {kind: [right names]}. Fits with the true effect are read from ``out``/oracle.json.
    """
    judged, held = judged_set(out, more)
    parts = [
        cost(judged, held, len(read_commit(out)["cases"])),
        *oracle_words(out),
        figure_table(figures(judged, oracle_of(out))),
        "What was said first, by what was concealed:",
        confusion_table(confusion(judged)),
        "Along the ladder (visibility in points: what was said; * = the right name among it):",
        severity_table(severity(judged)),
        "Stated probability and share right, in up to five groups of the cases, equal ones together:",
        "\n".join(f"- {p:.2f}: {share:.2f} of {n}" for p, share, n in reliability(judged)) or "- none stated",
        "Alarms, wrong names, clear effects without their name or without a word, no answer:",
        failure_table(judged),
    ]
    if labels_of(out):
        parts += ["Ablations, each over its own cases:", ablation_table(out, judged, more)]
    return "\n\n".join(parts) + "\n"


def cost(judged, held, total):
    """One paragraph: number of cases of ``total``, hashes, and CPU time."""
    cpu = sorted(run["cpu_s"] for run in held["cases"].values()) or [float("nan")]
    commit, tool = held["commit_sha256"][:16], held["tool_sha256"][:16]
    return (
        f"{len(judged)} of {total} sealed cases; commit {commit}, tool {tool}, "
        f"truth hidden by {held['isolation']}; "
        f"CPU per case: median {cpu[len(cpu) // 2]:.0f} s, most {cpu[-1]:.0f} s."
    )


def failure_table(judged):
    """A row per failed case: alarm on a control, wrong name, clear effect missed, or no answer.

    An unidentifiable effect fails with any answer but none or "a or b" with the truth among them.
    """
    lines = [
        "| case | concealed | visibility [points] | said first | wrong names | probability |",
        "|---|---|---|---|---|---|",
    ]
    for j in sorted(judged, key=lambda j: (j.stratum, j.kinds, j.rungs)):
        if _failed(j):
            what = " + ".join(f"{k} {r}" for k, r in zip(j.kinds, j.rungs)) or "nothing"
            sure = "" if j.probability is None else f"{j.probability:.2f}"
            lines.append(
                f"| {j.case} | {what} | {j.gain:.1f} | {j.said} | "
                f"{', '.join(j.wrong)} | {sure} |"
            )
    return "\n".join(lines) if len(lines) > 2 else "None."


def _failed(j):
    missed = {
        "control": lambda: j.alarm,
        "outside": lambda: j.clear and not j.alarm,
        "unidentifiable": lambda: not as_it_should(j),
    }
    return not j.answered or bool(j.wrong) or missed.get(j.stratum, lambda: j.clear and not all(j.hits))()


def ablation_table(out, judged, more=None):
    """A row per key figure and a column per ablation, each over its own cases."""
    columns = {"the tool": judged} | {label: judged_set(out, more, label)[0] for label in labels_of(out)}
    found = {name: {f.name: f for f in figures(cases)} for name, cases in columns.items()}
    lines = ["| figure | " + " | ".join(f"{n} (n = {len(c)})" for n, c in columns.items()) + " |"]
    lines.append("|---" * (len(columns) + 1) + "|")
    for name in KEY:
        cells = [f"{f[name].k} of {f[name].n}" if f[name].n else "–" for f in found.values()]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


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
    """Rows of concealed effects, columns of first answers."""
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
