"""Withdrawn alarms stay in the table as closed alarms, also after later alarms of their chart."""

import pandas as pd
import pytest

from turnout.trend.alarms import ALARM_KEYS, with_withdrawn
from turnout.trend.times import days

NEWEST = days(["2026-09-07"])[0]


def alarms(*rows, section="T1/A", direction="down"):
    """Rows (raised, closed, by whom) of one chart."""
    chart = dict(zip(ALARM_KEYS, ("T1", section, "ballast", "hammer", direction)))
    times = [
        chart
        | {
            "alarm_id": f"{section}:{direction}:{raised}",
            "raised_at_utc": pd.Timestamp(raised),
            "closed_at_utc": pd.Timestamp(closed),
            "closed_by": by,
        }
        for raised, closed, by in rows
    ]
    return pd.DataFrame(times)


def history_of(frame):
    """(day of raising, day of closing, cause of closing) of all rows."""
    found = frame.sort_values(["raised_at_utc", "alarm_id"])[["raised_at_utc", "closed_at_utc", "closed_by"]]
    return [tuple(None if pd.isna(v) else str(v)[:10] for v in row) for row in found.itertuples(index=False)]


@pytest.mark.parametrize("closed", [None, "2026-08-03"])
def test_a_later_alarm_of_a_chart_does_not_replace_the_row_of_a_withdrawn_alarm(closed):
    taken = alarms(("2025-01-06", "2025-03-03", "recomputed"))
    later = alarms(("2026-06-01", closed, closed and "recovered"))
    assert history_of(with_withdrawn(later, taken, NEWEST)) == [
        ("2025-01-06", "2025-03-03", "recomputed"),
        ("2026-06-01", closed, closed and "recovered"),
    ]


@pytest.mark.parametrize("raised", ["2025-01-06", "2024-12-30", "2025-02-03"])
def test_a_withdrawn_alarm_that_is_raised_again_within_its_time_has_one_row(raised):
    taken = alarms(("2025-01-06", "2025-03-03", "recomputed"))
    again = alarms((raised, None, None))
    assert history_of(with_withdrawn(again, taken, NEWEST)) == [(raised, None, None)]


def test_an_open_alarm_stays_the_same_if_its_start_moves_but_not_in_another_chart_or_direction():
    before = alarms(("2026-01-05", None, None))
    assert history_of(with_withdrawn(alarms(("2026-02-02", None, None)), before, NEWEST)) == [
        ("2026-02-02", None, None)
    ]
    for other in ({"section": "T1/B"}, {"direction": "up"}):
        assert history_of(with_withdrawn(alarms(("2026-02-02", None, None), **other), before, NEWEST)) == [
            ("2026-01-05", "2026-09-07", "recomputed"),
            ("2026-02-02", None, None),
        ]


def test_an_alarm_that_recovered_before_an_open_alarm_was_raised_is_a_different_one():
    before = alarms(("2026-01-05", None, None))
    early = alarms(("2025-03-03", "2025-06-02", "recovered"))
    assert history_of(with_withdrawn(early, before, NEWEST)) == [
        ("2025-03-03", "2025-06-02", "recovered"),
        ("2026-01-05", "2026-09-07", "recomputed"),
    ]
