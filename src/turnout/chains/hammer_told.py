"""Section and day of hammer files that the nightly run does not see: by option, by name, or by what they note."""

import os
from datetime import datetime
from pathlib import Path

from turnout.config.filename_pattern import compiled
from turnout.config.schema import suggestion
from turnout.errors import ConfigError, ReadError
from turnout.readers import read


def check_asked(turnout, section, campaign):
    """ConfigError for a turnout without hammer tests, a section that it has not, and a day of no calendar."""
    if turnout.hammer is None:
        raise ConfigError(turnout.layout, "hammer", "nothing about hammer tests", "Add them to the layout")
    if section is not None and section not in (known := turnout.hammer.descriptions):
        raise ConfigError(
            "turnout hammer", "--section", f"{section!r} is no section of {turnout.id}", suggestion(section, known)
        )
    if campaign is not None and not _is_day(campaign):
        remedy = "Write the day of the campaign as YYYY-MM-DD"
        raise ConfigError("turnout hammer", "--campaign", f"{campaign!r} is no day of the calendar", remedy)


def _is_day(text) -> bool:
    try:
        return datetime.strptime(text, "%Y-%m-%d").date().isoformat() == text
    except ValueError:
        return False


def agree(path, named, day, section, campaign):
    """ConfigError where an option says another section or day than the file's name."""
    pairs = (("--section", section, named, "section"), ("--campaign", campaign, day, "campaign"))
    for option, asked, told, what in pairs:
        if asked is not None and told is not None and asked != told:
            remedy = f"Leave out {option}, or rename the file after the {what} at which it was recorded"
            raise ConfigError(path, option, f"is {asked!r}, and the file's name says {told!r}", remedy)


def _named(path, turnout) -> tuple[str | None, str | None]:
    """Section and day by as much of a path as follows the end of the layout's pattern, None where it does not say."""
    labels, pattern = tuple(s.label for s in turnout.sections), turnout.hammer.files.split("/")
    for n in range(min(len(pattern), len(path.parts) - 1), 0, -1):
        tail, name = "/".join(pattern[-n:]), "/".join(path.parts[-n:])
        if "{section}" not in tail:
            break
        dated = "{campaign}" in tail
        match = compiled(tail if dated else "{campaign}/" + tail, "hammer", labels).fullmatch(
            name if dated else "2000-01-01/" + name
        )
        if match:
            return match["section"], match["campaign"] if dated and _is_day(match["campaign"]) else None
    return None, None


def section_of(path, turnout, section, campaign) -> str:
    """Label of a file's section, as told or as named; ConfigError where neither says it, or the two contradict."""
    named, day = _named(path, turnout)
    agree(path, named, day, section, campaign)
    label = section or named
    if label is None:
        remedy = f"Write --section with one of {', '.join(turnout.hammer.descriptions)}"
        found = f"its name does not say at which section of {turnout.id} it was recorded"
        raise ConfigError(path, "--section", found, remedy)
    return label


def by_day(paths, turnout, label, campaign) -> dict[str, list[Path]]:
    """Files of one section by the day of their campaign: as told, as named, or as the first time that they note."""
    days: dict[str, list[Path]] = {}
    unknown = []
    for path in paths:
        day = campaign or _named(path, turnout)[1]
        days.setdefault(day, []).append(path) if day else unknown.append(path)
    if unknown:
        days.setdefault(_noted_day(unknown, turnout.hammer.descriptions[label]), []).extend(unknown)
    return days


def _noted_day(paths, description) -> str:
    """Day of the first time that files note; ReadError where none of them holds a sound record."""
    faults: list[ReadError] = []
    times, n_sound = [], 0
    for path in paths:
        real = os.path.realpath(path)
        try:
            result = read(os.path.basename(real), os.path.dirname(real), description)
        except ReadError as error:
            faults.append(_called(path, error))
            continue
        faults += [_called(path, error) for error in result.errors if isinstance(error, ReadError)]
        times += [recording.started_at for recording in result.recordings if recording.started_at is not None]
        n_sound += len(result.recordings)
    if times:
        return min(times).date().isoformat()
    if faults and not n_sound:
        raise faults[0]
    found = "neither its name nor the file says on which day it was recorded"
    raise ConfigError(paths[0], "--campaign", found, "Write --campaign YYYY-MM-DD")


def _called(path, error: ReadError) -> ReadError:
    """The same error of a file called as it was by whoever asked."""
    return ReadError(path, error.where, error.found, error.remedy, error.reason)
