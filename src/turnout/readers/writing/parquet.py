"""Writer of Parquet in the layout of ``turnout.readers.parquet``, with a checksum on every page."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from turnout.readers.writing.encode import RecordToWrite, variables


def write_raw(records: Sequence[RecordToWrite], path: Path) -> None:
    """Write a column ``record``, a column per channel, and the metadata as JSON in the schema.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    """
    first = records[0]
    lengths = [len(record.samples[0]) for record in records]
    notes = {**variables(records), "n_samples": lengths}
    columns = [np.repeat(np.arange(len(records), dtype="int32"), lengths)]
    columns += [np.concatenate([record.samples[i] for record in records]) for i in range(len(first.names))]
    fields = [pa.field("record", pa.int32())]
    fields += [
        pa.field(name, pa.from_numpy_dtype(samples.dtype), metadata={"unit": unit})
        for name, unit, samples in zip(first.names, first.units, first.samples)
    ]
    schema = pa.schema(fields, metadata={"turnout": json.dumps(notes)})
    table = pa.Table.from_arrays([pa.array(c) for c in columns], schema=schema)
    pq.write_table(table, path, compression="zstd", use_dictionary=False, write_page_checksum=True)
