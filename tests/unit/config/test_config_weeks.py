"""Weeks of ISO 8601 in cells and options for a day: Python reads 2026-W20 as its Monday."""

import pytest

from turnout.config.events import day_problem, parse_utc, time_problem


@pytest.mark.parametrize("text", ["2026-W20", "2026-W20-3", "2026W203", "2026-w20-3"])
def test_a_week_is_no_day(text):
    assert day_problem(text) == ("", "Write YYYY-MM-DD")


@pytest.mark.parametrize("text", ["2026-W20", "2026-W20-3", "2026-W20-3T10:00", "2026W203T10:00Z"])
def test_a_week_is_no_time(text):
    assert time_problem(text) == ("", "Write YYYY-MM-DD or YYYY-MM-DDTHH:MM in UTC")
    with pytest.raises(ValueError):
        parse_utc(text)


@pytest.mark.parametrize("text", ["2026-05-13", "20260513", "2026-05-13T10:00", "2026-05-13 10:00 UTC"])
def test_days_are_read_as_before(text):
    assert time_problem(text) is None and parse_utc(text).date().isoformat() == "2026-05-13"
