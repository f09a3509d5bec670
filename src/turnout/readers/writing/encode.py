"""Conversion of SI samples to the numbers of a raw file: the inverse of ``turnout.readers.interpret``.

``variables`` are the named variables of npz, MATLAB and Parquet files, as ``turnout.readers.named_arrays`` reads them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any
from zoneinfo import ZoneInfo

import h5py
import numpy as np

from turnout.readers.source import RawRecord
from turnout.records import RawChannel, RawDescription, Recording
from turnout.units import IGNORED, SI, to_si


@dataclass(frozen=True)
class RecordToWrite(RawRecord):
    """A record whose samples are arrays in memory and whose rate [Hz] is known."""

    samples: Sequence[np.ndarray]
    rate: float = 0.0


def raw_records(recordings: Sequence[Recording], description: RawDescription | None, dtype: str) -> list[RecordToWrite]:
    """Convert recordings to the records of a raw file.

    Parameters
    ----------
    recordings : sequence of Recording
        Recordings with the same channels and rate.
    description : RawDescription or None
        Units, names, signs and order of the channels in the file; None: SI.
    dtype : str
        Type of the numbers in the file, "float32" or "float64".

    Returns
    -------
    list of RecordToWrite
        One record per recording.

    Raises
    ------
    ValueError
        If there is no recording, or their channels or rates differ.
    """
    if not recordings:
        raise ValueError("there is no recording to write")
    first = recordings[0]
    if any(r.channels != first.channels or r.rate != first.rate for r in recordings):
        raise ValueError("recordings of one file must have the same channels and rate")
    return [_raw_record(recording, description, dtype) for recording in recordings]


def _raw_record(recording: Recording, description: RawDescription | None, dtype: str) -> RecordToWrite:
    if description is None:
        columns = [(c.name, SI[c.quantity], x) for c, x in zip(recording.channels, recording.samples)]
        zone = "UTC"
    else:
        wanted = [c for c in description.channels if c.quantity != IGNORED]
        wanted.sort(key=lambda c: c.source if isinstance(c.source, int) else 0)
        columns = [_column(recording, channel) for channel in wanted]
        zone = description.time_zone
    start = recording.started_at
    return RecordToWrite(
        names=tuple(name for name, _, _ in columns),
        samples=[np.asarray(x, dtype=dtype) for _, _, x in columns],
        rate=recording.rate,
        units=tuple(unit for _, unit, _ in columns),
        started_at=None if start is None else start.replace(tzinfo=UTC).astimezone(ZoneInfo(zone)),
        conditions=dict(recording.conditions),
    )


def _column(recording: Recording, channel: RawChannel) -> tuple[str, str, np.ndarray]:
    """(name, unit, raw numbers) of one channel of the description."""
    unit = (channel.unit or SI[channel.quantity]).removesuffix("!")
    conversion_to_si = to_si(channel.quantity, unit, channel.sensitivity, channel.sensitivity_unit)
    samples = (
        recording.signal(channel.name) * (-1 if channel.sign < 0 else 1) - conversion_to_si.offset
    ) / conversion_to_si.scale
    label = "count" if unit[:1].isdigit() else unit
    return (channel.source if isinstance(channel.source, str) else channel.name), label, samples


def iso_text(moment: datetime | None) -> str:
    """ISO 8601 text of a time.

    Parameters
    ----------
    moment : datetime or None
        The time, or None.

    Returns
    -------
    str
        Text with the offset of the time zone; "" for None.
    """
    return "" if moment is None else moment.isoformat()


def plain_conditions(conditions: Mapping[str, Any]) -> dict[str, float | str]:
    """Conditions as plain numbers and text.

    Parameters
    ----------
    conditions : mapping of str to any
        Name -> number or any other value.

    Returns
    -------
    dict of str to float or str
        Name -> float or text.
    """
    return {k: float(v) if isinstance(v, (int, float, np.number)) else str(v) for k, v in conditions.items()}


def fixed_text(text: str) -> np.ndarray:
    """Text for an HDF5 attribute, of fixed length.

    Text of variable length is stored in the global heap, and the HDF5 library can loop forever over a damaged heap.

    Parameters
    ----------
    text : str
        The text; an empty one is stored as a blank.

    Returns
    -------
    () array
        One text of fixed length in UTF-8.
    """
    data = text.encode("utf-8") or b" "
    return np.array(data, dtype=h5py.string_dtype("utf-8", len(data)))


def attributes(values: Mapping[str, Any]) -> dict[str, Any]:
    """A dictionary of numbers and text as HDF5 attributes.

    Parameters
    ----------
    values : mapping of str to any
        Name -> number or text.

    Returns
    -------
    dict of str to any
        The same, with texts of fixed length.
    """
    return {key: fixed_text(value) if isinstance(value, str) else value for key, value in values.items()}


def variables(records: Sequence[RecordToWrite]) -> dict[str, Any]:
    """All variables except the samples.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records with the same channels and rate.

    Returns
    -------
    dict of str to any
        ``rate``, ``channels``, ``units``, ``n_records``, conditions; ``started_at`` if all records have a start.
    """
    first = records[0]
    values: dict[str, Any] = {
        "rate": first.rate,
        "n_records": float(len(records)),
        "channels": list(first.names),
        "units": list(first.units),
    }
    if all(record.started_at is not None for record in records):
        values["started_at"] = [iso_text(record.started_at) for record in records]
    for key in first.conditions:
        values[key] = [plain_conditions(record.conditions).get(key) for record in records]
    return values
