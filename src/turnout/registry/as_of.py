"""SQL of the day for which a worklist or page is made; the views themselves use no clock."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import duckdb

CHART_COUNTS_SQL = """
    select count(*), count(*) filter (state = 'suppressed'), count(*) filter (state = 'not measured'), newest_charted()
    from chart_states_on({})"""


def list_day(connection: duckdb.DuckDBPyConnection, day: str | None = None) -> str:
    """SQL of the time for a list of ``day`` (YYYY-MM-DD, by default today), including all measurements of that day.

    A newer campaign in a chart moves the time on: then the clock of this machine is late. A single campaign dated ahead
    does not: on a list of 2099 all other charts would count as not measured for long.

    Parameters
    ----------
    connection : DuckDB connection
        An open registry.
    day : str or None
        Day, YYYY-MM-DD; None: today in UTC.

    Returns
    -------
    str
        SQL expression of a timestamp.
    """
    begin = f"timestamp '{day or f'{datetime.now(UTC):%Y-%m-%d}'}'"
    asked = f"greatest({begin}, newest_charted(), least(newest_measurement(), {begin} + interval 1 day))"
    return f"timestamp '{connection.execute(f'select ({asked})::varchar').fetchall()[0][0]}'"


def whole_list(day: str) -> str:
    """SQL of the worklist of ``day`` with all rows.

    Parameters
    ----------
    day : str
        Result of ``list_day``.

    Returns
    -------
    str
        SQL of a table function.
    """
    return f"worklist({day}, most := {2**62})"


def chart_in_words(chart: str) -> str:
    """What a chart follows, as people say it.

    Parameters
    ----------
    chart : str
        Column ``component`` of the worklist.

    Returns
    -------
    str
        In words.

    Examples
    --------
    >>> [chart_in_words(name) for name in ("ballast", "railpad_damping", "amplitude")]
    ['ballast', 'railpad damping', 'acceleration']
    """
    return chart.replace("amplitude", "acceleration").replace("_", " ")


def counts_of(connection: duckdb.DuckDBPyConnection, day: str) -> tuple[int, int, int, datetime | None]:
    """Numbers of charts on a day.

    Parameters
    ----------
    connection : DuckDB connection
        An open registry.
    day : str
        Result of ``list_day``.

    Returns
    -------
    (int, int, int, datetime or None)
        Number of charts, of suppressed ones, of those not measured for too long, and the newest campaign.
    """
    return connection.execute(CHART_COUNTS_SQL.format(day)).fetchall()[0]


def past_day_hint(newest: datetime, option: str, what: str) -> str:
    """Sentence for a list with charts not measured lately: how to get the list of the last data.

    Parameters
    ----------
    newest : datetime
        Time of the newest campaign.
    option : str
        Option of the command line that sets the day.
    what : str
        What is shown, for example "list".

    Returns
    -------
    str
        The sentence.
    """
    then = (newest + timedelta(days=1)).date()  # the day after, because a day begins at midnight
    return f"The last data are of {newest:%Y-%m-%d}: {option} {then} shows the {what} of that day."
