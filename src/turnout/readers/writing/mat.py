"""Writer of MATLAB version 5: ``record_000`` ... as (sample, channel) matrices, and named variables."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from turnout.readers.writing.encode import RecordToWrite, variables

HEADER = b"MATLAB 5.0 MAT-file, Platform: GLNXA64"  # without the time of writing: equal records give equal files


def write_raw(records: Sequence[RecordToWrite], path: Path) -> None:
    """Write text as cell arrays, one cell per channel or record. Compression, as in MATLAB, adds checksums.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    """
    metadata = {k: _cells(v) for k, v in variables(records).items()}
    samples = {f"record_{k:03d}": np.column_stack(record.samples) for k, record in enumerate(records)}
    scipy.io.savemat(path, {**metadata, **samples}, appendmat=False, do_compression=True, oned_as="row")
    with path.open("r+b") as file:
        file.write(HEADER.ljust(116))


def _cells(value: Any) -> Any:
    return np.array(value, dtype=object) if isinstance(value, list) and isinstance(value[0], str) else value
