"""Receptance of one section with its H1-H2 bracket, and the coherence that says where to trust it."""

import numpy as np

from turnout.report.chart import Axis, Chart

SPAN = (30.0, 1600.0)


def receptance_panel(row, modes):
    """Magnitude of the receptance over frequency; lines that fail the gate are grey.

    ``row`` is one row of ``receptances``, ``modes`` the rows of ``modes`` of the same model.
    """
    frequency = np.asarray(row["frequency_hz"], dtype=float)
    inside = (frequency >= SPAN[0]) & (frequency <= SPAN[1])
    h1 = np.hypot(row["h1_real_m_n"], row["h1_imag_m_n"])
    h2 = np.asarray(row["h2_abs_m_n"], dtype=float)
    shown = np.concatenate([h1[inside], h2[inside]])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    if not shown.size:
        return ""
    chart = Chart(
        Axis(*SPAN, "frequency [Hz]", "log"),
        Axis(np.quantile(shown, 0.005) / 1.5, shown.max() * 1.6, "receptance [m/N]", "log"),
        f"Receptance, H1 with H1-H2 bracket, n = {row['n_impacts']} impacts{_window(row)}",
    )
    passed = np.asarray(row["passed"], dtype=bool)
    _grey_out(chart, frequency, passed, row)
    chart.band(frequency, h1, h2, "bracket", "between H1 and H2")
    chart.line(frequency, h1, "curve failed", "H1, fails the gate")
    chart.line(frequency, np.where(passed, h1, np.nan), "curve", "H1")
    for mode in modes:
        chart.vertical(mode["frequency_hz"], "mode", f"{mode['band']} {mode['frequency_hz']:.0f} Hz")
    return chart.svg()


def coherence_panel(row):
    """Coherence with its 95 % limits and the gate it is held against."""
    frequency = np.asarray(row["frequency_hz"], dtype=float)
    chart = Chart(
        Axis(*SPAN, "frequency [Hz]", "log"),
        Axis(0.0, 1.02, "coherence"),
        f"Coherence, 95 % limits, n = {row['n_impacts']}; gate: {row['gate']}",
        height=190,
    )
    _grey_out(chart, frequency, np.asarray(row["passed"], dtype=bool), row)
    chart.band(frequency, row["coherence_low"], row["coherence_high"], "interval", "95 % limits")
    chart.line(frequency, row["coherence"], "curve", "coherence")
    if required := row.get("gate_required"):
        chart.line(SPAN, [required] * 2, "limit", f"required {required:g}")
    return chart.svg()


def _window(row):
    """What an exponential window did to the curve; nothing to say without one."""
    decay = row.get("window_decay_per_s")
    return f"; a window exp(-{decay:g}/s t) adds to its damping, not to the model's" if decay else ""


def _grey_out(chart, frequency, passed, row):
    """Shade the lines that the gate refused, and what lies beyond the hammer."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~passed).astype(int), [0]])))
    for first, last in zip(edges[::2], edges[1::2] - 1):
        half = 0.5 * (frequency[1] - frequency[0])
        chart.span(frequency[first] - half, frequency[last] + half, "gated", "refused by the gate")
    if row["valid_to_hz"]:
        chart.vertical(row["valid_to_hz"], "edge", "hammer's band edge", row=1)
