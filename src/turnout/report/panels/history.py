"""Draw the history of one resonance: campaign values with intervals, expected band and events."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.report.formatting import count_of, seconds, student_quantile
from turnout.report.svg import Axis, Chart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

SERIES = {"point": "campaign", "confirm": "campaign to be confirmed", "alarm": "campaign in an open alarm"}


def history_panel(
    band: str,
    modes: Sequence[Mapping[str, Any]],
    charts: Sequence[Mapping[str, Any]],
    events: Sequence[Mapping[str, Any]],
    width: int = 462,
) -> str:
    """Frequency over time.

    Parameters
    ----------
    band : str
        Band of the resonance.
    modes : sequence of mapping
        Rows of ``modes_current`` of one section and band.
    charts : sequence of mapping
        Rows of its control chart, may be empty.
    events : sequence of mapping
        Rows of ``events`` that affect the section.
    width : int
        Width. [px]

    Returns
    -------
    str
        SVG, "" without a value.
    """
    if not modes:
        return ""
    time = np.array([seconds(m["measured_at_utc"]) for m in modes])
    frequency = np.array([m["frequency_hz"] for m in modes])
    error = np.array([_half_width(m) for m in modes])
    low, high = frequency - np.nan_to_num(error), frequency + np.nan_to_num(error)
    expected = [c for c in charts if c["expected_low_hz"] is not None and c["expected_high_hz"] is not None]
    lowest = min([low.min(), *(c["expected_low_hz"] for c in expected)])
    highest = max([high.max(), *(c["expected_high_hz"] for c in expected)])
    # a single value without an error still gets an axis of 2 % with short numbers at its ticks
    pad = max(0.08 * (highest - lowest), 0.01 * highest - 0.5 * (highest - lowest))
    margin = 0.03 * (time.max() - time.min()) + 86400
    chart = Chart(
        Axis(time.min() - margin, time.max() + margin, "", "time"),
        Axis(lowest - pad, highest + pad, f"{band} [Hz]"),
        f"{band}: {frequency[-1]:.1f} Hz {_interval(error[-1])}, n = {modes[-1]['n_impacts']}; "
        + count_of(len(modes), "campaign"),
        width=width,
    )
    if expected:
        when = [seconds(c["measured_at_utc"]) for c in expected]
        lows, highs = [c["expected_low_hz"] for c in expected], [c["expected_high_hz"] for c in expected]
        chart.band(when, lows, highs, "expected", "expected at this temperature")
    for row, event in enumerate(events):
        style = "event" if event[f"resets_{band}"] else "event mild"
        chart.vertical(seconds(event["event_at_utc"]), style, event["kind"].replace("_", " "), row % 3)
    labels = [
        f"{m['measured_at_utc']:%Y-%m-%d}: {m['frequency_hz']:.2f} Hz {_interval(e)}, damping "
        f"{m['damping_ratio']:.4f}, n = {m['n_impacts']}, {_temperature(m['rail_temperature_c'])}"
        for m, e in zip(modes, error)
    ]
    styles = _point_styles(modes, charts)
    for style, series in SERIES.items():
        some = np.flatnonzero(styles == style)
        chart.points(time[some], frequency[some], style, 3.0, low[some], high[some], [labels[i] for i in some], series)
    return chart.svg()


def _point_styles(modes: Sequence[Mapping[str, Any]], charts: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """Style of each value: in alarm, far outside its expected value, or neither.

    The campaign of a value is the last one that began before it, for one may last two days.
    """
    rows = sorted(charts, key=lambda c: c["measured_at_utc"])
    began = np.array([seconds(c["measured_at_utc"]) for c in rows])
    of = np.searchsorted(began, [seconds(m["measured_at_utc"]) for m in modes], side="right") - 1
    return np.array([_style(rows[k]) if k >= 0 else "point" for k in of])


def _style(row: Mapping[str, Any]) -> str:
    if row["state"].startswith("alarm"):
        return "alarm"
    return "point" if row.get("deviation_pct") is None else "confirm"


def _half_width(mode: Mapping[str, Any]) -> float:
    """Half of the 95 % t interval, nan where the campaign has no standard error."""
    if mode["frequency_se_hz"] is None or mode["n_impacts"] < 2:
        return np.nan
    return student_quantile(mode["n_impacts"]) * mode["frequency_se_hz"]


def _interval(half: float) -> str:
    return f"± {half:.2g} (95 %)" if np.isfinite(half) else "± unknown"


def _temperature(value: float | None) -> str:
    return "no temperature" if value is None else f"{value:.0f} °C"
