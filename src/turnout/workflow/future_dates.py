"""Recordings that are dated in the future: the clock of a logger, or the name of a file or folder, is wrong."""

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta

from turnout.counts import first_texts
from turnout.errors import ReadError
from turnout.records import Unit
from turnout.workflow.notes import start_of

TOLERANCE = timedelta(days=1)
REMEDY = "Correct the date, or the clock of this machine"
MAX_NAMED_FILES = 1


def is_future(moment: datetime) -> bool:
    """Whether a time is more than a day after now, in any time zone.

    Parameters
    ----------
    moment : datetime
        Naive UTC.

    Returns
    -------
    bool
    """
    return moment > datetime.now(UTC).replace(tzinfo=None) + TOLERANCE


def up_to_now(units: Iterable[Unit]) -> list[Unit]:
    """Units that are not dated in the future; all, if every one is: then the clock of this machine is late.

    Parameters
    ----------
    units : iterable of Unit
        Hammer tests and passages of one turnout.

    Returns
    -------
    list of Unit
    """
    units = list(units)
    return [unit for unit in units if not _is_dated_in_future(unit)] or units


def future_files(units: Iterable[Unit]) -> Iterator[ReadError]:
    """Files that are dated in the future.

    Parameters
    ----------
    units : iterable of Unit
        Hammer tests and passages of one turnout.

    Yields
    ------
    ReadError
        One for each day.
    """
    by_day: dict[str, list[str]] = {}
    units = list(units)
    for unit in filter(_is_dated_in_future, units):
        by_day.setdefault(f"{_date_of(unit):%Y-%m-%d}", []).extend(path for path, *_ in unit.files)
    is_used = len(up_to_now(units)) == len(units)
    for day, paths in sorted(by_day.items()):
        finding = f"{day} is in the future" + ("" if is_used else ": no visit of a diagnosis has these recordings")
        yield ReadError(first_texts(sorted(paths), MAX_NAMED_FILES), "date", finding, REMEDY)


def _is_dated_in_future(unit: Unit) -> bool:
    date = _date_of(unit)
    return date is not None and is_future(date)


def _date_of(unit: Unit) -> datetime | None:
    """Day of the campaign, or time of a passage in UTC; None without a valid one."""
    return datetime.fromisoformat(unit.campaign) if unit.campaign else start_of(unit.label)
