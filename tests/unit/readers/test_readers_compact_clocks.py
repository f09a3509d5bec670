"""Starts with a time of day without colons, date-time groups, and starts that a line repeats for each channel."""

from datetime import datetime

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "Force", "force"), RawChannel("rail", "Rail", "acceleration"))
SAMPLES = np.random.default_rng(1).normal(size=(200, 2)).round(4)
ROWS = "".join(f"{k / 20000:.5f};{f};{r}\n" for k, (f, r) in enumerate(SAMPLES))


def read_head(tmp_path, head):
    (tmp_path / "a.csv").write_text(f"{head}\nTime [s];Force [N];Rail [m/s²]\n{ROWS}", "utf-8")
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=20000.0, time_zone="Europe/Zurich"))
    return result.recordings[0].started_at, [error.reason for error in result.errors]


@pytest.mark.parametrize("name", ["Start", "Start time", "started_at"])
@pytest.mark.parametrize(
    ("text", "second"),
    [
        ("2026-05-13 0820Z", 0),
        ("2026-05-13T082030Z", 30),
        ("2026-05-13 1020", 0),
        ("2026/05/13 102030", 30),
        ("13.05.2026 102030.5", 30.5),
        ("13 May 2026 1020", 0),
        ("13-May-2026 102030", 30),
        ("2026-05-13 1020 +0200", 0),
        ("130820ZMAY2026", 0),
        ("131020B MAY 26", 0),
        ("13 0320R May 2026", 0),
    ],
)
def test_a_time_of_day_needs_no_colons(name, text, second, tmp_path):
    start = datetime(2026, 5, 13, 8, 20, int(second), int(1e6 * (second % 1)))
    assert read_head(tmp_path, f"{name}: {text}") == (start, [])


@pytest.mark.parametrize("fraction", ["1200", "1234", "102030", "235959"])
@pytest.mark.parametrize(
    "text", ["2026-05-13T10:20:30,{}", "13.05.2026 10:20:30,{}", "2026-05-13T08:20:30,{}Z", "13-May-2026 10:20:30,{}"]
)
def test_digits_behind_a_time_of_day_are_its_fraction(text, fraction, tmp_path):
    start = datetime(2026, 5, 13, 8, 20, 30, int(fraction.ljust(6, "0")))
    assert read_head(tmp_path, f"Start time: {text.format(fraction)}") == (start, [])


@pytest.mark.parametrize("text", ["2026-05-13 2520", "2026-05-13 0861Z", "320820ZMAY2026", "130820ZMAYO2026"])
def test_a_time_of_day_that_no_clock_shows_is_no_start(text, tmp_path):
    assert read_head(tmp_path, f"Start time: {text}")[0] is None


@pytest.mark.parametrize("mark", [";", "\t", ","])
@pytest.mark.parametrize("text", ["13-May-2026 10:20:30", "2026-05-13 10:20:30", "13.05.2026 10:20:30"])
def test_a_line_may_repeat_the_start_for_each_channel(text, mark, tmp_path):
    assert read_head(tmp_path, mark.join(("Start time", text, text))) == (datetime(2026, 5, 13, 8, 20, 30), [])
