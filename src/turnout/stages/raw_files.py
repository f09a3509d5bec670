"""Read a raw file into its registry row, or into quarantine rows with the reasons why it is not used."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from turnout.config.campaign_notes import NOTE_FILES
from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import LongRecording, RawDescription, ReadResult, Recording
from turnout.registry.ids import content_id


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
        files = (p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
        inside = sorted(p for p in files if p.name not in NOTE_FILES)  # a table is no recording
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
        quarantine.append(quarantine_row(damage, base, unit_kind, "read", damage.record, result.sha256[:32]))
    for earlier_path, recording_id in (ids_by_path or {}).items():
        if recording_id == result.sha256[:32]:
            duplicate = ReadError(
                path, "the file", f"same bytes as {earlier_path}", "Delete one of them", reason="duplicate"
            )
            quarantine.append(quarantine_row(duplicate, base, unit_kind, "read", None, recording_id))
            return None
    return result if result.recordings or result.long_recordings else None


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
