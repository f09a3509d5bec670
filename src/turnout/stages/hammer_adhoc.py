"""Compute hammer tests on request, from files in any folder, as the nightly run would compute them.

Section and day of a file come from the options, its name, or the time noted in it.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from turnout.config import TurnoutConfig
from turnout.config.filename_pattern import compiled
from turnout.config.load import read_notes
from turnout.config.schema import suggestion
from turnout.errors import ConfigError, ReadError
from turnout.readers import read
from turnout.records import NOTHING, Unit
from turnout.stages.hammer import hammer_unit
from turnout.workflow.guard import guarded
from turnout.workflow.scan import scan


def check_asked(turnout, section, campaign):
    """ConfigError for a turnout without hammer tests, an unknown section, or an invalid day."""
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
    """ConfigError if an option contradicts the section or day in the file's name."""
    pairs = (("--section", section, named, "section"), ("--campaign", campaign, day, "campaign"))
    for option, asked, told, what in pairs:
        if asked is not None and told is not None and asked != told:
            remedy = f"Leave out {option}, or rename the file after the {what} at which it was recorded"
            raise ConfigError(path, option, f"is {asked!r}, and the file's name says {told!r}", remedy)


def _named(path, turnout) -> tuple[str | None, str | None]:
    """(section, day) from the end of a path that matches the layout's pattern, None where not given."""
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
    """Label of a file's section, from the option or its name; ConfigError if unknown or contradictory."""
    named, day = _named(path, turnout)
    agree(path, named, day, section, campaign)
    label = section or named
    if label is None:
        remedy = f"Write --section with one of {', '.join(turnout.hammer.descriptions)}"
        found = f"its name does not say at which section of {turnout.id} it was recorded"
        raise ConfigError(path, "--section", found, remedy)
    return label


def by_day(paths, turnout, label, campaign) -> dict[str, list[Path]]:
    """Files of one section by the day of their campaign: from the option, their names, or the first time noted."""
    days: dict[str, list[Path]] = {}
    unknown = []
    for path in paths:
        day = campaign or _named(path, turnout)[1]
        days.setdefault(day, []).append(path) if day else unknown.append(path)
    if unknown:
        days.setdefault(_noted_day(unknown, turnout.hammer.descriptions[label]), []).extend(unknown)
    return days


def _noted_day(paths, description) -> str:
    """Day of the first time noted in files; ReadError if none of them holds a usable record."""
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
    """The same error, with the path as the user gave it."""
    return ReadError(path, error.where, error.found, error.remedy, error.reason)


@dataclass(frozen=True)
class AskedFor:
    """A ``unit`` to compute as the nightly run would, with its ``turnout`` and the ``root`` of its paths.

    ``remarks`` say how the nightly run will differ: further files, or none of these.
    """

    unit: Unit
    turnout: TurnoutConfig
    root: Path
    remarks: tuple[str, ...] = ()

    def rows(self) -> dict[str, list[dict]]:
        """Rows by table, as in the nightly run; a file that cannot be used is a quarantine row."""
        return guarded(hammer_unit, self.unit, self.turnout, self.root, "", "", strict=False).tables


def asked_for(
    files,
    turnout: TurnoutConfig,
    raw_root: Path,
    section: str | None = None,
    campaign: str | None = None,
    folders: Mapping[str, str] = NOTHING,
) -> list[AskedFor]:
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
    check_asked(turnout, section, campaign)
    turnout, wrong = read_notes(turnout, raw_root)
    night = _Night(turnout, raw_root, [error for error in wrong if error.path.endswith("campaigns.csv")])
    filed: dict[str, tuple[Unit, set]] = {}
    elsewhere: dict[str, list[Path]] = {}
    for path in dict.fromkeys(Path(os.path.abspath(file)) for file in files):
        real = _file(path)
        if real in night.units:
            unit, name = night.units[real]
            agree(path, unit.section, unit.campaign, section, campaign)
            filed.setdefault(unit.label, (unit, set()))[1].add(name)
        else:
            night.refuse_others(path, folders)
            elsewhere.setdefault(section_of(path, turnout, section, campaign), []).append(path)
    found = [night.part(unit, names) for unit, names in filed.values()]
    for label, paths in elsewhere.items():
        for day, some in by_day(paths, turnout, label, campaign).items():
            found.append(_brought(some, turnout, label, day, night))
    return found


