"""Starts in the words of China, Japan and Korea, with a zone in brackets, and origins with an offset from UTC."""

from datetime import UTC, datetime

import pytest
from test_readers_notations_of_starts import LAYOUT, START, WRITERS

from turnout.readers import read
from turnout.readers.stamp_texts import with_western_marks
from turnout.readers.time_numbers import time_of_number

STAMPS = [
    *["2026年5月13日 08:30:12.250", "2026年05月13日08时30分12.250秒", "2026年5月13日(水) 8時30分12.250秒"],
    *["2026년 5월 13일 08:30:12.250", "2026년 5월 13일 오전 8:30:12.250", "2026. 5. 13. 오전 8:30:12.250"],
    *["2026/5/13 上午 8:30:12.250", "2026. 05. 13. 08:30:12.250", "2026-05-13T10:30:12.250+02:00[Europe/Paris]"],
    *["2026-05-13T08:30:12.250Z[UTC]"],
]


def only_result(tmp_path, write, name, value):
    write(tmp_path / "a", name, value)
    (path,) = tmp_path.iterdir()
    return read(path.name, tmp_path, LAYOUT)


@pytest.mark.parametrize("write", WRITERS)
@pytest.mark.parametrize("stamp", STAMPS)
def test_a_start_in_these_words_is_read(write, stamp, tmp_path):
    result = only_result(tmp_path, write, "start_time", stamp)
    assert (result.recordings[0].started_at, result.errors) == (START, ())


@pytest.mark.parametrize("name", ["开始时间", "測定開始", "시작"])
@pytest.mark.parametrize("stamp", [s for s in STAMPS if not s.endswith("]")])
def test_such_a_time_under_an_unknown_name_is_reported(name, stamp, tmp_path):
    (error,) = only_result(tmp_path, WRITERS[0], name, stamp).errors
    assert (error.reason, name in error.problem) == ("start_unknown", True)


@pytest.mark.parametrize("stamp", ["2026年2月30日 08:30:12", "2026年13月1日 08:30:12", "令和8年5月13日 08:30:12"])
def test_a_day_that_no_calendar_has_is_reported(stamp, tmp_path):
    result = only_result(tmp_path, WRITERS[0], "start_time", stamp)
    assert result.recordings[0].started_at is None
    assert [error.reason for error in result.errors] == ["start_unknown"]


@pytest.mark.parametrize("text", ["5 点", "Gleis 3: 08:30", "2026年", "10 分", "测点 3"])
def test_words_without_a_time_stay(text):
    assert with_western_marks(text) == text


@pytest.mark.parametrize(
    ("offset", "hour", "minute"),
    [(" +02:00", 6, 30), ("+0200", 6, 30), (" -5:30", 14, 0), (" +2", 6, 30), (" -0:30", 9, 0), (" UTC", 8, 30)],
)
def test_an_origin_may_have_an_offset(offset, hour, minute):
    time, _ = time_of_number(10.0, f"seconds since 2026-05-13 08:30:00{offset}")
    assert time == datetime(2026, 5, 13, hour, minute, 10, tzinfo=UTC)


@pytest.mark.parametrize("offset", [" +19:00", " +02:07", " CET"])
def test_an_offset_of_no_zone_is_no_origin(offset):
    assert time_of_number(10.0, f"seconds since 2026-05-13 08:30:00{offset}")[0] is None
