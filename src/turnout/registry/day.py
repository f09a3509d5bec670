"""The day a list is made for, and all of its rows: views have no clock, who asks them has."""

from datetime import UTC, datetime


def list_day(connection, day: str | None = None) -> str:
    """SQL of the time a list of ``day`` (YYYY-MM-DD, by default today) is asked for: with all that was measured in it.

    A newer campaign that a chart rests on counts, too: then the clock of this machine is late. One that is dated
    ahead alone does not: a list of 2099 would hold nothing but charts that nobody has measured for long.
    """
    begin = f"timestamp '{day or f'{datetime.now(UTC):%Y-%m-%d}'}'"
    asked = f"greatest({begin}, newest_charted(), least(newest_measurement(), {begin} + interval 1 day))"
    return f"timestamp '{connection.execute(f'select ({asked})::varchar').fetchall()[0][0]}'"


def whole_list(day: str) -> str:
    """SQL of the worklist of ``day`` with every row, however many they are."""
    return f"worklist({day}, most := {2**62})"
