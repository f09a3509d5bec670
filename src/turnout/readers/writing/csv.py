"""Writer of text: ``# name: value`` lines, names with units in brackets, numbers with 17 digits."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from turnout.readers.writing.encode import RecordToWrite, iso_text, plain_conditions


def write_raw(records: Sequence[RecordToWrite], path: Path, decimal_comma: bool = False) -> None:
    """Write a column ``record`` and a column per channel.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    decimal_comma : bool
        Write decimal commas, with semicolons between the columns.
    """
    first = records[0]
    separator = ";" if decimal_comma else ","
    lengths = {len(record.samples[0]) for record in records}
    head = [f"# rate: {first.rate!r} Hz", f"# n_records: {len(records)}"]
    head += [f"# n_samples: {lengths.pop()}"] if len(lengths) == 1 else []
    head += [f"# started_at_{k}: {iso_text(r.started_at)}" for k, r in enumerate(records) if r.started_at is not None]
    head += [f"# {key}: {value}" for key, value in plain_conditions(first.conditions).items()]
    names = [f"{name} [{unit}]" for name, unit in zip(first.names, first.units)]
    head.append(separator.join(["record", *names]))
    digits = "%.9g" if first.samples[0].dtype == np.float32 else "%.17g"
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write("\n".join(head) + "\n")
        for k, record in enumerate(records):
            lines = [separator.join([str(k), *(digits % x for x in row)]) for row in zip(*record.samples)]
            text = "\n".join(lines) + "\n"
            file.write(text.replace(".", ",") if decimal_comma else text)
