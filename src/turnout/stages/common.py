"""A raw file on its way in: its row, or the quarantine rows that say why it or a part of it is not used.

Numbers that recordings carry as notes, as people write them.
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

    Records of more than ``longest`` seconds of a large file stay in it. ``known`` maps the files that were read before
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
    """What is wrong where the first time that a file notes lies further than ``apart`` from the one it is filed under.

    None where both agree, or one of them is not known.
    """
    told = min((r.started_at for r in recordings if r.started_at is not None), default=None)
    if named is None or told is None or abs(told - named) <= apart:
        return None
    found = f"says it was recorded on {told:%Y-%m-%d %H:%M}, and is filed under {named:%Y-%m-%d %H:%M}"
    return ReadError(path, "the file", found, remedy, "wrong_time")


def quarantine_row(error: ReadError, base, kind, stage, record=None, recording_id=None) -> dict:
    """Row of ``quarantine``: what the error says, in columns."""
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


COLDEST, HOTTEST = -50.0, 80.0  # of a rail [°C]


def number(said: Mapping, name: str) -> float | None:
    """What a file notes under ``name`` as a number, None where there is none to be read.

    >>> number({"speed": "27,8"}, "speed"), number({"speed": "fast"}, "speed")
    (27.8, None)
    """
    try:
        value = float(str(said[name]).strip().replace(",", "."))
    except (KeyError, ValueError):
        return None
    return value if isfinite(value) else None


def temperature(said: Mapping) -> float | None:
    """The rail temperature that a file notes [°C], None without one and where no rail is as cold or hot: a thermometer
    that is broken says 85 or 999.

    >>> temperature({"rail_temperature": "21,5"}), temperature({"rail_temperature": 999.0})
    (21.5, None)
    """
    value = number(said, "rail_temperature")
    return value if value is not None and COLDEST <= value <= HOTTEST else None


def rail_temperature(recordings: Iterable) -> float | None:
    """Median of the rail temperatures that recordings note [°C], None without any."""
    told = [t for r in recordings if (t := temperature(r.conditions)) is not None]
    return median(told) if told else None
