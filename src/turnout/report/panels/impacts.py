"""The impacts of a campaign by peak force: which were used, which were not and why."""

from turnout.report.chart import Axis, Chart


def impacts_panel(rows):
    """``rows`` of ``impacts`` of one section and campaign, in order of test and record."""
    if not rows:
        return ""
    peaks = [abs(r["peak_n"] or 0.0) / 1e3 for r in rows]
    used = sum(r["status"] == "accepted" for r in rows)
    chart = Chart(
        Axis(0.0, len(rows) + 1.0, "impact"),
        Axis(0.0, 1.15 * max([*peaks, 1e-3]), "peak force [kN]"),
        f"Impacts: {used} used, {len(rows) - used} rejected",
        height=190,
    )
    for style in ("used", "rejected"):
        some = [i for i, row in enumerate(rows) if (row["status"] == "accepted") == (style == "used")]
        labels = [_words(rows[i], peaks[i]) for i in some]
        chart.points([i + 1 for i in some], [peaks[i] for i in some], style, 3.5, labels=labels)
    return chart.svg()


def _words(row, peak):
    said = "used" if row["status"] == "accepted" else f"rejected: {row['reason']}. {row['detail'] or ''}"
    return f"test {row['test']}, record {row['record'] + 1}: {peak:.1f} kN, {said}"
