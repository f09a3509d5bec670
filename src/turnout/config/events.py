"""Reader of config/events.csv: maintenance that starts a new epoch of a resonance."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from turnout.config.csv_table import TableError, read_csv, row_problem
from turnout.config.schema import NO_TURNOUT, suggestion
from turnout.errors import ConfigError

if TYPE_CHECKING:
    from turnout.config.merge import Variant

RENEWAL = "renewal"  # of the whole structure: what was measured before says nothing of what lies there now
# Resonances that start a new epoch after each kind of work, where the row does not name them.
RESETS = {
    "tamping": ("ballast",),
    "pad_exchange": ("railpad",),
    "rail_change": ("ballast", "railpad"),
    "grinding": (),
    "ballast_cleaning": ("ballast",),
    "sleeper_change": ("ballast", "railpad"),
    RENEWAL: ("ballast", "railpad"),
    "sensor_change": ("ballast", "railpad"),
    "method_change": ("ballast", "railpad"),
    "other": (),
}
FIRST_YEAR = 1900  # an earlier date of work is taken for a mistake
MAX_LEAD_TIME = timedelta(days=366)  # how far ahead work may be planned; a later date is taken for a mistake
NOON = 12  # h
DAY_LENGTH = len("2026-04-02")
UTC_MARK = re.compile(r"\s*(?:z|utc|gmt)$", re.IGNORECASE | re.ASCII)
BLANK_BEFORE_OFFSET = re.compile(r"\s+(?=[+-]\d{2}:?\d{2}$)", re.ASCII)
COLUMNS = ("turnout", "section", "date", "kind", "resets", "note")


@dataclass(frozen=True)
class Event:
    """``section`` is None for the whole turnout; ``resets`` holds "ballast" and "railpad"; ``at`` is UTC."""

    turnout: str
    section: str | None
    at: datetime
    kind: str
    resets: tuple[str, ...]
    note: str = ""

    @property
    def work(self) -> tuple[str, str | None, datetime, str]:
        """What identifies the work: turnout, section, time and kind."""
        return self.turnout, self.section, self.at, self.kind

    @property
    def first_day_after(self) -> date:
        """First day whose measurements lie after the work: of work from noon on it is the next day."""
        return self.at.date() + timedelta(days=self.at.hour >= NOON)


def read_events(
    path: Path, name: str, turnout_ids: Collection[str] | None, variants: Mapping[str, Variant]
) -> tuple[list[Event], list[ConfigError], list[ConfigError]]:
    """Read config/events.csv; without the file there are no events.

    An event of an unknown turnout is only a warning: the turnout may be misspelt, or it was removed and its history
    keeps its events.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        What errors call the file.
    turnout_ids : collection of str or None
        Ids of the turnouts; None if turnouts.tsv itself has errors: then turnouts are not checked.
    variants : mapping of str to Variant
        Merged configuration by turnout.

    Returns
    -------
    tuple of (list of Event, list of ConfigError, list of ConfigError)
        Events in order of time; errors of rows that cannot be used, or that contradict another row about the same work;
        warnings about unknown turnouts or sections, dates that cannot be right and rows that repeat another.
    """
    if not os.path.lexists(path):
        return [], [], []
    events: list[Event] = []
    try:
        table = read_csv(path, name, COLUMNS, n_required=4)
    except TableError as fault:
        return [], [fault.error], []
    errors = [fault.error for fault in table.faults]
    warnings: list[ConfigError] = []
    first_rows: dict[tuple, tuple[int, Event]] = {}
    for line, cells in table.rows:
        problems = list(_row_problems(cells))
        n_before = len(errors)
        errors += [cells.place(name, line, column).error(*problem) for column, *problem in problems]
        if problems:
            _note_turnout(cells, errors[n_before:])
            continue
        event = event_of(cells)
        first_line, first = first_rows.setdefault(event.work, (line, event))
        if first is not event:
            faults = warnings if first.resets == event.resets else errors
            faults.append(cells.place(name, line, "resets").error(*_repetition(first_line, first, event)))
            _note_turnout(cells, errors[n_before:])
            continue
        events.append(event)
        n_warnings = len(warnings)
        unknown_turnouts = turnout_problems(cells, turnout_ids, variants)
        warnings += [cells.place(name, line, column).error(*problem) for column, *problem in unknown_turnouts]
        if problem := date_problem(event):
            warnings.append(cells.place(name, line, "date").error(*problem))
        _note_turnout(cells, warnings[n_warnings:])
    return sorted(events, key=lambda e: (e.at, e.turnout, e.section or "", e.kind)), errors, warnings


def _note_turnout(cells: Mapping[str, str], errors: Iterable[ConfigError]) -> None:
    """Note in the errors of a row which turnout it is about."""
    for error in errors:
        error.turnouts = (cells["turnout"],)


def date_problem(event: Event) -> tuple[str, str] | None:
    """Problem and remedy of an event that is planned more than a year ahead, or lies before 1900.

    Parameters
    ----------
    event : Event
        The event.

    Returns
    -------
    tuple of (str, str) or None
        None for an event of the past or of the coming year.
    """
    if event.at.year < FIRST_YEAR:
        return f"date {event.at.date()} is before {FIRST_YEAR}", "Correct its year"
    if event.at <= now() + MAX_LEAD_TIME:
        return None
    return f"date {event.at:%Y-%m-%d} is more than a year ahead", "Correct it, or enter it nearer to its day"


def reset_remark(event: Event) -> str:
    """A remark on work that resets none of the resonances that its kind changes, "" without one.

    Parameters
    ----------
    event : Event
        The event.

    Returns
    -------
    str
        A sentence without its end.

    Examples
    --------
    >>> reset_remark(Event("t", None, datetime(2026, 4, 2), "tamping", ("railpad",)))
    'tamping changes the ballast resonance, and this row resets railpad alone: correct resets if this is wrong'
    """
    usual = RESETS[event.kind]
    if not usual or not event.resets or set(usual) & set(event.resets):
        return ""
    changed = f"the {' and '.join(usual)} resonance{'s' * (len(usual) > 1)}"
    resets = f"this row resets {event.resets[0]} alone"
    return f"{event.kind} changes {changed}, and {resets}: correct resets if this is wrong"


def _repetition(line: int, first: Event, second: Event) -> tuple[str, str]:
    """Problem and remedy of a row about the same work as the row in ``line``."""
    if first.resets == second.resets:
        return f"the same work as in line {line}", "Remove one of the rows"
    bands = (" and ".join(event.resets) or "nothing" for event in (first, second))
    problem = "line {} says that the same work resets {}, this line {}".format(line, *bands)
    return problem, "Correct one of the rows, and remove the other"


def _row_problems(cells: Mapping[str, str]) -> Iterator[tuple[str, str, str]]:
    """(column, problem, remedy) of every error in a row."""
    if line_problem := row_problem(cells):
        yield line_problem
        return
    if not cells["turnout"]:
        yield "turnout", "turnout is empty", "Write the id of the turnout"
    if problem := time_problem(cells["date"]):
        yield "date", f"date is {cells['date']!r}{problem[0]}", problem[1]
    if cells["kind"] not in RESETS:
        yield "kind", f"kind is {cells['kind']!r}", suggestion(cells["kind"], RESETS)
    if cells.get("resets", "").split() != ["none"] and "none" in cells.get("resets", "").replace("+", " ").split():
        yield "resets", f"resets is {cells['resets']!r}", "Write the resonances, or 'none' alone"
    if unknown := set(_reset_bands(cells)) - {"ballast", "railpad"}:
        yield "resets", f"resets is {cells['resets']!r}", suggestion(min(unknown), ("ballast", "railpad", "none"))


def turnout_problems(
    cells: Mapping[str, str], turnout_ids: Collection[str] | None, variants: Mapping[str, Variant]
) -> Iterator[tuple[str, str, str]]:
    """Errors in ``turnout`` and ``section`` of a row.

    Parameters
    ----------
    cells : mapping of str to str
        Text of the row by column.
    turnout_ids : collection of str or None
        Ids of the turnouts; None if turnouts.tsv itself has errors: then turnouts are not checked.
    variants : mapping of str to Variant
        Merged configuration by turnout.

    Yields
    ------
    tuple of (str, str, str)
        Column, problem and remedy; nothing if ``turnout_ids`` is None.
    """
    turnout, label = cells["turnout"], cells["section"].removeprefix(f"{cells['turnout']}/")
    if turnout_ids is not None and turnout not in turnout_ids:
        yield "turnout", f"turnout {turnout!r} has no row in turnouts.tsv", suggestion(turnout, turnout_ids, NO_TURNOUT)
    elif label and turnout in variants:
        labels = variants[turnout].tree["sections"]
        if label not in labels:
            yield "section", f"turnout {turnout!r} has no section {label!r}", suggestion(label, labels)


def time_problem(text: str) -> tuple[str, str] | None:
    """Error of a time that is not in UTC or not in ISO 8601.

    Parameters
    ----------
    text : str
        Text of the cell.

    Returns
    -------
    tuple of (str, str) or None
        Addition to the problem, and remedy; None for a valid time.

    Examples
    --------
    >>> time_problem("2026-04-02") is None, time_problem("2.4.2026")
    (True, ('', 'Write YYYY-MM-DD or YYYY-MM-DDTHH:MM in UTC'))
    >>> time_problem("2026-02-30T09:00")
    (', which is no day of the calendar', 'Write a day that exists')
    """
    try:
        time = parse_utc(text)
    except ValueError:
        problem = day_problem(text[:DAY_LENGTH]) if text[DAY_LENGTH : DAY_LENGTH + 1] in ("", "T", " ") else None
        return problem if problem and problem[0] else ("", "Write YYYY-MM-DD or YYYY-MM-DDTHH:MM in UTC")
    return (", with a time zone", "Write the time in UTC, without a zone") if time.tzinfo else None


def day_problem(text: str) -> tuple[str, str] | None:
    """Error of a text that is no day, such as 2026-02-30.

    Parameters
    ----------
    text : str
        Text of a cell or an option.

    Returns
    -------
    tuple of (str, str) or None
        Addition to the problem, and remedy; None for a day of the calendar.

    Examples
    --------
    >>> day_problem("2026-02-28") is None, day_problem("2026-02-30"), day_problem("28.2.2026")
    (True, (', which is no day of the calendar', 'Write a day that exists'), ('', 'Write YYYY-MM-DD'))
    """
    try:
        _reject_week(text)
        date.fromisoformat(text)
    except ValueError:
        is_written_right = re.fullmatch(r"\d{4}-\d{2}-\d{2}", text, re.ASCII) is not None
        return (
            (", which is no day of the calendar", "Write a day that exists")
            if is_written_right
            else ("", "Write YYYY-MM-DD")
        )
    return None


def parse_utc(text: str) -> datetime:
    """Time of a cell, YYYY-MM-DD or YYYY-MM-DDTHH:MM, with or without a mark of UTC ("Z", "UTC", "+00:00").

    Parameters
    ----------
    text : str
        Text of a cell that ``time_problem`` accepts.

    Returns
    -------
    datetime
        The time, naive as in the tables; with a zone if that is not UTC, which ``time_problem`` reports.

    Raises
    ------
    ValueError
        For other text.

    Examples
    --------
    >>> parse_utc("2026-04-02T10:30Z").isoformat(), parse_utc("2026-04-02T10:30+00:00").isoformat()
    ('2026-04-02T10:30:00', '2026-04-02T10:30:00')
    >>> parse_utc("2026-04-02t10:30z") == parse_utc("2026-04-02 10:30 UTC") == parse_utc("2026-04-02 10:30 +00:00")
    True
    """
    _reject_week(text)
    time = datetime.fromisoformat(BLANK_BEFORE_OFFSET.sub("", UTC_MARK.sub("", text)))
    return time.replace(tzinfo=None) if time.utcoffset() == timedelta(0) else time


def _reject_week(text: str) -> None:
    """ValueError for a week of ISO 8601, which Python takes for its Monday: 2026-W20 is no day."""
    if "W" in text.upper():
        raise ValueError(f"{text!r} is a week")


def now() -> datetime:
    """The present time in UTC, naive as in the tables."""
    return datetime.now(UTC).replace(tzinfo=None)


def _reset_bands(cells: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(sorted(word for word in cells.get("resets", "").replace("+", " ").split() if word != "none"))


def event_of(cells: Mapping[str, str]) -> Event:
    """The event of a valid row.

    Parameters
    ----------
    cells : mapping of str to str
        Cells of the row by the names of their columns.

    Returns
    -------
    Event
        With the bands that its kind of work resets, unless the row names others.
    """
    turnout, kind = cells["turnout"], cells["kind"]
    label = cells["section"].removeprefix(f"{turnout}/") or None
    resets = _reset_bands(cells) if cells.get("resets") else RESETS[kind]
    at = parse_utc(cells["date"])
    return Event(turnout, label, at, kind, resets, cells.get("note", ""))
