"""Draw bar charts of the mean and spread of a score by train type, speed or axle load, for each section."""

from __future__ import annotations

from collections import Counter
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import Z95
from turnout.report.axis import Axis
from turnout.report.svg import LEFT, LETTER, LINE, Chart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

WIDTH = 952
LEGEND = "mean at equal other factors (○, 95 %), limit of random models (magenta)"
# Light to dark, distinct in print and for colour-blind readers.
COLOURS = ("#c6dbef", "#6baed6", "#2171b5", "#08306b", "#fdd0a2", "#fd8d3c", "#d94801", "#7f2704")


def train_bars(factor: str, rows: Sequence[Mapping[str, Any]], sections: Sequence[Mapping[str, Any]]) -> str:
    """SVG of one factor, "" without a class of it.

    Parameters
    ----------
    factor : str
        "train type", "speed" or "axle load".
    rows : list of dict
        Rows of ``fit_adjusted``: one score of one turnout. Bars are ``score_pct`` with its standard deviation, dots are
        ``adjusted_pct`` with 95 % intervals; magenta lines are the null.
    sections : sequence of mapping
        Rows of ``sections``, in the order along the track.

    Returns
    -------
    str
        SVG.
    """
    rows = [r for r in rows if r["factor"] == factor]
    if not rows:
        return ""
    classes = sorted({(r["class_from"] or 0.0, r["class"]) for r in rows})
    most = Counter[str]()
    for row in rows:
        most[row["class"]] += row["n_passages"]
    drawn_classes = {c for c, _ in most.most_common(len(COLOURS))}
    names = [c for _, c in classes if c in drawn_classes]
    sections_shown = [s for s in sections if any(r["section_id"] == s["section_id"] for r in rows)]
    at = {(r["section_id"], r["class"]): r for r in rows}
    n = sum(r["n_passages"] for r in rows if r["section_id"] == sections_shown[0]["section_id"])
    ends = [e for r in rows for e in (_low(r), _high(r))]
    marks = f"mean (bar), ± standard deviation (thin line), {LEGEND}"
    title = f"{rows[0]['score']} by {factor}: {marks}{_undrawn(len(classes) - len(names))}"
    chart = Chart(
        Axis(
            0.5,
            len(sections_shown) + 0.5,
            f"section ({n} passages at {sections_shown[0]['label']})",
            "names",
            tuple(s["label"] for s in sections_shown),
        ),
        Axis(min(0.0, max(min(ends), -60.0)) - 2.0, max(ends) * 1.08 + 2.0, f"{rows[0]['score']} [%]"),
        title,
        WIDTH,
        230,
    )
    _key(chart, names)
    width = 0.8 / len(names)
    for k, section in enumerate(sections_shown, start=1):
        for j, name in enumerate(names):
            if drawn := at.get((section["section_id"], name)):
                _bar(chart, k - 0.4 + (j + 0.5) * width, width, COLOURS[j], drawn)
    return chart.svg()


def _undrawn(n: int) -> str:
    """Number of classes that are not drawn, in words."""
    return f"; {n} class{'es' * (n > 1)} with fewer passages {'are' if n > 1 else 'is'} not drawn" if n else ""


def _low(row: Mapping[str, Any]) -> float:
    return row["score_pct"] - (row["score_sd_pct"] or 0.0)


def _high(row: Mapping[str, Any]) -> float:
    return max(row["score_pct"] + (row["score_sd_pct"] or 0.0), row["null_pct"] or 0.0)


def _bar(chart: Chart, x: float, width: float, colour: str, row: Mapping[str, Any]) -> None:
    """Draw one bar with its spread, its null, and the mean with the other factors held fixed."""
    x_0, x_1 = (float(chart.px(x + side * 0.45 * width)) for side in (-1, 1))
    top, zero = float(chart.py(row["score_pct"])), float(chart.py(0.0))
    words = f"{row['class']}: {row['score_pct']:.1f} %, n = {row['n']}"
    if row["score_sd_pct"] is not None:
        words += f", spread {row['score_sd_pct']:.1f}"
    words += f"; others held fixed {row['adjusted_pct']:.1f}"
    chart.elements.append(
        f'<rect x="{x_0:.1f}" y="{min(top, zero):.1f}" width="{x_1 - x_0:.1f}" height="{abs(zero - top):.1f}" '
        f'fill="{colour}"><title>{escape(words)}</title></rect>'
    )
    if row["score_sd_pct"] is not None:
        chart.line([x, x], [_low(row), row["score_pct"] + row["score_sd_pct"]], "edge")
    if row["null_pct"] is not None:
        chart.line(
            [x - 0.45 * width, x + 0.45 * width], [row["null_pct"]] * 2, "chance", "95 % quantile of random models"
        )
    half = np.nan if row["adjusted_se_pct"] is None else Z95 * row["adjusted_se_pct"]
    mean = np.array([row["adjusted_pct"]])
    chart.points(np.array([x + 0.2 * width]), mean, "measured", 2.5, mean - half, mean + half)


def _key(chart: Chart, names: Sequence[str]) -> None:
    """Draw the legend above the plot area, so that no bar lies behind it: the colours of the classes."""
    chart.grow_top(LINE + 3)
    x, y = float(LEFT), chart.top - LINE - 4
    for colour, name in zip(COLOURS, names):
        chart.outside.append(f'<rect x="{x:.0f}" y="{y}" width="10" height="10" fill="{colour}" stroke="#65727f"/>')
        chart.outside.append(f'<text x="{x + 14:.0f}" y="{y + 9}">{escape(name)}</text>')
        x += 30 + LETTER * len(name)
