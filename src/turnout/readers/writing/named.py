"""Named variables of npz and MATLAB files, in the layout of ``turnout.readers.named_arrays``."""

from turnout.readers.writing.encode import iso_text, plain_conditions


def variables(records):
    """All variables but the samples: ``rate``, ``channels``, ``units``, ``n_records``, ``started_at``, conditions."""
    first = records[0]
    values = {
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
