"""Writer of HDF5 in the layout of ``turnout.readers.hdf5``: a group per record, a dataset per channel, checksums."""

from collections.abc import Sequence
from pathlib import Path

from turnout.readers.writing.encode import RecordToWrite, attributes, fixed_text, iso_text, plain_conditions
from turnout.readers.writing.hdf5_content import hdf5_content


def write_raw(records: Sequence[RecordToWrite], path: Path) -> None:
    """Write attributes ``rate`` and ``n_records`` at the root, ``started_at`` and conditions at each record.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    """
    with hdf5_content(path, libver=("v110", "latest")) as file:
        file.attrs["rate"] = records[0].rate
        file.attrs["n_records"] = len(records)
        for k, record in enumerate(records):
            group = file.create_group(f"record_{k:03d}", track_order=True)
            group.attrs.update(attributes(plain_conditions(record.conditions)))
            if record.started_at is not None:
                group.attrs["started_at"] = fixed_text(iso_text(record.started_at))
            for name, unit, samples in zip(record.names, record.units, record.samples):
                dataset = group.create_dataset(name, data=samples, chunks=(len(samples),), fletcher32=True)
                dataset.attrs["unit"] = fixed_text(unit)
