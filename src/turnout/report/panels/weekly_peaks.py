"""Draw the weekly peak acceleration under trains of one section."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import Z95
from turnout.counts import count_of
from turnout.report.axis import Axis
from turnout.report.formatting import seconds, with_half_width
from turnout.report.panels.history import EXPECTED, history_limits
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any


SERIES = {"point": "week", "alarm": "week in an open alarm"}


def weekly_peaks_panel(label: str, weeks: Sequence[Mapping[str, Any]]) -> str:
    """Weekly peak acceleration over time, at the usual speed.

    Parameters
    ----------
    label : str
        Label of the section.
    weeks : sequence of mapping
        ``week_utc``, ``peak_ms2``, ``peak_se_ms2``, and of its chart ``state``, ``expected_low_ms2`` and
        ``expected_high_ms2``, in order of time.

    Returns
    -------
    str
        SVG, "" without a week.
    """
    if not weeks:
        return ""
    time = np.array([seconds(w["week_utc"]) for w in weeks])
    peak = np.array([w["peak_ms2"] for w in weeks], dtype=float)
    half = Z95 * np.array([np.nan if w["peak_se_ms2"] is None else w["peak_se_ms2"] for w in weeks], dtype=float)
    low, high = peak - np.nan_to_num(half), peak + np.nan_to_num(half)
    expected = [w for w in weeks if w["expected_low_ms2"] is not None and w["expected_high_ms2"] is not None]
    lows, highs = ([w[column] for w in expected] for column in ("expected_low_ms2", "expected_high_ms2"))
    margin = 0.03 * (time.max() - time.min()) + 86400
    is_alarm = np.array([(w["state"] or "").startswith("alarm") for w in weeks])
    last = float(half[-1]) if half[-1] > 0.0 else None
    state = "in alarm" if is_alarm[-1] else "no alarm"
    chart = Chart(
        Axis(time.min() - margin, time.max() + margin, "", "time"),
        Axis(*history_limits(low, high, lows, highs), "peak acceleration [m/s²]"),
        f"{label}: {with_half_width(peak[-1], last, 0)} m/s² (95 %), {state}; {count_of(len(weeks), 'week')}",
    )
    if expected:
        chart.band([seconds(w["week_utc"]) for w in expected], lows, highs, "expected", EXPECTED)
    labels = [f"week of {w['week_utc']:%Y-%m-%d}: {p:.1f} m/s² ± {h:.1f} (95 %)" for w, p, h in zip(weeks, peak, half)]
    for style, chosen in (("point", ~is_alarm), ("alarm", is_alarm)):
        some = np.flatnonzero(chosen)
        chart.points(
            time[some], peak[some], style, 3.0, low[some], high[some], [labels[i] for i in some], SERIES[style]
        )
    return chart.svg()
