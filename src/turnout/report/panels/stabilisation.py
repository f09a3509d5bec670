"""Poles over model order: the ones that stay where they are as the order grows are the track's."""

import json

from turnout.report.chart import Axis, Chart


def stabilisation_panel(row, modes):
    """``stabilisation_json`` of one row of ``receptances``; ``modes`` are marked."""
    poles = json.loads(row["stabilisation_json"] or "[]")
    if not poles:
        return ""
    orders = [p["order"] for p in poles]
    chart = Chart(
        Axis(30.0, 1600.0, "frequency [Hz]", "log"),
        Axis(min(orders) - 1, max(orders) + 3, "model order"),  # room for words
        "Stabilisation: poles over model order",
    )
    for mode in modes:
        chart.vertical(mode["frequency_hz"], "mode", mode["band"])
    for status, style, radius in (("unstable", "pole-unstable", 2.0), ("stable", "pole-stable", 3.0)):
        chosen = [p for p in poles if (p["status"] == "stable") == (status == "stable")]
        chart.points(
            [p["frequency"] for p in chosen],
            [p["order"] for p in chosen],
            style,
            radius,
            labels=[f"order {p['order']}: {p['frequency']:.1f} Hz, damping {p['damping']:.3f}" for p in chosen],
        )
    return chart.svg()
