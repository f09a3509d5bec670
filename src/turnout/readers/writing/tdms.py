"""Writer of TDMS: a group and a segment per record, waveform properties on every channel."""

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter

from turnout.readers.writing.encode import plain_conditions


def write_raw(records, path):
    """Write one segment per record, so that a truncated file loses its last records only."""
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


def _utc(moment):
    """A time stamp in UTC, as TDMS stores it."""
    return np.datetime64(int(moment.timestamp() * 1_000_000), "us")
