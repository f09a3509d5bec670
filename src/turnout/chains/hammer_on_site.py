"""Files of a hammer test that somebody asks about, wherever they lie, as the unit that the nightly run would make."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from turnout.chains.hammer import hammer_unit
from turnout.chains.hammer_told import agree, by_day, check_asked, section_of
from turnout.config import TurnoutConfig
from turnout.config.load import read_notes
from turnout.errors import ConfigError, ReadError
from turnout.fleet.guard import guarded
from turnout.fleet.scan import scan
from turnout.records import NOTHING, Unit


@dataclass(frozen=True)
class AskedFor:
    """A ``unit`` to be computed as the night would: ``turnout`` with its notes, and ``root``, where the paths start.

    ``remarks`` say what the night will see otherwise: further files, or none of these.
    """

    unit: Unit
    turnout: TurnoutConfig
    root: Path
    remarks: tuple[str, ...] = ()

    def rows(self) -> dict[str, list[dict]]:
        """Rows by table, as the nightly run gets them; a file that cannot be used is a quarantine row."""
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
        Folder that holds those of the turnouts; it need not be there.
    section, campaign : str, optional
        Label and day (YYYY-MM-DD) of files whose names do not say them; a file's own time may stand for the day.
    folders : mapping, optional
        Raw folder of every turnout by its id: a file of another one is refused.

    Raises
    ------
    ConfigError
        No hammer tests in the layout, no such section, a section or day that is not known, or contradicts a name;
        a file of a passage, or of another turnout.
    ReadError
        A path that leads to no file, and a file that cannot be read where only it could say its day.
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
    """What the nightly run finds in the turnout's raw folder: (unit, path) and what it leaves out, by real path."""

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
        """What is wrong with campaigns.csv, where no sound row of it is of this day."""
        return () if self.turnout.campaigns[day].noted else tuple(str(error) for error in self.wrong)

    def part(self, unit, names) -> AskedFor:
        """The files of a unit that were asked for, and which others the night takes with them."""
        if unit.kind != "hammer":
            command = f"Use turnout passage {names.pop()} --turnout {unit.turnout}"
            raise ConfigError(unit.files[0][0], "file name", "is that of a passage, not of a hammer test", command)
        others = [path.rsplit("/", 1)[-1] for path, *_ in unit.files if path not in names]
        some = replace(unit, files=tuple(file for file in unit.files if file[0] in names))
        told = f"the nightly run takes {', '.join(others)} with it; name all of them to hear what it will say"
        remarks = self.notes(unit.campaign) + ((told,) if others else ())
        return AskedFor(some, self.turnout, self.raw_root, remarks)

    def misses(self, paths, label, day) -> tuple[str, ...]:
        """Why the nightly run does not take files, and what would make it."""
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
    """The layout's pattern with what is known of files."""
    endings = {path.suffix.lstrip(".") for path in paths}
    ending = endings.pop() if len(endings) == 1 else ""
    for field, value in (("campaign", day), ("section", label), ("ext", ending or "{ext}")):
        pattern = pattern.replace(f"{{{field}}}", value)
    return pattern


def _within(path, folder) -> bool:
    return os.path.realpath(path).startswith(os.path.realpath(folder) + os.sep)


def _file(path) -> str:
    """Where the file really lies."""
    if os.path.isdir(path):
        remedy = f"Name the files in it, such as {path.name}/*"
        raise ReadError(path, "the path", "it is a folder", remedy)
    if not os.path.exists(path):
        raise ReadError(path, "the path", "there is no such file, or none that may be seen", "Correct it", "vanished")
    return os.path.realpath(path)


def _brought(paths, turnout, label, day, night) -> AskedFor:
    """Files that the night does not see; their paths start from the folder that they share."""
    real = [os.path.realpath(path) for path in paths]
    root = os.path.commonpath([os.path.dirname(path) for path in real])
    sizes = sorted((os.path.relpath(path, root), os.stat(path)) for path in dict.fromkeys(real))
    entries = tuple((name, status.st_size, status.st_mtime_ns) for name, status in sizes)
    unit = Unit(turnout.id, "hammer", f"{label}/{day}", entries, turnout.hashes["hammer"], label, day)
    remarks = night.notes(day) + night.misses(paths, label, day)
    return AskedFor(unit, replace(turnout, raw="."), Path(root), remarks)
