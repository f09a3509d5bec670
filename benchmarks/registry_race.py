"""A writer that appends and compacts, and a concurrent reader: by the published list it must never count wrongly."""

import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import duckdb

from turnout.registry.compaction import compact
from turnout.registry.database import build_database, open_registry
from turnout.registry.generation import commit, delete_files, due_for_deletion, load, schema_of
from turnout.registry.lock import registry_lock
from turnout.registry.parquet import write_sorted
from turnout.registry.staging import connect

ROWS = 20_000
BATCH = """
select md5('{k}-' || i) as model_id, 'ballast' as band, 't' as turnout_id, 't/' || (i % 8) as section_id,
    timestamp '2026-01-05' + to_seconds(i) as measured_at_utc, 'joint' as method, 150.0 as frequency_hz,
    null::double as frequency_se_hz, null::double as frequency_sd_hz, 0.1 as damping_ratio, null::double as damping_se,
    12.0 as rail_temperature_c, 30 as n_impacts, 'hammer' as source, 'run{k}' as run_id from range({rows}) r(i)
"""


@dataclass
class Outcome:
    """Reads, wrong counts and errors of the reader while the writer made ``commits`` commits."""

    reads: int = 0
    wrong: int = 0
    errors: int = 0
    commits: int = 0


def append(root: Path, k: int) -> None:
    """Append one batch of ``ROWS`` rows, by the steps of a registration."""
    with registry_lock(root):
        now, con = load(root), connect()
        now.number += 1
        file = write_sorted(con, root, "modes", 2026, BATCH.format(k=k, rows=ROWS), f"batch-{k}")
        now.files.append(file)
        now.schemas[file.schema] = schema_of("modes")
        due = due_for_deletion(now)
        commit(root, now)
        build_database(root, now)
        delete_files(root, due)


def write(root: Path, stop: Path) -> int:
    """Append until ``stop`` exists and compact after every fifth batch; returns the number of commits."""
    k, commits = 1, 0
    while not stop.exists():
        append(root, k)
        commits += 1
        if k % 5 == 0:
            compact(root)
            commits += 1
        k += 1
    return commits


def race(root: Path, seconds: float = 15.0, reads: int = 300, through_glob: bool = False) -> Outcome:
    """Count rows while another process writes, for ``seconds`` and until ``reads`` are reached, 90 s at most."""
    root.mkdir(parents=True)
    append(root, 0)
    stop = root.with_suffix(".stop")
    call = f"print(write(Path({str(root)!r}), Path({str(stop)!r})))"
    code = f"from pathlib import Path; from benchmarks.registry_race import write; {call}"
    folder = Path(__file__).resolve().parents[1]
    writer = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=folder)
    outcome, start = Outcome(), time.monotonic()
    while (spent := time.monotonic() - start) < seconds or (outcome.reads < reads and spent < 90):
        outcome.reads += 1
        try:
            rows, batches = _count(root, through_glob)
            outcome.wrong += rows != ROWS * batches
        except Exception:
            outcome.errors += 1
    stop.touch()
    outcome.commits = int(writer.communicate()[0])
    return outcome


def _count(root, through_glob):
    counted = "select count(*), count(distinct run_id) from "
    if through_glob:
        with duckdb.connect() as connection:
            return connection.execute(f"{counted} read_parquet('{root}/modes/year=2026/*.parquet')").fetchall()[0]
    with open_registry(root) as connection:
        return connection.execute(f"{counted} modes").fetchall()[0]
