"""The day a list is made for, and all of its rows: views have no clock, who asks them has."""

from datetime import UTC, datetime, timedelta

CHARTS = """
    select count(*), count(*) filter (state = 'suppressed'), count(*) filter (state = 'not measured'), newest_charted()
    from chart_states_on({})"""


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


def counts_of(connection, day: str) -> tuple:
    """(charts, those silenced, those not measured for too long, newest campaign or None) on ``day``, as SQL."""
    return connection.execute(CHARTS.format(day)).fetchall()[0]


def of_then(newest: datetime, option: str, what: str) -> str:
    """Sentence for a list of today on which charts have grown old: how the one of the last data is asked for."""
    then = (newest + timedelta(days=1)).date()  # the day after, for a day begins at midnight
    today = f"As of {datetime.now(UTC):%Y-%m-%d}; the last data are of {newest:%Y-%m-%d}"
    return f"{today}: {option} {then} shows the {what} of then."
