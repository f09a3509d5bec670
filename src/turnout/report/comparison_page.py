"""Draw a recorded passage beside its simulation: time series and power spectral density in each band."""

from __future__ import annotations

import csv
import io
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from turnout.report.axis import Axis
from turnout.report.site import page_environment, shared_by_pages
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from turnout.stages.compare import BandComparison, PassageComparison

MAX_POINTS = 1500  # of a curve; more do not fit into the width
SERIES = (("recorded", "measured"), ("simulated", "curve"))


def comparison_page(comparison: PassageComparison) -> str:
    """The comparison as one HTML file.

    Parameters
    ----------
    comparison : PassageComparison
        Result of ``turnout.stages.compare.compare_passage``.

    Returns
    -------
    str
        HTML.
    """
    rows = [f'<div class="row">{_time_chart(b)}{_density_chart(b)}</div>' for b in comparison.bands]
    template = page_environment().get_template("comparison.html")
    return template.render(
        train=comparison.train, notes=[escape(n) for n in comparison.notes], charts="".join(rows), **shared_by_pages()
    )


def spectra_csv(comparison: PassageComparison) -> str:
    """Power spectral densities of all sensors and bands.

    Parameters
    ----------
    comparison : PassageComparison
        Result of ``turnout.stages.compare.compare_passage``.

    Returns
    -------
    str
        CSV with one row per sensor, band and frequency; densities in (m/s²)²/Hz.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["sensor", "band_low_hz", "band_high_hz", "frequency_hz", "recorded_psd", "simulated_psd"])
    for b in comparison.bands:
        for frequency, *densities in zip(b.frequency, b.recorded_density, b.simulated_density):
            head = [b.sensor, f"{b.low:g}", f"{b.high:g}", f"{frequency:.4g}"]
            writer.writerow([*head, *(f"{d:.6g}" for d in densities)])
    return stream.getvalue()


def _time_chart(b: BandComparison) -> str:
    step = max(1, b.time.size // MAX_POINTS)
    reach = 1.05 * float(max(np.abs(b.recorded).max(), np.abs(b.simulated).max()))
    by_chance = "" if b.fit_by_chance is None else f" (by chance {b.fit_by_chance:z.0f} %)"
    level = f"simulation {b.level_difference:+z.1f} dB"
    title = f"{b.sensor}, {b.low:.0f}-{b.high:.0f} Hz: {level}, fit {b.fit:z.0f} %{by_chance}"
    chart = Chart(
        Axis(float(b.time[0]), float(b.time[-1]), "time from the first axle [s]"),
        Axis(-reach, reach, "acceleration [m/s²]"),
        title,
        width=462,
    )
    for (name, style), values in zip(SERIES, (b.recorded, b.simulated)):
        chart.line(b.time[::step], values[::step], style, name)
    return chart.svg()


def _density_chart(b: BandComparison) -> str:
    is_positive = b.frequency > 0.0
    densities = [d[is_positive] for d in (b.recorded_density, b.simulated_density)]
    top = float(max(d.max() for d in densities))
    chart = Chart(
        Axis(b.low, b.high, "frequency [Hz]"),
        Axis(1e-6 * top, 2.0 * top, "power density [(m/s²)²/Hz]", "log"),
        f"{b.sensor}, {b.low:.0f}-{b.high:.0f} Hz: power spectral density",
        width=462,
    )
    for (name, style), density in zip(SERIES, densities):
        chart.line(b.frequency[is_positive], np.maximum(density, 1e-6 * top), style, name)
    return chart.svg()
