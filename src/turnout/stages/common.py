"""Read a raw file into its registry row, or into quarantine rows with the reasons why it is not used.

Also reads the numbers that people note in recordings.
"""

from collections.abc import Iterable, Mapping
from datetime import datetime, timedelta
from math import isfinite
from statistics import median
from typing import cast

from turnout.errors import ReadError
from turnout.readers import read
from turnout.registry.ids import content_id


def read_or_quarantine(path, raw_root, description, base, quarantine, unit_kind, ids_by_path=None, longest=None):
    """ReadResult of one file, or None; a quarantine row for the file or for each damaged record.

    Records longer than ``longest`` seconds of a large file are not loaded. ``ids_by_path`` maps the files read before
    to their ids: the same bytes are not used twice.
    """
    try:
        result = read(path, raw_root, description, longest)
    except ReadError as error:
        quarantine.append(quarantine_row(error, base, unit_kind, "read"))
        return None
    for damage in cast("tuple[ReadError, ...]", result.errors):
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


def time_contradiction(
    path: str, recordings: Iterable, filed_at: datetime | None, tolerance: timedelta, remedy: str
) -> ReadError | None:
    """Error if the first time noted in a file differs from ``filed_at``, the time it is filed under.

    ``tolerance`` is the largest accepted difference. None if both agree or one is not known.
    """
    recorded_at = min((r.started_at for r in recordings if r.started_at is not None), default=None)
    if filed_at is None or recorded_at is None or abs(recorded_at - filed_at) <= tolerance:
        return None
    observation = f"says it was recorded on {recorded_at:%Y-%m-%d %H:%M}, and is filed under {filed_at:%Y-%m-%d %H:%M}"
    return ReadError(path, "the file", observation, remedy, "wrong_time")


def quarantine_row(error: ReadError, base, unit_kind, stage, record=None, recording_id=None) -> dict:
    """Row of ``quarantine``: the error in columns."""
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


def recording_row(result, path, size, description, base, unit_kind, **more) -> dict:
    """Row of ``recordings``."""
    records = (*result.recordings, *result.long_recordings)
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


def number(notes: Mapping, name: str) -> float | None:
    """The value that a file notes under ``name`` as a number, None if it cannot be read.

    >>> number({"speed": "27,8"}, "speed"), number({"speed": "fast"}, "speed")
    (27.8, None)
    """
    try:
        value = float(str(notes[name]).strip().replace(",", "."))
    except (KeyError, ValueError):
        return None
    return value if isfinite(value) else None


def temperature(notes: Mapping) -> float | None:
    """The rail temperature that a file notes [°C], None without one or outside the plausible range.

    A broken thermometer notes 85 or 999.

    >>> temperature({"rail_temperature": "21,5"}), temperature({"rail_temperature": 999.0})
    (21.5, None)
    """
    value = number(notes, "rail_temperature")
    return value if value is not None and MIN_RAIL_TEMPERATURE <= value <= MAX_RAIL_TEMPERATURE else None


def rail_temperature(recordings: Iterable) -> float | None:
    """Median of the rail temperatures noted in recordings [°C], None without any."""
    temperatures = [t for r in recordings if (t := temperature(r.conditions)) is not None]
    return median(temperatures) if temperatures else None