class _Night:
    """Scan of the turnout's raw folder, as in the nightly run: (unit, path) and problems by real path."""

    def __init__(self, turnout, raw_root, wrong):
        self.turnout, self.raw_root, self.wrong = turnout, raw_root, wrong
        self.folder = os.path.realpath(raw_root / turnout.raw)
        seen = scan(turnout, raw_root)
        self.units = {
            os.path.realpath(raw_root / file[0]): (unit, file[0]) for unit in seen.units for file in unit.files
        }
        self.problems = {os.path.realpath(raw_root / p.path): p for p in seen.problems}

    def refuse_others(self, path, folders):
        """ConfigError for a file in the raw folder of another turnout."""
        for turnout, raw in folders.items():
            if raw != self.turnout.raw and _within(path, self.raw_root / raw) and not _within(path, self.folder):
                found = f"is {self.turnout.id}, and the file lies in the raw folder of {turnout}"
                raise ConfigError(path, "--turnout", found, f"Write --turnout {turnout}")

    def notes(self, day) -> tuple[str, ...]:
        """Errors of campaigns.csv, if none of its valid rows is of this day."""
        return () if self.turnout.campaigns[day].noted else tuple(str(error) for error in self.wrong)

    def part(self, unit, names) -> AskedFor:
        """The requested files of a unit, with a remark on the others that the nightly run includes."""
        if unit.kind != "hammer":
            command = f"Use turnout passage {names.pop()} --turnout {unit.turnout}"
            raise ConfigError(unit.files[0][0], "file name", "is that of a passage, not of a hammer test", command)
        others = [path.rsplit("/", 1)[-1] for path, *_ in unit.files if path not in names]
        some = replace(unit, files=tuple(file for file in unit.files if file[0] in names))
        told = f"the nightly run takes {', '.join(others)} with it; name all of them to hear what it will say"
        remarks = self.notes(unit.campaign) + ((told,) if others else ())
        return AskedFor(some, self.turnout, self.raw_root, remarks)

    def misses(self, paths, label, day) -> tuple[str, ...]:
        """Why the nightly run does not use these files, and what to change."""
        said, strange = [], []
        for path in paths:
            problem = self.problems.get(os.path.realpath(path))
            if problem:
                said.append(f"the nightly run leaves {path.name} out: {problem.found}. {problem.remedy}.")
            elif _within(path, self.folder):
                said.append(f"the nightly run leaves {path.name} out: its name is that of a file not yet complete")
            else:
                strange.append(path)
        if strange:
            place = self.raw_root / self.turnout.raw / _filled(self.turnout.hammer.files, strange, label, day)
            names = ", ".join(path.name for path in strange)
            said.append(f"the nightly run does not see {names} there: it looks for {place}")
        return tuple(said)


def _filled(pattern, paths, label, day) -> str:
    """The layout's file pattern with day, section and file extension filled in."""
    endings = {path.suffix.lstrip(".") for path in paths}
    ending = endings.pop() if len(endings) == 1 else ""
    for field, value in (("campaign", day), ("section", label), ("ext", ending or "{ext}")):
        pattern = pattern.replace(f"{{{field}}}", value)
    return pattern


def _within(path, folder) -> bool:
    return os.path.realpath(path).startswith(os.path.realpath(folder) + os.sep)


def _file(path) -> str:
    """Real path of a file, links resolved; ReadError if it is none."""
    if os.path.isdir(path):
        remedy = f"Name the files in it, such as {path.name}/*"
        raise ReadError(path, "the path", "it is a folder", remedy)
    if not os.path.exists(path):
        raise ReadError(path, "the path", "there is no such file, or none that may be seen", "Correct it", "vanished")
    return os.path.realpath(path)


def _brought(paths, turnout, label, day, night) -> AskedFor:
    """Unit of files that the nightly run does not see; its root is their common folder."""
    real = [os.path.realpath(path) for path in paths]
    root = os.path.commonpath([os.path.dirname(path) for path in real])
    sizes = sorted((os.path.relpath(path, root), os.stat(path)) for path in dict.fromkeys(real))
    entries = tuple((name, status.st_size, status.st_mtime_ns) for name, status in sizes)
    unit = Unit(turnout.id, "hammer", f"{label}/{day}", entries, turnout.hashes["hammer"], label, day)
    remarks = night.notes(day) + night.misses(paths, label, day)
    return AskedFor(unit, replace(turnout, raw="."), Path(root), remarks)
