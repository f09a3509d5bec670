"""Writer of Universal File Format 58 (ASCII) and 58b (binary): one set per record and channel.

Record 6, field 3 is the number of the record. ID line 5 states that number and the number of records, because a file
that is truncated between two sets would otherwise look complete.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from turnout.readers.writing.encode import RecordToWrite, plain_conditions

DATA_TYPES = {"N": 13, "m/s²": 12, "g": 12, "m/s": 11, "m": 8, "Pa": 15}


def write_raw(records: Sequence[RecordToWrite], path: Path, binary: bool) -> None:
    """Write the sets record by record; ASCII has 6 or 13 digits, as the format requires.

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    binary : bool
        Write 58b instead of 58.
    """
    with path.open("wb") as file:
        for k, record in enumerate(records):
            for i in range(len(record.names)):
                file.write(_set(record, i, k, len(records), binary))


def _set(record: RecordToWrite, i: int, k: int, n: int, binary: bool) -> bytes:
    samples = record.samples[i]
    double = samples.dtype == np.float64
    numbers = samples.astype("<f8" if double else "<f4").tobytes() if binary else _text(samples, double)
    return _head(record, i, k, n, binary, double, len(numbers)) + numbers + b"    -1\n"


def _head(record: RecordToWrite, i: int, k: int, n: int, binary: bool, double: bool, n_bytes: int) -> bytes:
    """The opening delimiter and records 1 to 11."""
    name, unit = record.names[i], record.units[i]
    start = "NONE" if record.started_at is None else record.started_at.strftime("%d-%b-%y %H:%M:%S")
    notes = "; ".join(f"{key}={value}" for key, value in plain_conditions(record.conditions).items()) or "NONE"
    first = f"    58b     1     2          11{n_bytes:12d}     0     0           0           0" if binary else "    58"
    lines = [
        "    -1",
        f"{first:<80}",
        f"{name:<80.80}",
        f"{'NONE':<80}",
        f"{start:<80}",
        f"{notes:<80.80}",
        f"{f'record {k + 1} of {n}':<80}",
        f"{1:5d}{0:10d}{k + 1:5d}{0:10d} {name:<10.10}{i + 1:10d}{0:4d} {'NONE':<10}{0:10d}{0:4d}",
        f"{4 if double else 2:10d}{len(record.samples[i]):10d}{1:10d}{0.0:13.5e}{1 / record.rate:13.5e}{0.0:13.5e}",
        f"{17:10d}{0:5d}{0:5d}{0:5d} {'time':<20} {'s':<20}",
        f"{DATA_TYPES.get(unit, 0):10d}{0:5d}{0:5d}{0:5d} {name:<20.20} {unit:<20.20}",
        f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}",
        f"{0:10d}{0:5d}{0:5d}{0:5d} {'NONE':<20} {'NONE':<20}",
    ]
    return ("\n".join(lines) + "\n").encode()


def _text(samples: np.ndarray, double: bool) -> bytes:
    """Numbers as text in the Fortran format 6E13.5 or 4E20.12."""
    number_format, per_line = ("%20.12e", 4) if double else ("%13.5e", 6)
    lines = [samples[a : a + per_line] for a in range(0, len(samples), per_line)]
    return "".join((number_format * len(line) + "\n") % tuple(line) for line in lines).encode()
