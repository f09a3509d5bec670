"""Read a raw file into its registry row, or into quarantine rows with the reasons why it is not used.

Also reads the numbers that people note in recordings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime, timedelta
from math import isfinite
from pathlib import Path
from statistics import median
from typing import Any, cast

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import LongRecording, RawDescription, ReadResult, Recording
from turnout.registry.ids import content_id

# Largest time between a recording and its campaign: it may last into the night, and a clock may show local time.
MAX_CAMPAIGN_OFFSET = timedelta(days=2)
MISFILED_REMEDY = (
    "It is used. Move it to its day's campaign if it is another's; a logger's clock that was wrong does no harm"
)
# Largest time between the file's name and its content; names in local time differ by less.
MAX_NAME_OFFSET = timedelta(days=1)
TIME_REMEDY = "Which is right is not known. Rename it, or export it again with the right time"


def require_file(path: str | Path) -> Path:
    """The path of a recording that a person names, checked before anything is read.

    Parameters
    ----------
    path : str or Path
        Path as it was written.

    Returns
    -------
    Path
        The same path.

    Raises
    ------
    ReadError
        There is no such file, or it is a folder.
    """
    path = Path(path)
    if path.is_dir():
        inside = sorted(p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
        remedy = f"Name the files in it, such as {inside[0]}" if inside else "It holds no file: name another one"
        raise ReadError(path, "the path", "it is a folder", remedy)
    if not path.exists():
        problem = "there is no such file, or no permission to read it"
        raise ReadError(path, "the path", problem, "Correct the path or the permission", "vanished")
    return path


def read_or_quarantine(
    path: str,
    raw_root: str | Path,
    description: RawDescription,
    base: Mapping[str, Any],
    quarantine: list[dict[str, Any]],
    unit_kind: str,
    ids_by_path: Mapping[str, str] | None = None,
    longest: float | None = None,
) -> ReadResult | None:
    """Read one file; a file or record that cannot be read becomes a row of ``quarantine``.

    Parameters
    ----------
    path : str
        Path of the file from ``raw_root``.
    raw_root : str or Path
        Raw folder.
    description : RawDescription
        Channels and format of the raw files.
    base : mapping of str to any
        Columns turnout_id and, where known, section_id and campaign_id.
    quarantine : list of dict of str to any
        Rows of ``quarantine``, to which the new ones are added.
    unit_kind : str
        "hammer" or "passage".
    ids_by_path : mapping of str to str or None
        Ids of the files read before, by path: the same bytes are not used twice.
    longest : float or None
        Longer records of a large file are not loaded. [s]

    Returns
    -------
    ReadResult or None
        None if nothing of the file can be used.
    """
    try:
        result = read(path, raw_root, description, longest)
    except ReadError as error:
        quarantine.append(quarantine_row(error, base, unit_kind, "read"))
        return None
    # one remark on the layout is enough: equal entries are in all files of a unit
    remarked = {row["remedy"] for row in quarantine if row["reason_code"] == "entry_unknown"}
    for damage in cast("tuple[ReadError, ...]", result.errors):
        if damage.reason == "entry_unknown" and damage.remedy in remarked:
            continue
        record = getattr(damage, "record", None)
        quarantine.append(quarantine_row(damage, base, unit_kind, "read", record, result.sha256[:32]))
    for earlier_path, recording_id in (ids_by_path or {}).items():
        if recording_id == result.sha256[:32]:
            duplicate = ReadError(
                path, "the file", f"same bytes as {earlier_path}", "Delete one of them", reason="duplicate"
            )
            quarantine.append(quarantine_row(duplicate, base, unit_kind, "read", None, recording_id))
            return None
    return result if result.recordings or result.long_recordings else None


def time_of_label(label: str) -> datetime | None:
    """Time of a unit from its file name, YYYYMMDDTHHMMSSZ.

    Parameters
    ----------
    label : str
        Label of the unit.

    Returns
    -------
    datetime or None
        Naive UTC; None without a valid time.
    """
    stem = label.rsplit("/", 1)[-1].split(".")[0]
    try:
        return datetime.strptime(stem, "%Y%m%dT%H%M%SZ")
    except ValueError:
        return None


def time_contradiction(
    path: str,
    recordings: Iterable[Recording | LongRecording],
    filed_at: datetime | None,
    tolerance: timedelta,
    remedy: str,
    reason: str = "wrong_time",
) -> ReadError | None:
    """Error if the first time noted in a file differs from the time that it is filed under.

    Parameters
    ----------
    path : str
        Path of the file.
    recordings : iterable of Recording or LongRecording
        Records of the file.
    filed_at : datetime or None
        Time that the file is filed under, naive UTC.
    tolerance : timedelta
        Largest accepted difference.
    remedy : str
        What to do, a sentence without its full stop.
    reason : str
        Code of the error; that of a remark where the file is used.

    Returns
    -------
    ReadError or None
        None if both times agree or one is not known; it is returned, not raised.
    """
    recorded_at = min((r.started_at for r in recordings if r.started_at is not None), default=None)
    if filed_at is None or recorded_at is None or abs(recorded_at - filed_at) <= tolerance:
        return None
    observation = f"says it was recorded on {recorded_at:%Y-%m-%d %H:%M}, and is filed under {filed_at:%Y-%m-%d %H:%M}"
    return ReadError(path, "the file", observation, remedy, reason)


def quarantine_row(
    error: ReadError,
    base: Mapping[str, Any],
    unit_kind: str,
    stage: str,
    record: int | None = None,
    recording_id: str | None = None,
) -> dict[str, Any]:
    """Row of ``quarantine``: the error in columns.

    Parameters
    ----------
    error : ReadError
        What is wrong, and where.
    base : mapping of str to any
        Columns turnout_id and, where known, section_id and campaign_id.
    unit_kind : str
        "hammer" or "passage".
    stage : str
        Stage that noticed it.
    record : int or None
        Number of the record in the file, from 0; None for the whole file.
    recording_id : str or None
        Id of the file's content, if it was read.

    Returns
    -------
    dict of str to any
        The row.
    """
    return {
        "quarantine_id": content_id("quarantine", error.path, str(record), stage, error.reason, error.problem),
        "turnout_id": base["turnout_id"],
        "section_id": base.get("section_id"),
        "kind": unit_kind,
        "path": error.path,
        "record": record,
        "recording_id": recording_id,
        "stage": stage,
        "reason_code": error.reason,
        "place": error.where,
        "found": error.problem,
        "remedy": error.remedy,
    }


def recording_row(
    result: ReadResult,
    path: str,
    size: int,
    description: RawDescription,
    base: Mapping[str, Any],
    unit_kind: str,
    **more: Any,
) -> dict[str, Any]:
    """Row of ``recordings``.

    Parameters
    ----------
    result : ReadResult
        Content of the file, with at least one record.
    path : str
        Path of the file from the raw folder.
    size : int
        Size of the file. [byte]
    description : RawDescription
        Channels and format of the raw files.
    base : mapping of str to any
        Columns turnout_id and, where known, section_id and campaign_id.
    unit_kind : str
        "hammer" or "passage".
    **more : any
        Further columns.

    Returns
    -------
    dict of str to any
        The row.
    """
    records: tuple[Recording | LongRecording, ...] = (*result.recordings, *result.long_recordings)
    first = records[0]
    return {
        "recording_id": result.sha256[:32],
        "turnout_id": base["turnout_id"],
        "section_id": base.get("section_id"),
        "campaign_id": base.get("campaign_id"),
        "kind": unit_kind,
        "path": path,
        "file_format": description.format if description.format != "auto" else path.rsplit(".", 1)[-1].lower(),
        "file_bytes": size,
        "sampling_rate_hz": first.rate,
        "n_channels": len(first.channels),
        "n_records": len(records),
        "n_samples": first.n_sample,
        "expected_n_samples": description.n_samples,
        **more,
    }


MIN_RAIL_TEMPERATURE, MAX_RAIL_TEMPERATURE = -50.0, 80.0  # °C: a noted rail temperature outside is a broken thermometer


def number(notes: Mapping[str, Any], name: str) -> float | None:
    """The value that a file notes under a name, as a number.

    Parameters
    ----------
    notes : mapping of str to any
        Notes of a record by name.
    name : str
        Name of the note.

    Returns
    -------
    float or None
        None if it is missing, no number or not finite.

    Examples
    --------
    >>> number({"speed": "27,8"}, "speed"), number({"speed": "fast"}, "speed")
    (27.8, None)
    """
    try:
        value = float(str(notes[name]).strip().replace(",", "."))
    except (KeyError, ValueError):
        return None
    return value if isfinite(value) else None


def temperature(notes: Mapping[str, Any]) -> float | None:
    """The rail temperature that a file notes. [°C]

    A broken thermometer notes 85 or 999.

    Parameters
    ----------
    notes : mapping of str to any
        Notes of a record by name.

    Returns
    -------
    float or None
        None without one, or outside the plausible range.

    Examples
    --------
    >>> temperature({"rail_temperature": "21,5"}), temperature({"rail_temperature": 999.0})
    (21.5, None)
    """
    value = number(notes, "rail_temperature")
    return value if value is not None and MIN_RAIL_TEMPERATURE <= value <= MAX_RAIL_TEMPERATURE else None


def rail_temperature(recordings: Iterable[Recording]) -> float | None:
    """Median of the rail temperatures noted in recordings. [°C]

    Parameters
    ----------
    recordings : iterable of Recording
        Recordings of one section and campaign.

    Returns
    -------
    float or None
        None if no recording notes one.
    """
    temperatures = [t for r in recordings if (t := temperature(r.conditions)) is not None]
    return median(temperatures) if temperatures else None
