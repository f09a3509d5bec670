"""The panels of one passage: recording and prediction, two wheelsets, and a spectrogram with a line per axle."""

from importlib import resources
from types import SimpleNamespace

import numpy as np
import pytest

from turnout.cli.passage import _write_page
from turnout.passage.channel_fit import ChannelFit
from turnout.records import Channel, Recording
from turnout.report.passage_page import SensorPassage, passage_page, spectrogram, spectrogram_panel

RATE = 5000.0
TIME = np.arange(10000) / RATE
AXLES = np.array([0.8, 0.85, 1.2, 1.25])


def tone(low, high):
    """A tone of 208.3 Hz before 1 s and of 604.2 Hz after it, both in the middle of a cell."""
    f, g = 5000.0 / 24, 14500.0 / 24
    return np.where(TIME < 1.0, low * np.sin(2 * np.pi * f * TIME), high * np.sin(2 * np.pi * g * TIME))


def test_the_spectrogram_shows_a_tone_at_its_time_and_frequency():
    level, time, frequency = spectrogram(SensorPassage("A7", tone(1.0, 2.0), RATE, AXLES))
    assert time[0] >= 0.5 and time[-1] <= 1.55 and frequency[-1] <= 1000.0
    loudest = frequency[np.argmax(level, axis=0)]
    step = frequency[1] - frequency[0]
    assert np.all(np.abs(loudest[time < 0.97] - 208.3) <= step) and np.all(np.abs(loudest[time > 1.03] - 604.2) <= step)
    gain = level[:, time > 1.03].max(axis=0).mean() - level[:, time < 0.97].max(axis=0).mean()
    assert gain == pytest.approx(20 * np.log10(2.0), abs=0.2)


def test_the_spectrogram_has_a_line_for_every_axle():
    svg = spectrogram_panel(SensorPassage("A7", tone(1.0, 1.0), RATE, AXLES))
    assert svg.count('class="limit"') == len(AXLES)


def test_the_page_has_whole_passage_two_wheelsets_and_spectrogram():
    fit = ChannelFit("accepted", times=AXLES + 0.002, measured=tone(1.0, 1.0)[2500:], predicted=tone(0.5, 0.5)[2500:],
                     start=0.5)  # fmt: skip
    sensors = [SensorPassage("A7", tone(1.0, 1.0), RATE, AXLES, fit), SensorPassage("A8", tone(1.0, 1.0), RATE, AXLES)]
    page = passage_page("train.h5", ["IC3, 160 km/h"], sensors)
    for words in (
        "A7: whole passage",
        "A7: first two wheelsets",
        "A7: spectrogram",
        "A8: spectrogram",
        "IC3, 160 km/h",
    ):
        assert words in page
    assert "A8: whole passage" not in page and "no model of its section was fitted" in page
    assert page.count(">measured<") >= 2 and page.count(">predicted<") >= 2


@pytest.mark.parametrize(
    "template", sorted((resources.files("turnout.report") / "templates").iterdir()), ids=lambda path: path.name
)
def test_a_page_with_series_has_the_script_that_draws_their_legends(template):
    """Bars and lines of the fleet have their words in the SVG or beside it."""
    text = template.read_text(encoding="utf-8")
    page_has_charts = template.name in ("beams.html", "comparison.html", "finding.html", "passage.html", "turnout.html")
    assert ("<script>{{ chart_script|safe }}</script>" in text) == page_has_charts


def test_the_title_of_the_page_has_the_turnout_and_the_file(tmp_path):
    recording = Recording(tone(1.0, 1.0)[None], RATE, (Channel("A7", "acceleration"),), source="20260513T090000Z.h5")
    page = tmp_path / "page.html"
    _write_page(str(page), "t1", recording, SimpleNamespace(at_sensor={"A7": AXLES}), {}, [])
    assert "<title>t1, 20260513T090000Z.h5</title>" in page.read_text() and "<h1>t1, 2026" in page.read_text()
