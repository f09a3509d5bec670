"""A writer that appends and compacts, and a concurrent reader: by the published list it must never count wrongly."""

import random
import subprocess
import sys
import time
from ast import literal_eval
from dataclasses import dataclass
from pathlib import Path

import duckdb

from turnout.registry.compaction import compact
from turnout.registry.connection import connect
from turnout.registry.database import open_registry
from turnout.registry.generation import load, schema_of
from turnout.registry.generation_history import history
from turnout.registry.lock import registry_lock
from turnout.registry.parquet import write_sorted
from turnout.registry.publication import publish
from turnout.registry.schema import tables

ROWS = 20_000
VALUES = {
    "model_id": "md5('{k}-' || i)", "band": "'ballast'", "turnout_id": "'t'", "section_id": "'t/' || (i % 8)",
    "measured_at_utc": "timestamp '2026-01-05' + to_seconds(i)", "method": "'joint'", "frequency_hz": "150.0",
    "damping_ratio": "0.1", "rail_temperature_c": "12.0", "n_impacts": "30", "source": "'hammer'", "run_id": "'run{k}'",
}  # fmt: skip


def batch_sql(k: int, rows: int) -> str:
    """SELECT of one batch; columns without a value are NULL."""
    columns = [f'({VALUES.get(c.name, "null").format(k=k)})::{c.type} as "{c.name}"' for c in tables()["modes"]]
    return f"select {', '.join(columns)} from range({rows}) r(i)"


@dataclass
class Outcome:
    """Reads, wrong counts and errors of the reader while the writer made ``commits`` commits."""

    reads: int = 0
    wrong: int = 0
    errors: int = 0
    commits: int = 0


def append(root: Path, k: int, rows: int = ROWS) -> None:
    """Append one batch, by the steps of a registration."""
    with registry_lock(root):
        now, con = load(root), connect()
        now.number += 1
        file = write_sorted(con, root, "modes", 2026, batch_sql(k, rows), f"batch-{k}")
        now.files.append(file)
        now.schemas[file.schema] = schema_of("modes")
        publish(root, now)


def write(root: Path, stop: Path, rows: int = ROWS) -> int:
    """Append until ``stop`` exists and compact after every fifth batch; returns the number of commits."""
    k, commits = 1, 0
    while not stop.exists():
        append(root, k, rows)
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


COUNTED = "select count(*), count(distinct run_id) from modes"
FEW_ROWS = 100  # of each batch, where the number of reads matters


def read(root: Path, n: int, seed: int) -> list[str]:
    """Read ``n`` times, with connections that are kept while generations pass, some of them of earlier ones."""
    draw, problems, done = random.Random(seed), [], 0
    while done < n:
        try:
            earlier = draw.choice(list(history(root))[-4:]) if draw.random() < 0.2 else None
            with open_registry(root, as_of=earlier) as connection:
                seen = None
                for _ in range(min(n - done, draw.choice((1, 40, 160)))):
                    done += 1
                    ((rows, batches),) = connection.execute(COUNTED).fetchall()
                    if rows != FEW_ROWS * batches or (seen or rows) != rows:
                        problems.append(f"{rows} rows of {batches} batches, {seen} before")
                    seen = rows
        except Exception as error:
            problems.append(f"{type(error).__name__}: {error}")
            done += 1
    return problems


def race_of_readers(root: Path, n_reader: int = 4, n_read: int = 10_000) -> tuple[int, list[str], int]:
    """(reads, what was wrong, commits) of several readers during the nights of a writer, which also compacts."""
    root.mkdir(parents=True)
    append(root, 0, FEW_ROWS)
    stop, folder = root.with_suffix(".stop"), Path(__file__).resolve().parents[1]
    start = "from pathlib import Path; from benchmarks.registry_race import read, write; "
    calls = [f"print(write(Path({str(root)!r}), Path({str(stop)!r}), {FEW_ROWS}))"]
    calls += [f"print(read(Path({str(root)!r}), {n_read // n_reader}, {k}))" for k in range(n_reader)]
    writer, *readers = [
        subprocess.Popen([sys.executable, "-c", start + call], stdout=subprocess.PIPE, text=True, cwd=folder)
        for call in calls
    ]
    problems = [problem for reader in readers for problem in literal_eval(reader.communicate()[0] or "['no answer']")]
    stop.touch()
    return n_read // n_reader * n_reader, problems, int(writer.communicate()[0])
