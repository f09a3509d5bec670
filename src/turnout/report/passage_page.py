"""Draw a passage at each sensor: measured and predicted, whole and two wheelsets, and a spectrogram with axles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from turnout.report.axis import Axis
from turnout.report.site import page_environment, shared_by_pages
from turnout.report.svg import Chart

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.passage.channel_fit import ChannelFit

SHADES = ("#eff3ff", "#c6dbef", "#9ecae1", "#6baed6", "#4292c6", "#2171b5", "#084594")  # weak to strong
DECIBELS_PER_SHADE = 6.0
N_TIME, N_FREQUENCY = 120, 48  # cells of a spectrogram
MAX_FREQUENCY = 1000.0  # Hz
ZOOM_LEAD, ZOOM_TAIL = 0.02, 0.06  # s around two wheelsets


@dataclass(frozen=True)
class SensorPassage:
    """One sensor of a passage: ``samples`` (n,) [m/s²] at ``rate`` [Hz], ``axles`` (n_axle,) [s], and any fit."""

    name: str
    samples: np.ndarray
    rate: float
    axles: np.ndarray
    fit: ChannelFit | None = None


def passage_page(title: str, lines: Sequence[str], sensors: Sequence[SensorPassage]) -> str:
    """A page of one passage.

    Parameters
    ----------
    title : str
        Turnout and name of the recording.
    lines : sequence of str
        The train in words.
    sensors : sequence of SensorPassage
        What each sensor recorded.

    Returns
    -------
    str
        HTML in one file.
    """
    parts = [(s.name, _fit_words(s), "".join(_panels(s))) for s in sensors]
    template = page_environment().get_template("passage.html")
    return template.render(title=title, lines=lines, parts=parts, **shared_by_pages())


def _fit_words(sensor: SensorPassage) -> str:
    fit = sensor.fit
    if fit is None or fit.scores is None or fit.null is None:
        return "no model of its section was fitted"
    return (
        f"fit {fit.scores.fit:.1f} %, random models {fit.null.fit:.1f} %; "
        f"forecast {fit.scores.forecast:.1f} %, random models {fit.null.forecast:.1f} %"
    )


def _panels(sensor: SensorPassage) -> list[str]:
    """The whole passage, two wheelsets, and the spectrogram."""
    panels = []
    if sensor.fit is not None and sensor.fit.measured.size:
        time = sensor.fit.start + np.arange(sensor.fit.measured.size) / sensor.rate
        panels.append(_fit_chart(sensor, time, float(time[0]), float(time[-1]), "whole passage"))
        if sensor.axles.size > 1:
            low, high = float(sensor.axles[0]) - ZOOM_LEAD, float(sensor.axles[1]) + ZOOM_TAIL
            panels.append(_fit_chart(sensor, time, low, high, "first two wheelsets"))
    panels.append(spectrogram_panel(sensor))
    return panels


def _fit_chart(sensor: SensorPassage, time: np.ndarray, low: float, high: float, words: str) -> str:
    """Measured and predicted acceleration between two times."""
    assert sensor.fit is not None
    inside = (time >= low) & (time <= high)
    measured, predicted = sensor.fit.measured[inside], sensor.fit.predicted[inside]
    reach = 1.05 * float(max(np.abs(measured).max(), np.abs(predicted).max(), 1e-9))
    chart = Chart(
        Axis(low, high, "time [s]"), Axis(-reach, reach, "acceleration [m/s²]"), f"{sensor.name}: {words}", width=462
    )
    chart.line(time[inside], measured, "measured", "measured")
    chart.line(time[inside], predicted, "curve", "predicted")
    for moment in sensor.fit.times[(sensor.fit.times >= low) & (sensor.fit.times <= high)]:
        chart.vertical(float(moment), "event mild")
    return chart.svg()


def spectrogram_panel(sensor: SensorPassage) -> str:
    """Power of a sensor over time and frequency, with a line per axle.

    Parameters
    ----------
    sensor : SensorPassage
        What the sensor recorded.

    Returns
    -------
    str
        SVG.
    """
    level, time, frequency = spectrogram(sensor)
    step_t, step_f = float(time[1] - time[0]), float(frequency[1] - frequency[0])
    top = float(level.max())
    chart = Chart(
        Axis(float(time[0]) - step_t / 2, float(time[-1]) + step_t / 2, "time [s]"),
        Axis(0.0, float(frequency[-1]) + step_f / 2, "frequency [Hz]"),
        f"{sensor.name}: spectrogram, {DECIBELS_PER_SHADE:g} dB per shade; lines: axles",
    )
    shade = len(SHADES) - 1 - ((top - level) // DECIBELS_PER_SHADE).astype(int)
    for k, colour in enumerate(SHADES):
        cells = []
        for i, j in zip(*np.nonzero(shade == k)):
            left, right = chart.px(np.array([time[j] - step_t / 2, time[j] + step_t / 2]))
            low, high = chart.py(np.array([max(frequency[i] - step_f / 2, 0.0), frequency[i] + step_f / 2]))
            cells.append(f"M{left:.1f} {high:.1f}H{right:.1f}V{low:.1f}H{left:.1f}Z")
        if cells:
            chart.elements.append(f'<path fill="{colour}" d="{"".join(cells)}"/>')
    for moment in sensor.axles:
        chart.vertical(float(moment), "limit")
    return chart.svg()


def spectrogram(sensor: SensorPassage) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Level of the power over time and frequency.

    Parameters
    ----------
    sensor : SensorPassage
        What the sensor recorded.

    Returns
    -------
    level : (n_frequency, n_time) array of float
        Power spectral density. [dB re 1 (m/s²)²/Hz]
    time : (n_time,) array of float
        Middle of each window. [s]
    frequency : (n_frequency,) array of float
        Up to ``MAX_FREQUENCY``. [Hz]
    """
    margin = 0.3
    start = max(int((sensor.axles.min() - margin) * sensor.rate), 0)
    stop = min(int((sensor.axles.max() + margin) * sensor.rate), sensor.samples.size)
    excerpt = sensor.samples[start:stop]
    length = min(max(16, round(sensor.rate * N_FREQUENCY / (2.0 * MAX_FREQUENCY)) * 2), excerpt.size)
    hop = max(1, (excerpt.size - length) // N_TIME)
    frequency, time, density = scipy.signal.spectrogram(
        excerpt, sensor.rate, window="hann", nperseg=length, noverlap=length - min(hop, length), mode="psd"
    )
    in_range = frequency <= MAX_FREQUENCY
    return 10.0 * np.log10(np.maximum(density[in_range], 1e-12)), time + start / sensor.rate, frequency[in_range]
