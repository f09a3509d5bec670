"""The day a list is made for, and all of its rows: views have no clock, who asks them has."""

from datetime import UTC, datetime


def list_day() -> str:
    """SQL of the time a list of today is asked for: that of the newest measurement where that is later."""
    return f"greatest(newest_measurement(), timestamp '{datetime.now(UTC):%Y-%m-%d}')"


def whole_list(day: str) -> str:
    """SQL of the worklist of ``day`` with every row, however many they are."""
    return f"worklist({day}, most := {2**62})"
