"""Writer of TDMS: a group and a segment per record, waveform properties on every channel."""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from turnout.readers.writing.encode import RecordToWrite, plain_conditions


def write_raw(records: Sequence[RecordToWrite], path: Path) -> None:
    """Write one segment per record, so that a truncated file loses its last records only.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    """
    with TdmsWriter(str(path)) as writer:
        for k, record in enumerate(records):
            root = RootObject(properties={"n_records": len(records)})
            name = f"record_{k:03d}"
            group = GroupObject(name, properties=plain_conditions(record.conditions))
            start = {} if record.started_at is None else {"wf_start_time": _utc(record.started_at)}
            channels = [
                ChannelObject(
                    name,
                    channel,
                    samples,
                    properties={
                        "unit_string": unit,
                        "wf_increment": 1.0 / record.rate,
                        "wf_samples": len(samples),
                        **start,
                    },
                )
                for channel, unit, samples in zip(record.names, record.units, record.samples)
            ]
            writer.write_segment([root, group, *channels])


def _utc(moment: datetime) -> np.datetime64:
    """A time stamp in UTC, as TDMS stores it."""
    return np.datetime64(int(moment.timestamp() * 1_000_000), "us")
