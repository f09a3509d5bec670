"""Write and read one plan file per shard: the units of its turnouts, their files, and excluded files.

The shard of a turnout follows from a checksum of its id.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

from turnout.config import Configuration, TurnoutConfig
from turnout.config.campaign_notes import read_notes
from turnout.config.settings.fleet import FleetSettings
from turnout.errors import ConfigError, ReadError
from turnout.files import is_truncated, write_if_changed
from turnout.records import Unit
from turnout.workflow.notes import notes_of
from turnout.workflow.scan import scan


def shard_of(turnout: str, shards: int) -> str:
    """Name of the shard of a turnout; the same in every process and on every machine.

    The check value of CRC-32 is cbf43926 for "123456789"; its last six bits are 38.

    Parameters
    ----------
    turnout : str
        Id of the turnout.
    shards : int
        Number of shards.

    Returns
    -------
    str
        Name such as "38of64".

    Examples
    --------
    >>> shard_of("123456789", 64)
    '38of64'
    """
    return shard_name(zlib.crc32(turnout.encode()) % shards, shards)


def shard_name(number: int, shards: int) -> str:
    """Name of a shard.

    Parameters
    ----------
    number : int
        Its number, from 0.
    shards : int
        Number of shards.

    Returns
    -------
    str
        Name such as "38of64".
    """
    return f"{number:02d}of{shards:02d}"


def shard_names(shards: int, turnouts: Iterable[str] | None = None) -> list[str]:
    """Names of all shards, or of those of the ``turnouts``.

    Parameters
    ----------
    shards : int
        Number of shards.
    turnouts : iterable of str or None
        Only the shards of these turnouts; None: all.

    Returns
    -------
    list of str
        Sorted names.
    """
    if turnouts is None:
        return [shard_name(i, shards) for i in range(shards)]
    return sorted({shard_of(t, shards) for t in turnouts})


PLAN_END = "\n]}\n"
ALLOW_ONCE = (
    "if they are meant to be gone, run once: turnout nightly -- --config accept_vanished=true, or "
    "snakemake --config accept_vanished=true"
)


@dataclass(frozen=True)
class PlannedUnit:
    """A unit and the digest of the notes about it (campaign, trains)."""

    unit: Unit
    note: str = ""


def write_plans(
    configuration: Configuration,
    raw_root: Path,
    folder: Path,
    shards: int,
    turnouts: Iterable[str] | None = None,
    accept_vanished: bool = False,
) -> list[str]:
    """Scan the raw folders and write ``folder``/<shard>.json where the content changed.

    A plan contains no time of scan and no absolute path, so it changes only with its content. Plans of another number
    of shards are deleted, because they would not be updated.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.
    raw_root : Path
        The raw root.
    folder : Path
        Folder of the plans.
    shards : int
        Number of shards.
    turnouts : iterable of str or None
        Scan only their shards, and those with a truncated plan; None: all.
    accept_vanished : bool
        Accept that many known files are missing.

    Returns
    -------
    list of str
        Names of the scanned shards.

    Raises
    ------
    ConfigError
        If there is no raw root, or so many known files are missing that a disk is probably not mounted, or the table
        of turnouts has lost all of its rows.
    """
    texts, missing = _scan_turnouts(configuration, raw_root, folder, shards, turnouts)
    if not accept_vanished and (error := stop_error(configuration, raw_root, folder, missing)):
        raise error
    for path, text in texts.items():
        write_if_changed(path, text)
    names = set(shard_names(shards))
    for path in Path(folder).glob("*of*.json"):
        if path.stem not in names:
            path.unlink(missing_ok=True)
    return [path.stem for path in texts]


def stop_error(configuration: Configuration, raw_root: Path, folder: Path, missing: MissingFiles) -> ConfigError | None:
    """Error that stops a run before any change, unless the loss is accepted.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.
    raw_root : Path
        The raw root.
    folder : Path
        Folder of the plans.
    missing : MissingFiles
        Files of the plans that are missing now.

    Returns
    -------
    ConfigError or None
        The error; None if the run may go on.
    """
    if error := missing.error(configuration.settings["fleet"], raw_root):
        return error
    if configuration.ids and not Path(raw_root).is_dir():
        remedy = "Mount the disk, or make the folder, with one for each turnout in it"
        return ConfigError(str(raw_root), "raw root", "there is no such folder", remedy)
    if not configuration.ids and (known := _known_turnouts(Path(folder))):
        number, first = ("the only turnout", "") if len(known) == 1 else (f"the {len(known)} turnouts", "first ")
        problem = f"no row is left of {number} of the last run, {first}{min(known)}"
        remedy = f"Nothing was changed. Put the rows back; {ALLOW_ONCE}"
        return ConfigError("turnouts.tsv", "the table", problem, remedy)
    return None


def _known_turnouts(folder: Path) -> set[str]:
    """Turnouts in the plans of the last run."""
    plans = [json.loads(path.read_text(encoding="utf-8")) for path in folder.glob("*of*.json") if not is_cut_plan(path)]
    return {entry["turnout"] for plan in plans for entry in plan["turnouts"]}


@dataclass(frozen=True)
class MissingFiles:
    """Sorted ``files`` in the plans that the scan does not find, of configured turnouts; ``n_known`` are in plans."""

    files: list[str]
    n_known: int

    def error(self, settings: FleetSettings, raw_root: Path) -> ConfigError | None:
        """Error that stops a run if so many files are missing that a disk is probably not mounted.

        Parameters
        ----------
        settings : FleetSettings
            Numbers of missing files from which a run stops.
        raw_root : Path
            The raw root.

        Returns
        -------
        ConfigError or None
            The error; None if few files are missing.
        """
        limit = max(settings.vanished_files, settings.vanished_share * self.n_known)
        is_one_absent_disk = bool(self.files) and not _holds_anything(raw_root)
        if len(self.files) <= limit and not is_one_absent_disk:
            return None
        remedy = f"Nothing was changed. Mount the disk again, or allow reading it; {ALLOW_ONCE}"
        return ConfigError(str(raw_root), "raw root", f"{self}, first {self.files[0]}", remedy)

    def __str__(self) -> str:
        return f"{len(self.files)} known file{'s are' if len(self.files) != 1 else ' is'} gone"


def _holds_anything(folder: Path) -> bool:
    """Whether a folder can be listed and is not empty, as the mount point of a disk that is not mounted."""
    try:
        return next(Path(folder).iterdir(), None) is not None
    except OSError:
        return False


def missing_files(
    configuration: Configuration, raw_root: Path, folder: Path, shards: int, turnouts: Iterable[str] | None = None
) -> MissingFiles:
    """Files that the next run will find missing, compared with the plans; nothing is written.

    Parameters
    ----------
    configuration : Configuration
        Configuration of the fleet.
    raw_root : Path
        The raw root.
    folder : Path
        Folder of the plans.
    shards : int
        Number of shards.
    turnouts : iterable of str or None
        Only the shards of these turnouts; None: all.

    Returns
    -------
    MissingFiles
        The files, and the number of known ones.
    """
    return _scan_turnouts(configuration, raw_root, folder, shards, turnouts)[1]


def _scan_turnouts(
    configuration: Configuration, raw_root: Path, folder: Path, shards: int, turnouts: Iterable[str] | None
) -> tuple[dict[Path, str], MissingFiles]:
    """New text of each plan, and the files of the existing plans that are missing now.

    The entry of a turnout that is left out for an error stays as it was: its results stay, and none is computed.
    """
    for turnout in turnouts or ():
        configuration.turnout(turnout)
    requested = set(shard_names(shards, turnouts))
    names = [n for n in shard_names(shards) if n in requested or is_cut_plan(Path(folder) / f"{n}.json")]
    members: dict[str, list[str]] = {name: [] for name in names}
    for turnout in sorted(configuration.ids):
        members.get(shard_of(turnout, shards), []).append(turnout)
    texts, missing, n_known = {}, [], 0
    faulty, is_left_out = configuration.faulty, configuration.is_left_out
    for name in names:
        path = Path(folder) / f"{name}.json"
        before = path.read_text(encoding="utf-8") if path.exists() and not is_cut_plan(path) else ""
        unchanged = (
            [e for e in json.loads(before)["turnouts"] if is_left_out(e["turnout"])] if before and faulty else []
        )
        entries = [_entry(configuration.turnout(t), Path(raw_root)) for t in members[name]]
        texts[path] = _text(name, sorted(entries + unchanged, key=itemgetter("turnout")))
        if before and before != texts[path]:
            # files of a turnout that was removed or renamed in the configuration do not count as missing
            files = _paths(e for e in json.loads(before)["turnouts"] if e["turnout"] in configuration.rows)
            missing += sorted(files - _paths(entries))
            n_known += len(files)
        elif before:
            n_known += sum(len(u[5]) for e in entries for u in e["units"])
    return texts, MissingFiles(missing, n_known)


def is_cut_plan(path: Path) -> bool:
    """Whether a plan file exists and is truncated.

    Parameters
    ----------
    path : Path
        The plan file.

    Returns
    -------
    bool
        False if there is no such file.
    """
    return is_truncated(path, PLAN_END)


def read_plan(path: Path) -> Iterator[PlannedUnit]:
    """Units of a plan file.

    Parameters
    ----------
    path : Path
        The plan file.

    Yields
    ------
    PlannedUnit
        One planned unit after the other.

    Raises
    ------
    ValueError
        If the file is truncated.
    """
    for entry in json.loads(Path(path).read_text(encoding="utf-8"))["turnouts"]:
        for kind, label, section, campaign, note, files in entry["units"]:
            files = tuple((f"{entry['raw']}/{name}", size, time) for name, size, time in files)
            unit = Unit(entry["turnout"], kind, label, files, entry["hashes"][kind], section, campaign)
            yield PlannedUnit(unit, note)


def read_problems(path: Path) -> Iterator[tuple[str, dict]]:
    """Excluded files of a plan file.

    Parameters
    ----------
    path : Path
        The plan file.

    Yields
    ------
    tuple of (str, dict)
        Id of the turnout, and its problem: path, where, found, remedy, reason.
    """
    for entry in json.loads(Path(path).read_text(encoding="utf-8"))["turnouts"]:
        for problem in entry["problems"]:
            yield entry["turnout"], dict(zip(("path", "where", "found", "remedy", "reason"), problem))


def _entry(turnout: TurnoutConfig, raw_root: Path) -> dict:
    """Plan entry of one turnout."""
    scanned = scan(turnout, raw_root)
    turnout, errors = read_notes(turnout, raw_root)
    notes, start = notes_of(turnout, scanned.units), len(turnout.raw) + 1
    return {
        "turnout": turnout.id,
        "raw": turnout.raw,
        "hashes": dict(turnout.hashes),
        "units": [
            [u.kind, u.label, u.section, u.campaign, note, [[p[start:], size, time] for p, size, time in u.files]]
            for u, note in zip(scanned.units, notes)
        ],
        "problems": [_problem(e) for e in (*scanned.problems, *errors)],
    }


def _problem(error: ReadError) -> list[str]:
    return [error.path, error.where, error.problem, error.remedy, error.reason]


def _text(shard: str, entries: list[dict]) -> str:
    """One line per turnout, so that two plans can be compared by eye."""
    lines = ",\n".join(json.dumps(e, ensure_ascii=False, separators=(",", ":")) for e in entries)
    return f'{{"shard":"{shard}","turnouts":[\n{lines}{PLAN_END}'


def _paths(entries: Iterable[dict]) -> set[str]:
    return {f"{e['raw']}/{f[0]}" for e in entries for u in e["units"] for f in u[5]}
