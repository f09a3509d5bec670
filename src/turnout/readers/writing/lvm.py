"""Writer of LabVIEW measurement files: a segment per record, separated by tabs, no X column."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from turnout.readers.writing.encode import RecordToWrite, plain_conditions

END = "***End_of_Header***"


def write_raw(records: Sequence[RecordToWrite], path: Path, decimal_comma: bool = False) -> None:
    """Write rows of numbers with 17 digits (9 in single precision).

    Parameters
    ----------
    records : sequence of RecordToWrite
        Records of one file.
    path : Path
        File to write.
    decimal_comma : bool
        Write decimal commas.
    """
    first = records[0]
    head = ["LabVIEW Measurement", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab"]
    head += [f"Decimal_Separator\t{',' if decimal_comma else '.'}", "Multi_Headings\tYes", "X_Columns\tNo"]
    head += ["Time_Pref\tAbsolute", f"Records\t{len(records)}"]
    head += [f"{key}\t{value}" for key, value in plain_conditions(first.conditions).items()]
    digits = "%.9g" if first.samples[0].dtype == np.float32 else "%.17g"
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write("\n".join([*head, END, "", ""]))
        for record in records:
            text = _segment(record, digits)
            file.write(text.replace(".", ",") if decimal_comma else text)


def _segment(record: RecordToWrite, digits: str) -> str:
    n = len(record.names)

    def row(name: str, values: Sequence[str]) -> str:
        return "\t".join([name, *values, ""])

    lines = [row("Channels", [str(n)]), row("Samples", [str(len(record.samples[0]))] * n)]
    if record.started_at is not None:
        lines += [row("Date", [record.started_at.strftime("%Y/%m/%d")] * n)]
        lines += [row("Time", [record.started_at.strftime("%H:%M:%S.%f")] * n)]
    lines += [row("Y_Unit_Label", record.units), row("X_Dimension", ["Time"] * n)]
    lines += [row("X0", ["0.0"] * n), row("Delta_X", [repr(1.0 / record.rate)] * n)]
    lines += [END + "\t" * (n + 1), "\t".join(["X_Value", *record.names, "Comment"])]
    lines += ["\t" + "\t".join(digits % x for x in values) for values in zip(*record.samples)]
    return "\n".join(lines) + "\n\n"
