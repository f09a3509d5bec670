"""Size, registering, questions on 29 million rows, race, re-run, storage version, rejected rows, empty registry.

CPU seconds, best of three, warm. TURNOUT_BENCH_SHARE (default 1) scales the network for a quick look.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.bar import Bar, stopwatch
from benchmarks.registry_network import make_network
from benchmarks.registry_questions import CUSUM, NETWORK, PASSAGES
from benchmarks.registry_race import race
from benchmarks.registry_results import hammer_batches, passage_batches
from turnout.registry.database import open_registry
from turnout.registry.documentation import views
from turnout.registry.job import register
from turnout.workflow.batches import read_results

SHARE = float(os.environ.get("TURNOUT_BENCH_SHARE", "1"))
QUICK_QUESTIONS = ("one section, all its campaigns", "network ranked by 90-day slope")
OLDER_DUCKDB = "1.5.5"
REGISTER = (
    "from turnout.arrow_memory import use_system_allocator; use_system_allocator();"
    "import sys, glob, time, resource; from turnout.registry.job import register;"
    "from turnout.workflow.batches import read_results; b = sorted(glob.glob(sys.argv[1] + '/*.parquet'));"
    "t = time.process_time(); d = register(b, sys.argv[2], read=read_results); c = time.process_time() - t;"
    "print(c, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, d.n_units, d.n_rejected)"
)


def bars():
    folder = Path(tempfile.mkdtemp(prefix="turnout-bench-"))
    try:
        for group in (registering, rerun, empty_registry, versions, racing, passages, network):
            yield from group(folder / group.__name__)
            shutil.rmtree(folder / group.__name__, ignore_errors=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _register_in_own_process(work, registry):
    """(CPU s, GB, units, rejected rows) of a cold process."""
    out = subprocess.run(
        [sys.executable, "-c", REGISTER, str(work), str(registry)], capture_output=True, text=True, check=True
    ).stdout.split()
    return float(out[0]), float(out[1]), int(out[2]), int(out[3])


def registering(folder):
    """Registering, and the cost of a result with all its impacts and curves."""
    n = int(28000 * SHARE)
    hammer_batches(folder / "work", n)
    fastest = min(_register_in_own_process(folder / "work", folder / f"registry{k}") for k in range(3))
    yield Bar(f"register {n} results", fastest[0], 5, "CPU s", n=f"{fastest[2]} units, {fastest[3]} rejected")
    per_table = {}
    for path in (folder / "registry0").rglob("batch-*.parquet"):
        table = path.relative_to(folder / "registry0").parts[0]
        per_table[table] = per_table.get(table, 0) + 1
    yield Bar("files per table and run", max(per_table.values()), 3, "files")
    n = int(7000 * SHARE)
    hammer_batches(folder / "complete", n, complete=True)
    cpu, memory, units, _ = _register_in_own_process(folder / "complete", folder / "complete_registry")
    yield Bar(
        "register a result with 30 impacts, 60 estimates, curves", 1e3 * cpu / units, None, "CPU ms", n=f"{units}"
    )
    yield Bar("memory of that run", memory, 4, "GB")


def rerun(folder):
    """A second run adds nothing, and two concurrent runs give the union."""
    hammer_batches(folder / "one", 800)
    hammer_batches(folder / "other", 1600)
    batches = sorted((folder / "one").glob("*.parquet"))
    first = register(batches, folder / "registry", read=read_results)
    again = register(batches, folder / "registry", read=read_results)
    yield Bar("rows added by a second run", sum(again.rows.values()), 0, "rows", n=f"{first.n_units} units")
    command = [sys.executable, "-c", REGISTER]
    processes = [
        subprocess.Popen([*command, str(folder / name), str(folder / "both")], stdout=subprocess.DEVNULL)
        for name in ("one", "other")
    ]
    codes = [p.wait() for p in processes]
    register(sorted((folder / "other").glob("*.parquet")), folder / "calm", read=read_results)
    register(batches, folder / "calm", read=read_results)
    query = "select section_id, band, frequency_hz from modes_current order by all"
    answers = [_ask(folder / name, query) for name in ("both", "calm")]
    differ = len(set(answers[0]) ^ set(answers[1]))
    yield Bar(
        "rows that two concurrent runs lack of their union", differ + sum(codes), 0, "rows", n=f"{len(answers[1])}"
    )


def _ask(registry, sql):
    with open_registry(registry) as connection:
        return connection.execute(sql).fetchall()


def empty_registry(folder):
    """An empty registry here; rejected rows by the tests of each case."""
    register([], folder / "registry", read=iter)
    failed = sum(_fails(folder / "registry", call) for call in views())
    yield Bar("views and macros that fail on an empty registry", failed, 0, "", n=f"of {len(views())}")
    tests = Path(__file__).resolve().parents[1] / "tests" / "unit" / "registry" / "test_registry_rejected_rows.py"
    result = subprocess.run([sys.executable, "-m", "pytest", "-q", "-x", str(tests)], capture_output=True, text=True)
    yield Bar("rejected rows that fail", result.returncode, 0, "", n=result.stdout.strip().splitlines()[-1])


ARGUMENTS = {
    "section": "'a/b'", "resonance": "'ballast'", "days": "90", "asof": "timestamp '2026-01-01'", "k": "1.0",
    "h": "5.0",    "kind_of_event": "'tamping'", "turnout": "'a'", "from_utc": "'2026-01-01'", "to_utc": "'2026-02-01'",
    "above": "0.0003", "since": "timestamp '2025-01-01'", "kind_of_class": "'speed'",
}  # fmt: skip


def _sql(call):
    name, _, parameters = call.partition("(")
    wanted = [p.strip() for p in parameters.rstrip(")").split(",") if p.strip() and ":=" not in p]
    return f"select count(*) from {name}" + (f"({', '.join(ARGUMENTS[p] for p in wanted)})" if "(" in call else "")


def _fails(registry, call):
    try:
        _ask(registry, _sql(call))
    except Exception as error:
        print(f"  {call}: {error}")
        return True
    return False


def versions(folder):
    """A registry of this DuckDB, opened and queried by an older version in a separate environment."""
    hammer_batches(folder / "work", 80)
    register(sorted((folder / "work").glob("*.parquet")), folder / "registry", read=read_results)
    python = folder / "venv" / "bin" / "python"
    try:
        subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True, capture_output=True)
        pip = [str(python), "-m", "pip", "install", "--quiet", f"duckdb=={OLDER_DUCKDB}"]
        subprocess.run(pip, check=True, capture_output=True, timeout=300)
    except (subprocess.SubprocessError, OSError):
        yield Bar("not run: no older DuckDB to be had", 0, None)
        return
    code = (
        "import duckdb, sys; off = {'autoinstall_known_extensions': False, 'autoload_known_extensions': False}\n"
        "con = duckdb.connect(sys.argv[1], read_only=True, config=off); bad = 0\n"
        "for sql in sys.argv[2:]:\n"
        "    try: con.execute(sql).fetchall()\n"
        "    except Exception as error: bad += 1; print(sql, error, file=sys.stderr)\n"
        "n = con.execute('select count(*) from modes_current').fetchall()[0][0]\n"
        "print(bad, n, duckdb.__version__)"
    )
    queries = [_sql(call) for call in views()]
    file = folder / "registry" / "registry.duckdb"
    result = subprocess.run([str(python), "-c", code, str(file), *queries], capture_output=True, text=True)
    print(result.stderr, end="")
    failed, rows, version = result.stdout.split() if result.returncode == 0 else (str(len(queries)), "0", OLDER_DUCKDB)
    yield Bar("views and macros that fail in an older DuckDB", int(failed), 0, "", n=f"of {len(queries)}, {version}")
    yield Bar("modes it reads", int(rows), 160, "rows", ">=")


def racing(folder):
    """15 s of writing and compaction. Reading by a glob must fail, reading by the published list must not."""
    listed, globbed = race(folder / "list"), race(folder / "glob", through_glob=True)
    yield Bar("wrong counts and errors, published list", listed.wrong + listed.errors, 0, "", n=f"{listed.reads} reads")
    yield Bar("reads", listed.reads, 300, "", ">=", n=f"{listed.commits} commits")
    yield Bar(
        "wrong counts and errors, glob (must fail)",
        globbed.wrong + globbed.errors,
        1,
        "",
        ">=",
        n=f"{globbed.reads} reads",
    )


def passages(folder):
    """100,000 passages with 12 sensors each."""
    n = int(100_000 * SHARE)
    passage_batches(folder / "work", n)
    cpu, memory, units, _ = _register_in_own_process(folder / "work", folder / "registry")
    yield Bar(f"register {units} passages x 12 sensors", cpu, None, "CPU s", n=f"{memory:.2f} GB")
    size, rows = _size(folder / "registry", "passage_fits")
    yield Bar("bytes per passage fit", size / rows, 10, "B", n=f"{rows} rows")
    with open_registry(folder / "registry") as connection:
        for name, sql in PASSAGES.items():
            yield Bar(name, _fastest(connection, sql), 1.2, "CPU s")


def network(folder):
    """Size and speed of questions on 29 million modes: nine compacted years and 52 weekly batches."""
    folder.mkdir(parents=True)
    started = time.perf_counter()
    make_network(folder, int(3500 * SHARE))
    size, rows = _size(folder, "modes")
    note = f"{rows} rows, made in {time.perf_counter() - started:.0f} s"
    yield Bar("bytes per mode", size / rows, 26, "B", n=note)
    with open_registry(folder) as connection:
        for name, sql in NETWORK.items():
            yield Bar(f"{name}", _fastest(connection, sql), 0.15 if name in QUICK_QUESTIONS else 1.2, "CPU s")
        yield Bar("CUSUM of all charts, 4 years", _fastest(connection, CUSUM), 6, "CPU s")


def _size(registry, table):
    from turnout.registry.generation import load

    files = load(registry).of(table)
    return sum(f.bytes for f in files), sum(f.rows for f in files)


def _fastest(connection, sql, times=3):
    """CPU seconds of the fastest of ``times`` runs, result fetched."""
    seconds = []
    for _ in range(times):
        with stopwatch() as watch:
            connection.sql(sql).to_arrow_table()
        seconds.append(watch.cpu)
    return min(seconds)
