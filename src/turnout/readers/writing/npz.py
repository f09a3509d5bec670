"""Writer of NumPy archives: ``record_000`` ... as (channel, sample), and named variables."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from turnout.readers.writing.encode import RecordToWrite, variables


def write_raw(records: Sequence[RecordToWrite], path: Path) -> None:
    """Write one member per record; each has its own CRC-32, so that damage is limited to one record.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    """
    members: dict[str, Any] = {k: np.asarray(v) for k, v in variables(records).items()}
    members |= {f"record_{k:03d}": np.vstack(record.samples) for k, record in enumerate(records)}
    with path.open("wb") as file:
        np.savez(file, **members)
