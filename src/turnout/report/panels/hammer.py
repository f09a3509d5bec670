"""Draw the panels of a hammer test: receptance, coherence, free decay, stabilization diagram and impacts."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.report.axis import Axis
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any


@dataclass(frozen=True)
class HammerTest:
    """Rows of the registry that the panels of one section and campaign draw."""

    receptance: Mapping[str, Any]
    model: Mapping[str, Any]
    modes: Sequence[Mapping[str, Any]]
    impacts: Sequence[Mapping[str, Any]]


FREQUENCY_RANGE = (30.0, 1600.0)  # Hz, frequency axis of the panels


def receptance_panel(test: HammerTest) -> str:
    """Magnitude of the receptance over frequency; lines that fail the gate are grey.

    Parameters
    ----------
    test : HammerTest
        Rows of a hammer test.

    Returns
    -------
    str
        SVG, "" without a value above 0.
    """
    row = test.receptance
    frequency = np.asarray(row["frequency_hz"], dtype=float)
    inside = (frequency >= FREQUENCY_RANGE[0]) & (frequency <= FREQUENCY_RANGE[1])
    h1 = np.hypot(row["h1_real_m_n"], row["h1_imag_m_n"])
    h2 = np.asarray(row["h2_abs_m_n"], dtype=float)
    magnitudes = np.concatenate([h1[inside], h2[inside]])
    magnitudes = magnitudes[np.isfinite(magnitudes) & (magnitudes > 0)]
    if not magnitudes.size:
        return ""
    chart = Chart(
        Axis(*FREQUENCY_RANGE, "frequency [Hz]", "log"),
        Axis(np.quantile(magnitudes, 0.005) / 1.5, magnitudes.max() * 1.6, "receptance [m/N]", "log"),
        f"Receptance, H1 with H1-H2 bracket, n = {row['n_impacts']} impacts{_window(row)}",
    )
    passed = np.asarray(row["passed"], dtype=bool)
    _grey_out(chart, frequency, passed, row)
    chart.band(frequency, h1, h2, "bracket", "between H1 and H2")
    chart.line(frequency, h1, "curve failed", "H1, fails the gate")
    chart.line(frequency, np.where(passed, h1, np.nan), "curve", "H1")
    for mode in test.modes:
        chart.vertical(mode["frequency_hz"], "mode", f"{mode['band']} {mode['frequency_hz']:.0f} Hz")
    return chart.svg()


def coherence_panel(test: HammerTest) -> str:
    """Coherence with its 95 % limits and the required level of the gate.

    Parameters
    ----------
    test : HammerTest
        Rows of a hammer test.

    Returns
    -------
    str
        SVG.
    """
    row = test.receptance
    frequency = np.asarray(row["frequency_hz"], dtype=float)
    tested = "its lower limit" if row["gate"] == "limit" else "the estimate"
    chart = Chart(
        Axis(*FREQUENCY_RANGE, "frequency [Hz]", "log"),
        Axis(0.0, 1.02, "coherence"),
        f"Coherence, n = {row['n_impacts']}; the gate tests {tested}",
        height=190,
    )
    _grey_out(chart, frequency, np.asarray(row["passed"], dtype=bool), row)
    chart.band(frequency, row["coherence_low"], row["coherence_high"], "interval", "95 % limits")
    chart.line(frequency, row["coherence"], "curve", "coherence")
    if required := row.get("gate_required"):
        chart.line(FREQUENCY_RANGE, [required] * 2, "limit", f"required {required:g}")
    return chart.svg()


def _window(row: Mapping[str, Any]) -> str:
    """Note on the damping added by an exponential window; "" without one."""
    decay = row.get("window_decay_per_s")
    return f"; a window exp(-{decay:g}/s t) adds to its damping, not to the model's" if decay else ""


def _grey_out(chart: Chart, frequency: np.ndarray, passed: np.ndarray, row: Mapping[str, Any]) -> None:
    """Shade the lines that fail the gate, and mark the band edge of the hammer."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~passed).astype(int), [0]])))
    if edges.size:
        half = 0.5 * (frequency[1] - frequency[0])
        first, last = frequency[edges[::2]], frequency[edges[1::2] - 1]
        chart.span(first - half, last + half, "gated", "rejected by the gate")
    if row["valid_to_hz"]:
        chart.vertical(row["valid_to_hz"], "edge", "hammer's band edge", row=1)


