"""config/events.csv: maintenance that starts a new epoch of a resonance."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from turnout.config.csv_table import TableFault, read_csv, unreadable
from turnout.config.schema import NO_TURNOUT, suggestion
from turnout.errors import ConfigError

# Which resonance is another one afterwards, where the row does not say.
RESETS = {
    "tamping": ("ballast",),
    "pad_exchange": ("railpad",),
    "rail_change": ("ballast", "railpad"),
    "grinding": (),
    "ballast_cleaning": ("ballast",),
    "sleeper_change": ("ballast", "railpad"),
    "sensor_change": ("ballast", "railpad"),
    "method_change": ("ballast", "railpad"),
    "other": (),
}
AHEAD = timedelta(days=366)  # that work may be planned; what is dated later is a slip
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


def read_events(path: Path, name: str, known, variants) -> tuple[list[Event], list[ConfigError], list[ConfigError]]:
    """Events in order of time, every error of the rows that cannot be used, and a warning of each event of a turnout
    or section that is not there (it was taken out, and its history keeps its events, or it is misspelt), and of each
    that is dated more than a year ahead. No file means no events.

    ``known`` are the ids of the turnouts, None where turnouts.tsv itself is wrong: then no event is accused.
    """
    if not os.path.lexists(path):
        return [], [], []
    events: list[Event] = []
    try:
        table = read_csv(path, name, COLUMNS, needed=4)
    except TableFault as fault:
        return [], [fault.error], []
    errors, warnings = [fault.error for fault in table.faults], []
    for line, cells in table.rows:
        found = list(_wrong(cells))
        errors += [cells.place(name, line, column).error(*said) for column, *said in found]
        if found:
            continue
        events.append(_event(cells))
        strange = wrong_place(cells, known, variants)
        warnings += [cells.place(name, line, column).error(*said) for column, *said in strange]
        if events[-1].at > now() + AHEAD:
            late = f"date {cells['date']} is more than a year ahead"
            warnings.append(cells.place(name, line, "date").error(late, "Correct it, or enter it nearer to its day"))
    return sorted(events, key=lambda e: (e.at, e.turnout, e.section or "", e.kind)), errors, warnings


def _wrong(cells) -> Iterator[tuple[str, str, str]]:
    """(column, what was found, what to write) of everything in a row that cannot be used."""
    if no_row := unreadable(cells):
        yield no_row
        return
    if not cells["turnout"]:
        yield "turnout", "turnout is empty", "Write the id of the turnout"
    if wrong := wrong_time(cells["date"]):
        yield "date", f"date is {cells['date']!r}{wrong[0]}", wrong[1]
    if cells["kind"] not in RESETS:
        yield "kind", f"kind is {cells['kind']!r}", suggestion(cells["kind"], RESETS)
    if unknown := set(_words(cells)) - {"ballast", "railpad"}:
        yield "resets", f"resets is {cells['resets']!r}", suggestion(min(unknown), ("ballast", "railpad", "none"))


def wrong_place(cells, known, variants) -> Iterator[tuple[str, str, str]]:
    """What is wrong with ``turnout`` and ``section`` of a row; ``known`` None (turnouts.tsv is wrong) accuses none."""
    turnout, label = cells["turnout"], cells["section"].removeprefix(f"{cells['turnout']}/")
    if known is not None and turnout not in known:
        yield "turnout", f"turnout {turnout!r} has no row in turnouts.tsv", suggestion(turnout, known, NO_TURNOUT)
    elif label and turnout in variants:
        labels = variants[turnout].tree["sections"]
        if label not in labels:
            yield "section", f"turnout {turnout!r} has no section {label!r}", suggestion(label, labels)


def wrong_time(text: str) -> tuple[str, str] | None:
    """What is wrong with a time in UTC, and what to write; None where nothing is.

    >>> wrong_time("2026-04-02") is None, wrong_time("2.4.2026")
    (True, ('', 'Write YYYY-MM-DD or YYYY-MM-DDTHH:MM in UTC'))
    """
    try:
        time = datetime.fromisoformat(text.removesuffix("Z"))
    except ValueError:
        return "", "Write YYYY-MM-DD or YYYY-MM-DDTHH:MM in UTC"
    return (", with a time zone", "Write the time in UTC, without a zone") if time.tzinfo else None


def now() -> datetime:
    """The time in UTC, as tables write it."""
    return datetime.now(UTC).replace(tzinfo=None)


def _words(cells) -> tuple[str, ...]:
    return tuple(sorted(word for word in cells.get("resets", "").replace("+", " ").split() if word != "none"))


def _event(cells) -> Event:
    """The event of a sound row."""
    turnout, kind = cells["turnout"], cells["kind"]
    label = cells["section"].removeprefix(f"{turnout}/") or None
    resets = _words(cells) if cells.get("resets") else RESETS[kind]
    at = datetime.fromisoformat(cells["date"].removesuffix("Z"))
    return Event(turnout, label, at, kind, resets, cells.get("note", ""))
