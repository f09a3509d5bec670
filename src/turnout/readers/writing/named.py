"""The named variables that npz and MATLAB files share; the layout of ``turnout.readers.named_arrays``."""

from turnout.readers.writing.encode import iso, noted


def variables(records):
    """``rate``, ``channels``, ``units``, ``n_records``, ``started_at``, conditions, all but the samples."""
    first = records[0]
    named = {
        "rate": first.rate,
        "n_records": float(len(records)),
        "channels": list(first.names),
        "units": list(first.units),
    }
    if all(record.started_at is not None for record in records):
        named["started_at"] = [iso(record.started_at) for record in records]
    for key in first.conditions:
        named[key] = [noted(record.conditions).get(key) for record in records]
    return named
