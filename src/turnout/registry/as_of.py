"""SQL of the day for which a worklist or page is made; the views themselves use no clock."""

from datetime import UTC, datetime, timedelta

CHART_COUNTS_SQL = """
    select count(*), count(*) filter (state = 'suppressed'), count(*) filter (state = 'not measured'), newest_charted()
    from chart_states_on({})"""


def list_day(connection, day: str | None = None) -> str:
    """SQL of the time for a list of ``day`` (YYYY-MM-DD, by default today), including all measurements of that day.

    A newer campaign in a chart moves the time on: then the clock of this machine is late. A single campaign dated ahead
    does not: on a list of 2099 all other charts would count as not measured for long.
    """
    begin = f"timestamp '{day or f'{datetime.now(UTC):%Y-%m-%d}'}'"
    asked = f"greatest({begin}, newest_charted(), least(newest_measurement(), {begin} + interval 1 day))"
    return f"timestamp '{connection.execute(f'select ({asked})::varchar').fetchall()[0][0]}'"


def whole_list(day: str) -> str:
    """SQL of the worklist of ``day`` with all rows."""
    return f"worklist({day}, most := {2**62})"


def counts_of(connection, day: str) -> tuple:
    """(number of charts, suppressed ones, those not measured for too long, newest campaign or None) on ``day``, SQL."""
    return connection.execute(CHART_COUNTS_SQL.format(day)).fetchall()[0]


def past_day_hint(newest: datetime, option: str, what: str) -> str:
    """Sentence for a list of today with charts not measured lately: how to get the list of the last data."""
    then = (newest + timedelta(days=1)).date()  # the day after, because a day begins at midnight
    today = f"As of {datetime.now(UTC):%Y-%m-%d}; the last data are of {newest:%Y-%m-%d}"
    return f"{today}: {option} {then} shows the {what} of then."
