"""Make a digest per unit of the notes beside its files that change its result: its campaign and the trains."""

import re
from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta

from turnout.config import Campaign, TurnoutConfig
from turnout.config.events import parse_utc
from turnout.config.merge import digest
from turnout.records import Unit

MAX_CLOCK_DIFFERENCE = timedelta(hours=1)  # maximum difference between the clocks of a logger and of the train data
MAX_LOGGER_DIFFERENCE = 15.0  # s, between two loggers of a train: a second train does not follow as closely
MAX_WAY_TO_RIVAL = 4.0  # tolerances of a row, to a train that may compete for it: three and some seconds
MAX_FILE_DURATION = timedelta(days=2)  # maximum duration of one file of a continuous logger


def notes_of(turnout: TurnoutConfig, units: Sequence[Unit]) -> list[str]:
    """Digest of the notes of each unit; it changes when its campaign is corrected, or a train in its time.

    A file lasts until the next one begins; one of a continuous logger contains the trains of a day.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout with its notes.
    units : sequence of Unit
        Its units.

    Returns
    -------
    list of str
        One text per unit, "" without notes.
    """
    campaigns: dict[str, str] = {}
    trains = sorted(_trains_with_time(turnout.trains), key=lambda entry: entry[0])
    tolerance = turnout.settings["passage"].train_data_tolerance
    starts = sorted({time for u in units if not u.campaign and (time := start_of(u.label))})
    notes = []
    for unit in units:
        if unit.campaign:
            if unit.campaign not in campaigns:
                campaigns[unit.campaign] = digest(_campaign_text(turnout.campaigns[unit.campaign]))[:16]
            notes.append(campaigns[unit.campaign])
        else:
            notes.append(_trains_digest(start_of(unit.label), starts, trains, tolerance))
    return notes


def _campaign_text(campaign: Campaign) -> str:
    """The facts of a campaign in one line. Its wording is part of the keys of stored results: do not change it."""
    facts = {
        "date": campaign.date,
        "started_at": campaign.started_at,
        "rail_temperature": campaign.rail_temperature,
        "hammer_id": campaign.hammer_id,
        "tip": campaign.tip,
        "operator": campaign.operator,
        "noted": campaign.listed,
    }
    return f"Campaign({', '.join(f'{name}={value!r}' for name, value in facts.items())})"


def _trains_with_time(rows: Sequence[Mapping]) -> list[tuple[datetime, list]]:
    """(time, row) of the rows of trains.csv with a valid time in their first time column."""
    entries = []
    for row in rows:
        stamp = next((value for name, value in row.items() if name.endswith("_at_utc")), "")
        try:
            time = parse_utc(str(stamp)).replace(tzinfo=None)
        except ValueError:
            continue
        entries.append((time, sorted((k, str(v)) for k, v in row.items())))
    return entries


def start_of(label: str) -> datetime | None:
    """Start time of a passage file from its name.

    Parameters
    ----------
    label : str
        Label of its unit, which is a part of the path.

    Returns
    -------
    datetime or None
        Naive UTC; None without a valid time.
    """
    stamp = re.search(r"\d{8}T\d{6}Z", label)
    try:
        return datetime.strptime(stamp[0], "%Y%m%dT%H%M%SZ") if stamp else None
    except ValueError:  # digits that form no valid time
        return None


def _trains_digest(
    start: datetime | None, starts: list[datetime], trains: list[tuple[datetime, list]], tolerance: float
) -> str:
    """Digest of the trains during a file that begins at ``start``, "" without any.

    Files that start so near that a row may be theirs are part of it.
    """
    if start is None or not trains:
        return ""
    after = bisect_right(starts, start)
    end = min(starts[after] if after < len(starts) else start + MAX_FILE_DURATION, start + MAX_FILE_DURATION)
    first = bisect_left(trains, start - MAX_CLOCK_DIFFERENCE, key=lambda entry: entry[0])
    last = bisect_right(trains, end + MAX_CLOCK_DIFFERENCE, key=lambda entry: entry[0])
    if last <= first:
        return ""
    rivals = [s.isoformat() for s in starts_near(start, starts, tolerance)]
    rows = [row for _, row in trains[first:last]]
    return digest([rows, rivals] if rivals else rows)[:16]


def starts_near(start: datetime, starts: Sequence[datetime], tolerance: float) -> list[datetime]:
    """Starts of other trains that may have the row of the train data of one that starts at ``start``.

    A file that starts within ``MAX_LOGGER_DIFFERENCE`` is of the same train, from another logger.

    Parameters
    ----------
    start : datetime
        Start of a recording, naive UTC.
    starts : sequence of datetime
        Starts of all recordings, in order.
    tolerance : float
        Largest difference in time between a passage and its row. [s]

    Returns
    -------
    list of datetime
        In order.

    Examples
    --------
    >>> noon = datetime(2024, 5, 13, 12)
    >>> [s.second for s in starts_near(noon, [noon, noon.replace(second=3), noon.replace(second=40)], 90.0)]
    [40]
    """
    reach = timedelta(seconds=MAX_WAY_TO_RIVAL * tolerance)
    within_reach = starts[bisect_left(starts, start - reach) : bisect_right(starts, start + reach)]
    return [s for s in within_reach if abs((s - start).total_seconds()) > MAX_LOGGER_DIFFERENCE]
