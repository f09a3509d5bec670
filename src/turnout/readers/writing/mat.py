"""Writer of MATLAB version 5: ``record_000`` ... as (sample, channel) matrices, and named variables."""

import numpy as np
import scipy.io

from turnout.readers.writing.named import variables


def write_raw(records, path):
    """Write text as cell arrays, one cell per channel or record. Compression, as in MATLAB, adds checksums."""
    metadata = {k: _cells(v) for k, v in variables(records).items()}
    samples = {f"record_{k:03d}": np.column_stack(record.samples) for k, record in enumerate(records)}
    scipy.io.savemat(path, {**metadata, **samples}, appendmat=False, do_compression=True, oned_as="row")


def _cells(value):
    return np.array(value, dtype=object) if isinstance(value, list) and isinstance(value[0], str) else value
