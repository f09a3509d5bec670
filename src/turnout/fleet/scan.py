"""The raw folder of one turnout: which files make which unit, and which files no pattern knows."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache
from pathlib import Path

from turnout.config import TurnoutConfig
from turnout.config.filename_pattern import compiled
from turnout.errors import ReadError
from turnout.fleet.raw_folder import RawFolder
from turnout.records import Unit


@dataclass
class Scan:
    """``units`` sorted by kind and label; ``problems`` say what was left out and why."""

    units: list[Unit] = field(default_factory=list)
    problems: list[ReadError] = field(default_factory=list)


def scan(turnout: TurnoutConfig, raw_root: Path) -> Scan:
    """Units of one turnout from the names in its raw folder; no file is opened."""
    found, names = Scan(), _names(turnout)
    by_unit: dict[tuple, list] = {}
    matched, unmatched = set(), []
    folder = RawFolder(raw_root, turnout.raw)
    for inside, entry in folder.files:
        for kind, expression in names:
            if match := expression.fullmatch(inside):
                matched.add(kind)
                if wrong := _no_time(match):
                    found.problems.append(ReadError(f"{turnout.raw}/{inside}", "file name", *wrong, "name_unknown"))
                    break
                by_unit.setdefault(_label(kind, match, inside, turnout), []).append((inside, entry))
                break
        else:
            unmatched.append(inside)
    for (kind, label, section, campaign), files in sorted(by_unit.items(), key=lambda item: item[0][:2]):
        entries = tuple(sorted(e for e in [folder.stat(*file) for file in files] if e))
        if entries:
            found.units.append(Unit(turnout.id, kind, label, entries, turnout.hashes[kind], section, campaign))
    found.problems += [*folder.problems, *_strangers(turnout, unmatched, matched, names)]
    return found


def unit_id(unit: Unit) -> str:
    """Name of a unit in batches and state files.

    >>> unit_id(Unit("t1", "hammer", "A7/2024-05-13", (), ""))
    't1/hammer/A7/2024-05-13'
    """
    return f"{unit.turnout}/{unit.kind}/{unit.label}"


def _names(turnout: TurnoutConfig) -> list[tuple]:
    names = []
    if turnout.hammer:
        names.append(("hammer", compiled(turnout.hammer.files, "hammer", tuple(s.label for s in turnout.sections))))
    if turnout.passages:
        names.append(("passage", compiled(turnout.passages.files, "passages")))
    return names


def _label(kind, match, inside, turnout) -> tuple:
    """Kind, label, section and campaign of the unit that a file belongs to."""
    if kind == "hammer":
        section, campaign = match["section"], match["campaign"]
        return kind, f"{section}/{campaign}", section, campaign
    fixed = turnout.passages.files.partition("{")[0]
    return kind, inside.removeprefix(fixed), None, None


def _no_time(match) -> tuple[str, str] | None:
    """What is wrong with the day or time in a name, and what to do; None where it is in the calendar.

    >>> import re
    >>> _no_time(re.fullmatch("(?P<campaign>.*)", "2024-13-45"))[0]
    "'2024-13-45' is no day of the calendar"
    """
    for group, form, said in (("campaign", "%Y-%m-%d", "day"), ("time", "%Y%m%dT%H%M%SZ", "time")):
        text = match[group] if group in match.re.groupindex else None
        if text is not None and not _in_the_calendar(text, form):
            return f"{text!r} is no {said} of the calendar", "Rename it after the day on which it was measured, in UTC"
    return None


@lru_cache(maxsize=10_000)
def _in_the_calendar(text: str, form: str) -> bool:
    """Remembered: a network has 140,000 files and a few hundred days, and reading a day is a third of the scan."""
    try:
        datetime.strptime(text, form)
    except ValueError:
        return False
    return True


def _strangers(turnout, unmatched: list[str], matched: set, names: Iterable) -> Iterator[ReadError]:
    patterns = {"hammer": turnout.hammer, "passage": turnout.passages}
    said = " or ".join(repr(patterns[kind].files) for kind, _ in names)
    for inside in unmatched:
        remedy = f"Rename it after {said}, or add its section to the layout {turnout.layout!r}"
        found = "its name follows no pattern of the layout"
        yield ReadError(f"{turnout.raw}/{inside}", "file name", found, remedy, "name_unknown")
    if not matched:
        remedy = f"Put files named like {said} there, or correct 'raw' in turnouts.tsv or 'files' in the layout"
        yield ReadError(turnout.raw, "folder", "no file matches a pattern of the layout", remedy, "nothing_found")