# Maximum points of a decay curve of 30 ms: ten per period at 1 kHz.
MAX_DECAY_POINTS = 300


def decay_panel(test: HammerTest) -> str:
    """Measured and modelled free decay of one impact, 30 ms.

    Parameters
    ----------
    test : HammerTest
        Rows of a hammer test.

    Returns
    -------
    str
        SVG, "" without a decay.
    """
    row, model = test.receptance, test.model
    if row["decay_ms2"] is None or row["decay_model_ms2"] is None:
        return ""
    measured = np.asarray(row["decay_ms2"], dtype=float)
    predicted = np.asarray(row["decay_model_ms2"], dtype=float)
    n = min(len(measured), len(predicted), int(0.03 * row["decay_rate_hz"]))
    step = max(1, n // MAX_DECAY_POINTS)
    measured, predicted, n = measured[:n:step], predicted[:n:step], len(measured[:n:step])
    time = 1e3 * step * np.arange(n) / row["decay_rate_hz"]
    largest = 1.1 * float(np.max(np.abs(measured[:n])))
    fit, null = model["hammer_fit_pct"], model["hammer_fit_null_pct"]
    score = (
        f"fit of held-out impacts {fit:.0f} % (a random model: {null:.0f} %)"
        if _is_number(fit) and _is_number(null)
        else ""
    )
    chart = Chart(
        Axis(0.0, float(time[-1]), "time after contact [ms]"),
        Axis(-largest, largest, "acceleration [m/s²]"),
        "Free decay of one impact",
    )
    chart.line(time, measured[:n], "measured", "measured")
    chart.line(time, predicted[:n], "model", "model")
    chart.text(0.98, 0.08, "measured", "key measured", "end")
    chart.text(0.98, 0.16, f"model of order {model['model_order']}", "key model", "end")
    chart.text(0.98, 0.96, score, "note", "end")
    return chart.svg()


def _is_number(value: float | None) -> bool:
    return value is not None and np.isfinite(value)


def stabilisation_panel(test: HammerTest) -> str:
    """Stabilization diagram: poles over model order.

    Parameters
    ----------
    test : HammerTest
        Rows of a hammer test.

    Returns
    -------
    str
        SVG, "" without a pole.
    """
    poles = json.loads(test.receptance["stabilisation_json"] or "[]")
    if not poles:
        return ""
    orders = [p["order"] for p in poles]
    chart = Chart(
        Axis(30.0, 1600.0, "frequency [Hz]", "log"),
        Axis(min(orders) - 1, max(orders) + 3, "model order"),  # room for words
        "Stabilization: poles over model order",
    )
    for mode in test.modes:
        chart.vertical(mode["frequency_hz"], "mode", mode["band"])
    for status, style, radius in (("unstable", "pole-unstable", 2.0), ("stable", "pole-stable", 3.0)):
        chosen = [p for p in poles if (p["status"] == "stable") == (status == "stable")]
        chart.points(
            [p["frequency"] for p in chosen],
            [p["order"] for p in chosen],
            style,
            radius,
            labels=[_pole_words(p) for p in chosen],
            series=f"{status} pole",
        )
    return chart.svg()


def _pole_words(pole: Mapping[str, Any]) -> str:
    """One pole in words; rows of earlier versions have no coherence and no energy."""
    words = f"order {pole['order']}, {pole['status']}: {pole['frequency']:.1f} Hz, damping {pole['damping']:.3f}"
    if pole.get("emac") is None:
        return words
    return f"{words}, amplitude coherence {pole['emac']:.2f}, {100 * pole['energy']:.1f} % of the energy"


def impacts_panel(test: HammerTest) -> str:
    """Peak force of the impacts, used and rejected.

    Parameters
    ----------
    test : HammerTest
        Rows of a hammer test.

    Returns
    -------
    str
        SVG, "" without an impact.
    """
    rows = test.impacts
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
        chart.points([i + 1 for i in some], [peaks[i] for i in some], style, 3.5, labels=labels, series=style)
    return chart.svg()


def _words(row: Mapping[str, Any], peak: float) -> str:
    result = "used" if row["status"] == "accepted" else f"rejected: {row['reason']}. {row['detail'] or ''}"
    return f"test {row['test']}, record {row['record'] + 1}: {peak:.1f} kN, {result}"
