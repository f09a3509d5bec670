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


def read_or_quarantine(path, raw_root, description, base, quarantine, kind, known=None, longest=None):
    """ReadResult of one file, or None; a quarantine row for the file or for each damaged record.

    Records longer than ``longest`` seconds of a large file are not loaded. ``ids_by_path`` maps the files read before
    to their ids: the same bytes are not used twice.
    """
    try:
        result = read(path, raw_root, description, longest)
    except ReadError as error:
        quarantine.append(quarantine_row(error, base, kind, "read"))
        return None
    for damage in cast("tuple[ReadError, ...]", result.errors):
        record = getattr(damage, "record", None)
        quarantine.append(quarantine_row(damage, base, kind, "read", record, result.sha256[:32]))
    for other, recording_id in (known or {}).items():
        if recording_id == result.sha256[:32]:
            twice = ReadError(path, "the file", f"same bytes as {other}", "Delete one of them", reason="duplicate")
            quarantine.append(quarantine_row(twice, base, kind, "read", None, recording_id))
            return None
    return result if result.recordings or result.long else None


def contradiction(
    path: str, recordings: Iterable, named: datetime | None, apart: timedelta, remedy: str
) -> ReadError | None:
    """Error if the first time noted in a file differs from ``filed_at``, the time it is filed under.

    ``tolerance`` is the largest accepted difference. None if both agree or one is not known.
    """
    told = min((r.started_at for r in recordings if r.started_at is not None), default=None)
    if named is None or told is None or abs(told - named) <= apart:
        return None
    found = f"says it was recorded on {told:%Y-%m-%d %H:%M}, and is filed under {named:%Y-%m-%d %H:%M}"
    return ReadError(path, "the file", found, remedy, "wrong_time")


def quarantine_row(error: ReadError, base, kind, stage, record=None, recording_id=None) -> dict:
    """Row of ``quarantine``: the error in columns."""
    return {
        "quarantine_id": content_id("quarantine", error.path, str(record), stage, error.reason, error.found),
        "turnout_id": base["turnout_id"],
        "section_id": base.get("section_id"),
        "kind": kind,
        "path": error.path,
        "record": record,
        "recording_id": recording_id,
        "stage": stage,
        "reason_code": error.reason,
        "place": error.where,
        "found": error.found,
        "remedy": error.remedy,
    }


def recording_row(result, path, size, description, base, kind, **more) -> dict:
    """Row of ``recordings``."""
    everything = (*result.recordings, *result.long)
    first = everything[0]
    return {
        "recording_id": result.sha256[:32],
        "turnout_id": base["turnout_id"],
        "section_id": base.get("section_id"),
        "campaign_id": base.get("campaign_id"),
        "kind": kind,
        "path": path,
        "file_format": description.format if description.format != "auto" else path.rsplit(".", 1)[-1].lower(),
        "file_bytes": size,
        "sampling_rate_hz": first.rate,
        "n_channels": len(first.channels),
        "n_records": len(everything),
        "n_samples": first.n_sample,
        "expected_n_samples": description.n_samples,
        **more,
    }


COLDEST, HOTTEST = -50.0, 80.0  # °C: a noted rail temperature outside is a broken thermometer


def number(said: Mapping, name: str) -> float | None:
    """The value that a file notes under ``name`` as a number, None if it cannot be read.

    >>> number({"speed": "27,8"}, "speed"), number({"speed": "fast"}, "speed")
    (27.8, None)
    """
    try:
        value = float(str(said[name]).strip().replace(",", "."))
    except (KeyError, ValueError):
        return None
    return value if isfinite(value) else None


def temperature(said: Mapping) -> float | None:
    """The rail temperature that a file notes [°C], None without one or outside the plausible range.

    A broken thermometer notes 85 or 999.

    >>> temperature({"rail_temperature": "21,5"}), temperature({"rail_temperature": 999.0})
    (21.5, None)
    """
    value = number(said, "rail_temperature")
    return value if value is not None and COLDEST <= value <= HOTTEST else None


def rail_temperature(recordings: Iterable) -> float | None:
    """Median of the rail temperatures noted in recordings [°C], None without any."""
    told = [t for r in recordings if (t := temperature(r.conditions)) is not None]
    return median(told) if told else None
