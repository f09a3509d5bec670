"""Compute hammer tests on request, from files in any folder, as the nightly run would compute them.

Section and day of a file come from the options, its name, or the time noted in it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

from turnout.config import TurnoutConfig
from turnout.config.filename_pattern import compile_pattern
from turnout.config.load import read_notes
from turnout.config.schema import suggestion
from turnout.errors import ConfigError, ReadError
from turnout.readers import read
from turnout.readers.frequency_responses import find_responses
from turnout.records import EMPTY_MAPPING, RawDescription, Unit
from turnout.stages.hammer import hammer_config, hammer_unit
from turnout.stages.raw_files import require_file
from turnout.workflow.guard import compute_guarded
from turnout.workflow.scan import scan


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
        remedy = "Write the day of the campaign as YYYY-MM-DD"
        raise ConfigError("turnout hammer", "--campaign", f"{campaign!r} is no day of the calendar", remedy)


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


@dataclass(frozen=True)
class RequestedUnit:
    """A ``unit`` to compute as the nightly run would, with its ``turnout`` and the ``root`` of its paths.

    ``remarks`` say how the nightly run will differ: further files, or none of these.
    """

    unit: Unit
    turnout: TurnoutConfig
    root: Path
    remarks: tuple[str, ...] = ()

    def rows(self) -> dict[str, list[dict]]:
        """Rows by table, as in the nightly run; a file that cannot be used is a quarantine row."""
        return compute_guarded(hammer_unit, self.unit, self.turnout, self.root, "", "", strict=False).tables


def requested_units(
    files: Iterable[str | Path],
    turnout: TurnoutConfig,
    raw_root: Path,
    section: str | None = None,
    campaign: str | None = None,
    folders: Mapping[str, str] = EMPTY_MAPPING,
) -> list[RequestedUnit]:
    """The units that ``files`` belong to, one for each section and campaign.

    Parameters
    ----------
    files : sequence of path
        In the raw folder of the turnout or anywhere else.
    turnout : TurnoutConfig
        Its notes are read from its raw folder here.
    raw_root : path
        Folder that holds those of the turnouts; it need not exist.
    section, campaign : str, optional
        Label and day (YYYY-MM-DD) of files whose names do not give them; else the day is the time noted in the file.
    folders : mapping, optional
        Raw folder of every turnout by its id: a file of another turnout is an error.

    Raises
    ------
    ConfigError
        No hammer tests in the layout, an unknown section or day, a contradiction with a file's name, or a file of
        a passage or of another turnout.
    ReadError
        A path that is no file, or an unreadable file whose day is needed.
    """
    raw_root = Path(raw_root)
    check_request(turnout, section, campaign)
    turnout, note_errors = read_notes(turnout, raw_root)
    scan_result = _NightlyScan(
        turnout, raw_root, [error for error in note_errors if error.path.endswith("campaigns.csv")]
    )
    in_raw_folder: dict[str, tuple[Unit, set]] = {}
    elsewhere: dict[str, list[Path]] = {}
    for path in dict.fromkeys(Path(os.path.abspath(require_file(file))) for file in files):
        real_path = os.path.realpath(path)
        if real_path in scan_result.units:
            unit, name = scan_result.units[real_path]
            check_agreement(path, unit.section, unit.campaign, section, campaign)
            in_raw_folder.setdefault(unit.label, (unit, set()))[1].add(name)
        else:
            scan_result.check_turnout(path, folders)
            elsewhere.setdefault(section_of(path, turnout, section, campaign), []).append(path)
    requests = [scan_result.select(unit, names) for unit, names in in_raw_folder.values()]
    for label, paths in elsewhere.items():
        for day, day_paths in files_by_day(paths, turnout, label, campaign).items():
            requests.append(_unit_elsewhere(day_paths, turnout, label, day, scan_result))
    return requests


class _NightlyScan:
    """Scan of the turnout's raw folder, as in the nightly run: (unit, path) and problems by real path."""

    def __init__(self, turnout: TurnoutConfig, raw_root: Path, note_errors: Sequence[ReadError]) -> None:
        self.turnout, self.raw_root, self.note_errors = turnout, raw_root, note_errors
        self.folder = os.path.realpath(raw_root / turnout.raw)
        scanned = scan(turnout, raw_root)
        self.units = {
            os.path.realpath(raw_root / file[0]): (unit, file[0]) for unit in scanned.units for file in unit.files
        }
        self.problems = {os.path.realpath(raw_root / p.path): p for p in scanned.problems}

    def check_turnout(self, path: Path, folders: Mapping[str, str]) -> None:
        """ConfigError for a file in the raw folder of another turnout."""
        for turnout, raw in folders.items():
            if raw != self.turnout.raw and _within(path, self.raw_root / raw) and not _within(path, self.folder):
                observation = f"is {self.turnout.id}, and the file lies in the raw folder of {turnout}"
                raise ConfigError(path, "--turnout", observation, f"Write --turnout {turnout}")

    def notes(self, day: str) -> tuple[str, ...]:
        """Errors of campaigns.csv, if none of its valid rows is of this day.

        Parameters
        ----------
        day : str
            Day of a campaign, YYYY-MM-DD.

        Returns
        -------
        tuple of str
            The errors as text.
        """
        return () if self.turnout.campaigns[day].listed else tuple(str(error) for error in self.note_errors)

    def select(self, unit: Unit, names: set[str]) -> RequestedUnit:
        """The requested files of a unit, with a remark on the others that the nightly run includes.

        Parameters
        ----------
        unit : Unit
            A unit of the nightly run.
        names : set of str
            Paths of the files asked for, as in ``unit.files``.

        Returns
        -------
        RequestedUnit
            The unit with these files only.

        Raises
        ------
        ConfigError
            The unit is a passage.
        """
        if unit.kind != "hammer":
            command = f"Use turnout passage {names.pop()} --turnout {unit.turnout}"
            raise ConfigError(unit.files[0][0], "file name", "is that of a passage, not of a hammer test", command)
        further = [path.rsplit("/", 1)[-1] for path, *_ in unit.files if path not in names]
        selection = replace(unit, files=tuple(file for file in unit.files if file[0] in names))
        remark = f"the nightly run takes {', '.join(further)} with it; name all of them to see what it will say"
        remarks = self.notes(unit.campaign or "") + ((remark,) if further else ())
        return RequestedUnit(selection, self.turnout, self.raw_root, remarks)

    def explain_missing(self, paths: Iterable[Path], label: str, day: str) -> tuple[str, ...]:
        """Why the nightly run does not use these files, and what to change.

        Parameters
        ----------
        paths : iterable of Path
            Files that the nightly run does not use.
        label : str
            Label of the section.
        day : str
            Day of the campaign, YYYY-MM-DD.

        Returns
        -------
        tuple of str
            One sentence each.
        """
        remarks, unseen = [], []
        for path in paths:
            problem = self.problems.get(os.path.realpath(path))
            if problem:
                remarks.append(f"the nightly run leaves {path.name} out: {problem.problem}. {problem.remedy}.")
            elif _within(path, self.folder):
                remarks.append(f"the nightly run leaves {path.name} out: its name is that of a file not yet complete")
            else:
                unseen.append(path)
        if unseen:
            pattern = hammer_config(self.turnout).files
            expected = self.raw_root / self.turnout.raw / _fill_pattern(pattern, unseen, label, day)
            names = ", ".join(path.name for path in unseen)
            remarks.append(f"the nightly run does not see {names} there: it looks for {expected}")
        return tuple(remarks)


