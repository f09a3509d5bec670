"""Compute hammer tests on request, from files in any folder, as the nightly run would compute them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from turnout.config import TurnoutConfig
from turnout.config.campaign_notes import read_notes
from turnout.errors import ConfigError, ReadError
from turnout.records import EMPTY_MAPPING, Unit
from turnout.stages.hammer import hammer_config, hammer_unit
from turnout.stages.raw_files import require_file
from turnout.stages.requested_files import check_agreement, check_request, files_by_day, section_of
from turnout.workflow.guard import compute_guarded
from turnout.workflow.scan import scan


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


def passage_file(file: str | Path, turnout: TurnoutConfig, raw_root: Path, folders: Mapping[str, str]) -> Path:
    """The recording of a passage that a person names, in the raw folder of the turnout or anywhere else.

    Parameters
    ----------
    file : path
        The file.
    turnout : TurnoutConfig
        Configuration of the turnout.
    raw_root : path
        Folder that holds those of the turnouts; it need not exist.
    folders : mapping
        Raw folder of every turnout by its id.

    Returns
    -------
    Path
        The same path.

    Raises
    ------
    ConfigError
        The file is of a hammer test or of another turnout.
    ReadError
        A path that is no file.
    """
    path = require_file(file)
    scan_result = _NightlyScan(turnout, raw_root, [])
    scan_result.check_turnout(path, folders)
    unit, _ = scan_result.units.get(os.path.realpath(path), (None, ""))
    if unit is not None and unit.kind != "passage":
        remedy = f"Use turnout hammer {path} --turnout {turnout.id}"
        raise ConfigError(path, "file name", "is that of a hammer test, not of a passage", remedy)
    return path


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
        """Errors of campaigns.csv, if it states no temperature for this day: one of them may be the reason.

        Parameters
        ----------
        day : str
            Day of a campaign, YYYY-MM-DD.

        Returns
        -------
        tuple of str
            The errors as text.
        """
        is_stated = self.turnout.campaigns[day].rail_temperature is not None
        return () if is_stated else tuple(str(error) for error in self.note_errors)

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
            command = f"Use turnout passage {self.raw_root / names.pop()} --turnout {unit.turnout}"
            raise ConfigError(unit.files[0][0], "file name", "is that of a passage, not of a hammer test", command)
        further = [path.rsplit("/", 1)[-1] for path, *_ in unit.files if path not in names]
        selection = replace(unit, files=tuple(file for file in unit.files if file[0] in names))
        remark = f"the nightly run takes {', '.join(further)} with it; name all of them to see its result"
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
