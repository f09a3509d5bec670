"""How well the sections' models predict trains, by train type, speed or axle load: each score over its null."""

import numpy as np

from turnout.report.chart import Axis, Chart
from turnout.report.words import student_quantile

SCORES = (("fit", "fit_pct", "fit_null_pct"), ("forecast", "forecast_pct", "forecast_null_pct"))


def scores_panel(score, rows, sections):
    """Mean score per section with its 95 % interval over passages, and the mean 95 % quantile of its null.

    ``score`` is "fit" or "forecast", ``rows`` of ``passage_scores`` of one turnout, ``sections`` in order.
    """
    column, null = {name: (value, level) for name, value, level in SCORES}[score]
    labels = [s["label"] for s in sections]
    groups = [[r for r in rows if r["section_id"] == s["section_id"] and r[column] is not None] for s in sections]
    if not any(groups):
        return ""
    mean = np.array([np.mean([r[column] for r in g]) if g else np.nan for g in groups])
    error = np.array(
        [1.96 * np.std([r[column] for r in g], ddof=1) / len(g) ** 0.5 if len(g) > 1 else 0 for g in groups]
    )
    level = np.array([np.mean([r[null] for r in g if r[null] is not None] or [np.nan]) for g in groups])
    lowest = max(-40.0, float(np.nanmin([mean - error, level])) - 5.0)
    chart = Chart(
        Axis(0.4, len(labels) + 0.6, "section", "names", tuple(labels)),
        Axis(min(lowest, -2.0), max(30.0, float(np.nanmax([mean + error, level])) + 8.0), f"{score} [%]"),
        f"{score} of train passages by section, mean ± 95 %; orange: what random models reach",
        height=220,
    )
    place = np.arange(1, len(labels) + 1)
    for x, value in zip(place, level):
        chart.line([x - 0.35, x + 0.35], [value, value], "model", "95 % quantile of random models")
    words = [f"{name}: {m:.0f} ± {e:.0f} %, n = {len(g)}" for name, m, e, g in zip(labels, mean, error, groups)]
    chart.points(place, mean, "point", 3.5, mean - error, mean + error, words)
    return chart.svg()


def _half_width(values):
    """Half of the 95 % t interval of the mean, 0 where one value tells nothing of it."""
    n = len(values)
    return student_quantile(n) * np.std(values, ddof=1) / n**0.5 if n > 1 else 0.0
