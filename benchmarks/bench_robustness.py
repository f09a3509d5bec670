"""Readers during nightly runs, bits that flip in live files, and the memory of each stage.

``TURNOUT_READS`` is the number of reads (10,000).
"""

import os
import tempfile
from pathlib import Path

from benchmarks.bar import Bar
from benchmarks.bit_flips import flip_bits
from benchmarks.registry_race import race_of_readers
from benchmarks.stage_memory import measure, measure_hammer

N_READ = int(os.environ.get("TURNOUT_READS", "10000"))


def bars():
    """Wrong reads, answers that changed without a word, and memory beside 200 MB and six times the input."""
    with tempfile.TemporaryDirectory() as folder:
        reads, problems, commits = race_of_readers(Path(folder) / "registry", n_read=N_READ)
        for problem in problems[:5]:
            print(f"  {problem}")
        yield Bar("wrong or failed reads of 4 readers", len(problems), 0, "", n=f"{reads} reads, {commits} commits")
    with tempfile.TemporaryDirectory() as folder:
        result = flip_bits(Path(folder), n_file=500)
        yield Bar("live files with a flipped bit", result.n_flipped, 500, "", ">=")
        yield Bar("flipped bits that no message names", result.n_flipped - result.n_named, 0, "")
        yield Bar("rows that differ after the next night", result.n_different, 0, "", n=f"of {result.n_row}")
    for figure in (measure_hammer(), *measure()):
        note = f"input {figure.n_input / 1e6:.1f} MB"
        yield Bar(f"memory of {figure.stage}", figure.peak / 1e6, figure.limit / 1e6, "MB", n=note)
