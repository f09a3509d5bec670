"""Draw the phase of the receptance of a hammer test."""

from __future__ import annotations

import numpy as np

from turnout.report.axis import Axis
from turnout.report.panels.hammer import FREQUENCY_RANGE, HammerTest
from turnout.report.svg import Chart


def phase_panel(test: HammerTest) -> str:
    """Phase of the receptance over frequency, 0 to -180 degrees for a point on the rail; lines that fail are grey.

    Parameters
    ----------
    test : HammerTest
        Rows of a hammer test.

    Returns
    -------
    str
        SVG, "" without a value.
    """
    row = test.receptance
    frequency = np.asarray(row["frequency_hz"], dtype=float)
    real, imaginary = (np.asarray(row[key], dtype=float) for key in ("h1_real_m_n", "h1_imag_m_n"))
    defined = np.isfinite(real) & np.isfinite(imaginary) & ((real != 0) | (imaginary != 0))
    if not defined.any():
        return ""
    phase = np.where(defined, np.degrees(np.arctan2(imaginary, real)), np.nan)
    passed = np.asarray(row["passed"], dtype=bool)
    chart = Chart(
        Axis(*FREQUENCY_RANGE, "frequency [Hz]", "log"),
        Axis(-200.0, 200.0, "phase [°]"),
        "Phase of the receptance, H1",
        height=190,
    )
    chart.line(frequency, phase, "curve failed", "H1, fails the gate")
    chart.line(frequency, np.where(passed, phase, np.nan), "curve", "H1")
    for mode in test.modes:
        chart.vertical(mode["frequency_hz"], "mode", mode["band"])
    return chart.svg()
