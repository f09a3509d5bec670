"""The free decay of one impact and the model's decay laid over it."""

import numpy as np

from turnout.report.chart import Axis, Chart

# Points of a drawn decay: ten a period at 1 kHz.
DRAWN = 300


def decay_panel(row, model):
    """``row`` of ``receptances`` and ``model`` of ``models``; 30 ms are shown."""
    if row["decay_ms2"] is None or row["decay_model_ms2"] is None:
        return ""
    measured = np.asarray(row["decay_ms2"], dtype=float)
    predicted = np.asarray(row["decay_model_ms2"], dtype=float)
    n = min(len(measured), len(predicted), int(0.03 * row["decay_rate_hz"]))
    step = max(1, n // DRAWN)
    measured, predicted, n = measured[:n:step], predicted[:n:step], len(measured[:n:step])
    time = 1e3 * step * np.arange(n) / row["decay_rate_hz"]
    largest = 1.1 * float(np.max(np.abs(measured[:n])))
    fit, null = model["hammer_fit_pct"], model["hammer_fit_null_pct"]
    score = f"fit left out {fit:.0f} % (null {null:.0f} %)" if _known(fit) and _known(null) else ""
    chart = Chart(
        Axis(0.0, float(time[-1]), "time after contact [ms]"),
        Axis(-largest, largest, "acceleration [m/s²]"),
        f"Free decay, one impact; {score}" if score else "Free decay, one impact",
    )
    chart.line(time, measured[:n], "measured", "measured")
    chart.line(time, predicted[:n], "model", "model")
    chart.text(0.98, 0.08, "measured", "key measured", "end")
    chart.text(0.98, 0.16, f"model of order {model['model_order']}", "key model", "end")
    return chart.svg()


def _known(value):
    return value is not None and np.isfinite(value)
