"""NumPy archive: ``record_000`` ... as (channel, sample), and named variables beside them."""

from typing import Any

import numpy as np

from turnout.readers.writing.named import variables


def write_raw(records, path):
    """Every member carries its own CRC-32, so that a damaged record costs that record only."""
    members: dict[str, Any] = {k: np.asarray(v) for k, v in variables(records).items()}
    members |= {f"record_{k:03d}": np.vstack(record.samples) for k, record in enumerate(records)}
    with path.open("wb") as file:
        np.savez(file, **members)
