"""Writer of RCM-DX 2.0: a session per record, a measuring system, one data source, a channel group per channel.

SECTION, POSITION and TOPOLOGY are left out because they describe a moving vehicle; so is the index ``timeindex``.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import h5py
import numpy as np

from turnout.readers.rcmdx import EPOCH
from turnout.readers.writing.encode import RecordToWrite, attributes, plain_conditions

CHANNEL = {
    "Element": "CHANNEL",
    "TriggerMode": "TIME",
    "CommonTriggerDistance": np.float32(0),
    "ChannelBasis": "ABSOLUTE",
    "ChannelType": "MEASURED",
    "Neighbor": "",
    "PositionOffset": np.float32(0),
}


def write_raw(records: Sequence[RecordToWrite], path: Path, station: str = "TURNOUT") -> None:
    """Write sessions, named by their first time stamp; records without a start time are put 1 min apart.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    station : str
        Name of the measuring station; it is a part of the names of all groups.
    """
    with h5py.File(path, "w") as file:
        root = file.create_group("RCMDX")
        root.attrs.update({"Major": np.int16(2), "Minor": np.int16(0), "RecordCount": np.int32(len(records))})
        platform = root.create_group(station)
        platform.attrs.update(attributes({"Name": station, "VehicleNumber": "", "Element": "PLATFORM"}))
        for k, record in enumerate(records):
            start = record.started_at or EPOCH + timedelta(minutes=k)
            _session(platform, record, start.astimezone(UTC), station)


def _session(platform: h5py.Group, record: RecordToWrite, start: datetime, station: str) -> None:
    first = int((start - EPOCH) / timedelta(microseconds=1)) * 1000
    n = len(record.samples[0])
    stamps = first + np.round(np.arange(n) * (1e9 / record.rate)).astype("int64")
    name = start.strftime("%Y%m%d_%H%M%S.") + f"{start.microsecond // 1000:03d}"
    session = platform.create_group(name)
    times = {"StartTime": stamps[0], "EndTime": stamps[-1]}
    session.attrs.update(attributes({"Element": "SESSION", **times, **plain_conditions(record.conditions)}))
    system = session.create_group(f"{station}.VIBRATION")
    system_attributes = {"Element": "MEASURINGSYSTEM", "Family": "VIBRATION", "Revision": "1", "InstanceVersion": "1"}
    system.attrs.update(attributes(system_attributes))
    source = system.create_group(f"{system.name.rpartition('/')[2]}.SAMPLES", track_order=True)
    source.attrs.update(attributes({"Element": "DATASOURCE"}))
    source.create_dataset("timestamp", data=stamps, chunks=stamps.shape, compression="gzip", fletcher32=True)
    for channel, unit, samples in zip(record.names, record.units, record.samples):
        group = source.create_group(f"{station}.VIBRATION.SAMPLES.{channel}")
        group.attrs.update(attributes({**CHANNEL, "CommonTriggerFrequency": np.float32(record.rate)}))
        data = group.create_dataset("data", data=samples, chunks=samples.shape, fletcher32=True)
        data.attrs.update(attributes({"Unit": unit}))
