"""Writer of RCM-DX 2.0: one session, one measuring system, a data source per record, a channel group per channel.

Groups, attributes and their types are those of the specification 2.0.2 of the OpenRail Association (document 1.04),
with the groups that it requires of every file: FILE, CONFIGURATION, and SECTIONS without an entry, since a fixed
station travels over no track. TOPOLOGY is left out, as it may be where the network is described elsewhere.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import h5py
import numpy as np

from turnout.readers.rcmdx import EPOCH
from turnout.readers.writing.encode import RecordToWrite, attributes, plain_conditions
from turnout.readers.writing.hdf5_content import hdf5_content

VERSION = {"Major": np.int16(2), "Minor": np.int16(0), "Feature": np.int16(2)}
CHANNEL = {
    "Element": "Channel",
    "TriggerMode": "TIME",
    "CommonTriggerDistance": np.float64(0),
    "ChannelBasis": "TOTAL",
    "MoveDirAutoInvert": np.int8(0),
    "MeasurementType": "MEASURED_VALUE",
    "Neighbor": "",
    "PositionOffset": np.float32(0),
}
# Columns of the table of travelled sections, with the type of their entries.
SECTION_COLUMNS = {
    "direction": "S8", "startTimestamp": "u8", "endTimestamp": "u8", "firstTrackOffset": "f8", "lastTrackOffset": "f8",
    "trackInfoOffset": "f8", "trackId": "i4", "trackStartTimestamp": "u8", "trackEndTimestamp": "u8",
    "trackKilometrage": "S10", "trackStartCoveredDistance": "f8", "trackEndCoveredDistance": "f8",
}  # fmt: skip


def write_raw(records: Sequence[RecordToWrite], path: Path, station: str = "TURNOUT") -> None:
    """Write one session, named by its first time stamp; records without a start time are put 1 min apart.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    station : str
        Name of the measuring station, that of the platform group.
    """
    starts = [(record.started_at or EPOCH + timedelta(minutes=k)).astimezone(UTC) for k, record in enumerate(records)]
    stamps = [_stamps(record, start) for record, start in zip(records, starts)]
    first = min(starts)
    with hdf5_content(path) as file:
        root = file.create_group("RCMDX")
        root.attrs.update({**VERSION, "RecordCount": np.int32(len(records))})
        root.create_group("FILE").attrs.update(attributes({"Element": "File", "StructureVersion": "1"}))
        platform = root.create_group(station)
        platform.attrs.update(attributes({"Element": "Platform", "VehicleNumber": ""}))
        session = platform.create_group(first.strftime("%Y%m%d_%H%M%S.") + f"{first.microsecond // 1000:03d}")
        times = {"StartTime": min(s[0] for s in stamps), "EndTime": max(s[-1] for s in stamps)}
        session.attrs.update(attributes({"Element": "Session", **times}))
        session.create_group("CONFIGURATION")
        sections = session.create_group("SECTIONS")
        sections.attrs.update(attributes({"Element": "Sections"}))
        for name, kind in SECTION_COLUMNS.items():
            sections.create_dataset(name, shape=(0,), dtype=kind)
        system = session.create_group("VIBRATION")
        system.attrs.update(attributes({"Element": "System"}))
        for k, (record, record_stamps) in enumerate(zip(records, stamps)):
            _data_source(system.create_group(f"RECORD_{k + 1:06d}", track_order=True), record, record_stamps)


def _stamps(record: RecordToWrite, start: datetime) -> np.ndarray:
    """(n,) time stamps of the samples. [ns since 1970 UTC]"""
    first = int((start - EPOCH) / timedelta(microseconds=1)) * 1000
    return (first + np.round(np.arange(len(record.samples[0])) * (1e9 / record.rate)).astype("int64")).astype("uint64")


def _data_source(group: h5py.Group, record: RecordToWrite, stamps: np.ndarray) -> None:
    group.attrs.update(attributes({"Element": "Datasource", **plain_conditions(record.conditions)}))
    group.create_dataset("timestamp", data=stamps, chunks=stamps.shape, compression="gzip", fletcher32=True)
    for name, unit, samples in zip(record.names, record.units, record.samples):
        channel = group.create_group(name)
        channel.attrs.update(attributes({**CHANNEL, "CommonTriggerFrequency": np.float64(record.rate)}))
        data = channel.create_dataset("data", data=samples, chunks=samples.shape, fletcher32=True)
        data.attrs.update(attributes({"Unit": unit}))
