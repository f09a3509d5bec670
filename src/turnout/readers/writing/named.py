"""Named variables of npz and MATLAB files, in the layout of ``turnout.readers.named_arrays``."""

from collections.abc import Sequence
from typing import Any

from turnout.readers.writing.encode import RecordToWrite, iso_text, plain_conditions


def variables(records: Sequence[RecordToWrite]) -> dict[str, Any]:
    """All variables except the samples.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records with the same channels and rate.

    Returns
    -------
    dict of str to any
        ``rate``, ``channels``, ``units``, ``n_records``, conditions; ``started_at`` if all records have a start.
    """
    first = records[0]
    values: dict[str, Any] = {
        "rate": first.rate,
        "n_records": float(len(records)),
        "channels": list(first.names),
        "units": list(first.units),
    }
    if all(record.started_at is not None for record in records):
        values["started_at"] = [iso_text(record.started_at) for record in records]
    for key in first.conditions:
        values[key] = [plain_conditions(record.conditions).get(key) for record in records]
    return values
