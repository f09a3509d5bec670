"""Turnout, section and day of the files of hammer tests that a person names.

Section and day of a file come from the options, its name, or the time noted in it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

from turnout.config import TurnoutConfig
from turnout.config.events import day_problem
from turnout.config.filename_pattern import compile_pattern
from turnout.config.schema import suggestion
from turnout.errors import ConfigError, ReadError
from turnout.readers import read
from turnout.readers.frequency_responses import find_responses
from turnout.records import RawDescription
from turnout.stages.hammer import hammer_config


def check_request(turnout: TurnoutConfig, section: str | None, campaign: str | None) -> None:
    """Check that a turnout has hammer tests and that section and day are valid.

    Parameters
    ----------
    turnout : TurnoutConfig
        Configuration of the turnout.
    section : str or None
        Label of the section, if the option gives one.
    campaign : str or None
        Day of the campaign, YYYY-MM-DD, if the option gives one.

    Raises
    ------
    ConfigError
        A turnout without hammer tests, an unknown section, or an invalid day.
    """
    if turnout.hammer is None:
        raise ConfigError(turnout.layout, "hammer", "the layout describes no hammer tests", "Add the part hammer")
    if section is not None and section not in (labels := turnout.hammer.descriptions):
        raise ConfigError(
            "turnout hammer", "--section", f"{section!r} is no section of {turnout.id}", suggestion(section, labels)
        )
    if campaign is not None and not _is_day(campaign):
        addition, remedy = day_problem(campaign) or ("", "Write YYYY-MM-DD")
        raise ConfigError("turnout hammer", "--campaign", f"{campaign!r}{addition}", remedy)


def _is_day(text: str) -> bool:
    try:
        return datetime.strptime(text, "%Y-%m-%d").date().isoformat() == text
    except ValueError:
        return False


def check_agreement(
    path: str | Path, section_in_name: str | None, day_in_name: str | None, section: str | None, campaign: str | None
) -> None:
    """Check that the options do not contradict the file's name.

    Parameters
    ----------
    path : str or Path
        The file, for the message.
    section_in_name : str or None
        Section that the name gives, if any.
    day_in_name : str or None
        Day that the name gives, if any.
    section : str or None
        Label of the section, if the option gives one.
    campaign : str or None
        Day of the campaign, YYYY-MM-DD, if the option gives one.

    Raises
    ------
    ConfigError
        An option differs from the section or day in the name.
    """
    pairs = (("--section", section, section_in_name, "section"), ("--campaign", campaign, day_in_name, "campaign"))
    for option, option_value, name_value, quantity in pairs:
        if option_value is not None and name_value is not None and option_value != name_value:
            remedy = f"Write {option} {name_value}, or rename the file after the {quantity} at which it was recorded"
            raise ConfigError(path, option, f"is {option_value!r}, and the file's name says {name_value!r}", remedy)


def _section_and_day(path: Path, turnout: TurnoutConfig) -> tuple[str | None, str | None]:
    """(section, day) from the end of a path that matches the layout's pattern, None where not given."""
    labels, pattern = tuple(s.label for s in turnout.sections), hammer_config(turnout).files.split("/")
    for n in range(min(len(pattern), len(path.parts) - 1), 0, -1):
        tail, name = "/".join(pattern[-n:]), "/".join(path.parts[-n:])
        if "{section}" not in tail:
            break
        dated = "{campaign}" in tail
        match = compile_pattern(tail if dated else "{campaign}/" + tail, "hammer", labels).fullmatch(
            name if dated else "2000-01-01/" + name
        )
        if match:
            return match["section"], match["campaign"] if dated and _is_day(match["campaign"]) else None
    return None, None


def section_of(path: Path, turnout: TurnoutConfig, section: str | None, campaign: str | None) -> str:
    """Label of a file's section, from the option or its name.

    Parameters
    ----------
    path : Path
        The file.
    turnout : TurnoutConfig
        Configuration of the turnout.
    section : str or None
        Label of the section, if the option gives one.
    campaign : str or None
        Day of the campaign, YYYY-MM-DD, if the option gives one.

    Returns
    -------
    str
        The label.

    Raises
    ------
    ConfigError
        The section is not known, or the name contradicts an option.
    """
    section_in_name, day_in_name = _section_and_day(path, turnout)
    check_agreement(path, section_in_name, day_in_name, section, campaign)
    label = section or section_in_name
    if label is None:
        remedy = f"Write --section with one of {', '.join(hammer_config(turnout).descriptions)}"
        observation = f"its name does not say at which section of {turnout.id} it was recorded"
        raise ConfigError(path, "--section", observation, remedy)
    return label


def files_by_day(
    paths: Iterable[Path], turnout: TurnoutConfig, label: str, campaign: str | None
) -> dict[str, list[Path]]:
    """Files of one section by the day of their campaign: from the option, their names, or the first time noted.

    Parameters
    ----------
    paths : iterable of Path
        Files of the section.
    turnout : TurnoutConfig
        Configuration of the turnout.
    label : str
        Label of the section.
    campaign : str or None
        Day of the campaign, YYYY-MM-DD, if the option gives one.

    Returns
    -------
    dict of str to list of Path
        Files by day, YYYY-MM-DD.

    Raises
    ------
    ConfigError
        Neither a name nor a file says the day.
    ReadError
        The day is only in the files, and none of them can be read.
    """
    days: dict[str, list[Path]] = {}
    unknown = []
    for path in paths:
        day = campaign or _section_and_day(path, turnout)[1]
        days.setdefault(day, []).append(path) if day else unknown.append(path)
    if unknown:
        days.setdefault(_noted_day(unknown, hammer_config(turnout).descriptions[label]), []).extend(unknown)
    return days


def _noted_day(paths: Sequence[Path], description: RawDescription) -> str:
    """Day of the first time noted in files, in the zone of the layout; ReadError without a usable record."""
    faults: list[ReadError] = []
    times, n_usable = [], 0
    for path in paths:
        real_path = os.path.realpath(path)
        try:
            result = read(os.path.basename(real_path), os.path.dirname(real_path), description)
        except ReadError as error:
            faults.append(_with_path(path, error))
            continue
        faults += [_with_path(path, error) for error in result.errors if isinstance(error, ReadError)]
        times += [recording.started_at for recording in result.recordings if recording.started_at is not None]
        n_usable += len(result.recordings)
    if times:
        return min(times).replace(tzinfo=UTC).astimezone(ZoneInfo(description.time_zone)).date().isoformat()
    if faults and not n_usable and not any(map(_has_responses, paths)):
        raise faults[0]
    observation = "neither its name nor the file says on which day it was recorded"
    observation += next((f" ({fault.problem})" for fault in faults if fault.reason == "start_unknown"), "")
    raise ConfigError(paths[0], "--campaign", observation, "Write --campaign YYYY-MM-DD")


def _has_responses(path: Path) -> bool:
    """Whether a file holds frequency responses, which have no time."""
    real_path = os.path.realpath(path)
    try:
        return find_responses(os.path.basename(real_path), os.path.dirname(real_path)) is not None
    except ReadError:
        return False


def _with_path(path: str | Path, error: ReadError) -> ReadError:
    """The same error, with the path as the user gave it."""
    return ReadError(path, error.where, error.problem, error.remedy, error.reason)
