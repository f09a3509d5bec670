"""Named variables of npz and MATLAB files, in the layout of ``turnout.readers.named_arrays``."""

from turnout.readers.writing.encode import iso, noted


def variables(records):
    """All variables but the samples: ``rate``, ``channels``, ``units``, ``n_records``, ``started_at``, conditions."""
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
