"""Seeded mutated files of every format: crashes, hangs, and what is read differently without any message."""

import os

from benchmarks.bar import Bar
from benchmarks.mutations import FORMATS, cases, counts

N_FILES = 2400


def bars():
    """Bars of all formats together; then what was read silently differently, per format."""
    n = int(os.environ.get("TURNOUT_MUTATED_FILES", N_FILES))
    first = int(os.environ.get("TURNOUT_FIRST_SEED", "0"))
    found = list(cases(n, first))
    table = counts(found)
    total = table["all"]
    size = f"n={n}, seeds from {first}"
    yield Bar("mutated files that end in an error of the program", total["crash"], 0, "files", n=size)
    yield Bar("mutated files that take more than 10 s of CPU time", total["hang"], 0, "files", n=size)
    yield Bar("mutated files with other samples, without a message", total["samples"], 0, "files", n=size)
    silent = 100 * total["metadata"] / n
    yield Bar("silently different outside the damaged bytes", silent, 0.2, "%", n=size)
    share = 100 * total["damaged value"] / n
    yield Bar("another start time or condition in the damaged bytes", share, None, "%", n=size)
    for format in FORMATS:
        of_format = table.get(format, {})
        note = f"{of_format.get('metadata', 0)} of {sum(of_format.values())} files"
        share = 100 * of_format.get("metadata", 0) / max(sum(of_format.values()), 1)
        yield Bar(f"silently different, {format}", share, None, "%", note=note)
    for case in found:
        if case.outcome in ("crash", "hang", "samples", "metadata"):
            yield Bar(f"seed {case.seed}, {case.format}, {case.kind}: {case.outcome}", 1, None, note=case.note[:80])