def _fill_pattern(pattern: str, paths: Iterable[Path], label: str, day: str) -> str:
    """The layout's file pattern with day, section and file extension filled in."""
    endings = {path.suffix.lstrip(".") for path in paths}
    ending = endings.pop() if len(endings) == 1 else ""
    for field, value in (("campaign", day), ("section", label), ("ext", ending or "{ext}")):
        pattern = pattern.replace(f"{{{field}}}", value)
    return pattern


def _within(path: str | Path, folder: str | Path) -> bool:
    return os.path.realpath(path).startswith(os.path.realpath(folder) + os.sep)


def _unit_elsewhere(
    paths: Sequence[Path], turnout: TurnoutConfig, label: str, day: str, scan_result: _NightlyScan
) -> RequestedUnit:
    """Unit of files that the nightly run does not see; its root is their common folder."""
    real_paths = [os.path.realpath(path) for path in paths]
    root = os.path.commonpath([os.path.dirname(path) for path in real_paths])
    sizes = sorted((os.path.relpath(path, root), os.stat(path)) for path in dict.fromkeys(real_paths))
    entries = tuple((name, status.st_size, status.st_mtime_ns) for name, status in sizes)
    unit = Unit(turnout.id, "hammer", f"{label}/{day}", entries, turnout.hashes["hammer"], label, day)
    remarks = scan_result.notes(day) + scan_result.explain_missing(paths, label, day)
    return RequestedUnit(unit, replace(turnout, raw="."), Path(root), remarks)
