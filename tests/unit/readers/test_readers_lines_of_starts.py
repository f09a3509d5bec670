"""Starts in lines above the numbers as people write them: without a mark, in two cells, as a bare number."""

import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

LAYOUT = RawDescription(
    (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")), rate=20000.0,
    time_zone="Europe/Zurich",
)  # fmt: skip
ROWS = "".join(f"{k % 7}.5;{k % 11}.25\n" for k in range(64))
START = "2026-05-13T08:20:30"  # of 10:20:30 in Zurich


def read_head(head, tmp_path):
    (tmp_path / "a.csv").write_text(f"{head}\nrate: 20000\nforce [N];rail [m/s\u00b2]\n{ROWS}")
    result = read("a.csv", tmp_path, LAYOUT)
    (recording,) = result.recordings
    return recording.started_at and recording.started_at.isoformat(), result.errors


@pytest.mark.parametrize(
    "head",
    [
        "# start 2026-05-13 10:20:30\nDate: 2026-05-13",
        "Start 10:20:30\nDate: 13.05.2026",
        "Start: 13.05.2026 10:20:30",
        "Date 13/05/2026\nTime 10:20:30",
        "# start 05/13/2026 10:20:30",
        "Start 05/13/2026 10:20:30 AM",
        "Measurement started Wed May 13 2026 10:20:30",
        "started on 13.05.2026 10.20.30",
        "Messbeginn 13.05.2026 um 10:20:30 Uhr",
        "Start;13.05.2026;10:20:30",
        "Start;13.05.2026;10:20:30 MESZ",
        "Start date: 13/05/2026\nStart time: 10:20:30",
        "Start: 2026-05-13 10:20:30 CEST",
        "Start: 2026-05-13 11:20:30 Europe/Helsinki",
        "Start: 2026-05-13 10:20:30 GMT+2",
        "Start: 1778660430",
    ],
)
def test_a_line_states_the_start(head, tmp_path):
    """Formerly, "start 2026-05-13 10:20:30" had the value "20:30", which was used with another date."""
    assert read_head(head, tmp_path) == (START, ())


@pytest.mark.parametrize(
    ("head", "words"),
    [
        ("Start: 46155.4", "days since 1899-12-30 or days since 1904-01-01?"),
        ("start 05/13/2026", "has no time of day"),
        ("Start: 05/04/2026 10:20:30", "cannot be read"),
        ("Start: 2026-05-13 10:20:30 XYZ", "cannot be read"),
        ("Start 99/99/2026 10:20:30", "cannot be read"),
    ],
)
def test_a_start_that_cannot_be_read_is_reported(head, words, tmp_path):
    start, (error,) = read_head(head, tmp_path)
    assert start is None and error.reason == "start_unknown" and words in error.problem


def test_an_abbreviation_that_does_not_belong_to_the_zone_of_the_layout_is_reported(tmp_path):
    start, (error,) = read_head("Start: 2026-05-13 10:20:30 CET", tmp_path)
    assert start == START and "time zone 'CET' cannot be read" in error.problem


@pytest.mark.parametrize(
    "head",
    [
        "Calibrated 05/13/2025 10:20:30", "Start of export 2026-05-13 10:20:30", "Start: 1024", "Start: 46155",
        "Start position: 24.6", "Messdatum: 13.05.2026", "Operator since 13.05.2020",
    ],
)  # fmt: skip
def test_other_dates_and_numbers_are_not_read_as_a_start(head, tmp_path):
    assert read_head(head, tmp_path) == (None, ())
