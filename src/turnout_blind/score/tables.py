"""Write the figures of a scored set as tables in Markdown."""

from __future__ import annotations

from typing import TYPE_CHECKING

from turnout_blind.score.intervals import clopper_pearson
from turnout_blind.score.metrics import Share

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Iterable, Mapping, Sequence

    from turnout_blind.score.metrics import Value


def figure_table(values: Iterable[Share | Value]) -> str:
    """A row per figure: figure, 95 % interval, n, bar, met or missed.

    Parameters
    ----------
    values : iterable of Share or Value
        Figures.

    Returns
    -------
    str
        Markdown.
    """
    lines = ["| figure | measured | 95 % | n | bar | |", "|---|---|---|---|---|---|"]
    for f in values:
        verdict = {True: "met", False: "missed", None: ""}[f.is_met]
        bar = "" if f.bar is None else f"{f.sense} {f.bar:.3g}"
        if isinstance(f, Share):
            text = f"{f.share:.1f} % ({f.k})" if f.n else "not measured"
            low, high = f.interval
            lines.append(
                f"| {f.name} | {text} | {low:.1f} to {high:.1f} % | {f.n} | {bar and bar + ' %'} | {verdict} |"
            )
        else:
            text = f"{f.value:.3g} {f.unit}".strip() if f.n else "not measured"
            by_chance = "" if f.by_chance is None else "{:.2f} to {:.2f} by chance".format(*f.by_chance)
            lines.append(f"| {f.name} | {text} | {by_chance} | {f.n} | {bar and bar + ' ' + f.unit} | {verdict} |")
    return "\n".join(lines)


def answer_table(groups: Mapping[str, tuple[float, int, int]]) -> str:
    """A row per kind of answer: number of cases, mean stated probability, share right with its 95 % interval.

    Parameters
    ----------
    groups : mapping
        Result of ``by_answer``.

    Returns
    -------
    str
        Markdown.
    """
    lines = ["| first answer | cases | stated | right | 95 % |", "|---|---|---|---|---|"]
    for answer, (stated, k, n) in groups.items():
        low, high = clopper_pearson(k, n)
        lines.append(f"| {answer} | {n} | {stated:.2f} | {k / n:.2f} ({k}) | {low:.2f} to {high:.2f} |")
    return "\n".join(lines)


def confusion_table(table: Mapping[str, Counter[str]]) -> str:
    """Rows of concealed effects, columns of first answers.

    Parameters
    ----------
    table : mapping
        Result of ``confusion``.

    Returns
    -------
    str
        Markdown.
    """
    columns = sorted(
        {answer for row in table.values() for answer in row}, key=lambda s: (s not in ("none", "unknown"), s)
    )
    lines = ["| concealed | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for effect_type in sorted(table, key=lambda k: (k != "control", k)):
        cells = [str(table[effect_type][c] or "") for c in columns]
        lines.append(f"| {effect_type} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def severity_table(table: Mapping[str, Sequence[tuple[int, float, str, bool]]]) -> str:
    """One line per kind, rung by rung.

    Parameters
    ----------
    table : mapping
        Result of ``severity``.

    Returns
    -------
    str
        Markdown.
    """
    lines = []
    for effect_type, rows in table.items():
        entries = ", ".join(f"{gain:.1f}: {answer}{'*' if right else ''}" for _, gain, answer, right in rows)
        lines.append(f"- {effect_type}: {entries}")
    return "\n".join(lines)
