"""Zones by abbreviation and in words: read if they are those of the layout, else reported, never another zone."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
ROWS = "".join(f"{f:.4f};{r:.4f}\n" for f, r in np.random.default_rng(1).normal(size=(400, 2)))
UNREAD = "None"


def start_and_remarks(tmp_path, head, time_zone):
    (tmp_path / "a.csv").write_text(f"{head}\nforce;rail\n{ROWS}")
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=5000.0, time_zone=time_zone))
    return str(result.recordings[0].started_at), [error.problem for error in result.errors]


@pytest.mark.parametrize(
    ("stamp", "time_zone", "utc"),
    [
        ("2026-05-13 18:30 EDT", "America/New_York", "22:30"), ("2026-01-13 18:30 EST", "America/New_York", "23:30"),
        ("2026-01-13 18:30:00 PST", "America/Los_Angeles", "02:30"),
        ("2026-05-13 18:30 (EDT)", "America/New_York", "22:30"),
        ("2026-05-13 6:30 PM EDT", "America/New_York", "22:30"), ("2026-05-13 18:30 JST", "Asia/Tokyo", "09:30"),
        ("2026-05-13 18:30 IST", "Asia/Kolkata", "13:00"), ("2026-05-13 18:30 AEST", "Australia/Sydney", "08:30"),
        ("Wed May 13 18:30:00 EDT 2026", "America/New_York", "22:30"),
        ("Wed May 13 18:30:00 CEST 2026", "Europe/Zurich", "16:30"),
        ("2026-05-13 18:30 W. Europe Standard Time", "Europe/Zurich", "16:30"),
        ("2026-05-13 18:30 Eastern Daylight Time", "America/New_York", "22:30"),
    ],
)  # fmt: skip
def test_a_zone_of_the_layout_behind_the_start_is_read(stamp, time_zone, utc, tmp_path):
    start, remarks = start_and_remarks(tmp_path, f"Start: {stamp}", time_zone)
    assert start[11:16] == utc and not remarks


@pytest.mark.parametrize(
    "zone", ["EDT", "PST", "IST", "MSK", "B", "XYZ", "EST5EDT", "Eastern Daylight Time", "Eastern Standard Time"]
)
def test_another_zone_behind_the_start_is_not_read_as_that_of_the_layout(zone, tmp_path):
    start, remarks = start_and_remarks(tmp_path, f"Start: 2026-05-13 18:30 {zone}", "Europe/Copenhagen")
    assert start == UNREAD and len(remarks) == 1 and "not known to be that of the layout" in remarks[0]


@pytest.mark.parametrize("name", ["Start (EDT)", "Start [PST]", "Start time EST", "Start (IST)", "Recorded at MSK"])
def test_a_zone_in_the_name_of_the_start_is_compared_with_the_layout(name, tmp_path):
    _, remarks = start_and_remarks(tmp_path, f"{name}: 2026-05-13 18:30:00", "Europe/Copenhagen")
    assert len(remarks) == 1 and "its time zone" in remarks[0]
    zone = name.strip(")]")[-3:]
    home = {"EDT": "America/New_York", "MSK": "Europe/Moscow", "IST": "Asia/Kolkata"}.get(zone)
    if home:
        assert start_and_remarks(tmp_path, f"{name}: 2026-05-13 18:30:00", home)[1] == []


@pytest.mark.parametrize("name", ["Time zone", "Clock"])
@pytest.mark.parametrize(
    ("zone", "time_zone", "is_layout"),
    [
        ("Eastern Daylight Time", "Europe/Copenhagen", False), ("Eastern Daylight Time", "America/New_York", True),
        ("Central European Summer Time", "Europe/Copenhagen", True), ("EDT", "Europe/Copenhagen", False),
        ("W. Europe Standard Time", "Europe/Copenhagen", True), ("Tokyo Standard Time", "Europe/Copenhagen", False),
        ("Central European Summer Time", "Europe/Helsinki", False), ("JST", "Europe/Copenhagen", False),
    ],
)  # fmt: skip
def test_a_zone_in_words_is_more_than_its_season(name, zone, time_zone, is_layout, tmp_path):
    _, remarks = start_and_remarks(tmp_path, f"Start: 2026-05-13 18:30:00\n{name}: {zone}", time_zone)
    assert (not remarks) == is_layout


@pytest.mark.parametrize(("zone", "utc"), [("UT", "18:30"), ("Z", "18:30"), ("+0530", "13:00"), ("UTC+2", "16:30")])
def test_an_offset_is_read_in_any_layout(zone, utc, tmp_path):
    start, remarks = start_and_remarks(tmp_path, f"Start: 2026-05-13 18:30:00 {zone}", "Asia/Tokyo")
    assert start[11:16] == utc and not remarks
