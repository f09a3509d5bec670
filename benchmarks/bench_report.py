"""CPU time and size of the pages of a network: 3,500 turnouts of eight sections, twelve campaigns each.

TURNOUT_BENCH_SHARE (default 1) scales the network for a quick look.
"""

import os
import shutil
import tempfile
from pathlib import Path

import duckdb

from benchmarks import bench_pipeline
from benchmarks.bar import Bar, stopwatch
from turnout.config import load_configuration, with_raw
from turnout.registry.database import open_registry
from turnout.registry.job import register
from turnout.report.site import write_pages
from turnout.workflow.batches import read_results, write_batch
from turnout.workflow.configuration_rows import configuration_rows
from turnout.workflow.scan import scan

SHARE = float(os.environ.get("TURNOUT_BENCH_SHARE", "1"))
N_TURNOUT, N_CAMPAIGN = max(1, int(3_500 * SHARE)), 12
N_WRITTEN = min(N_TURNOUT, max(50, int(200 * SHARE)))  # pages that are written, of which the time of all is computed
SINGLE_TABLES = ("receptances_current", "results_current")
TURNOUT_TABLES = ("turnouts", "sections", "events", "quarantine_open")
CAMPAIGN_TABLES = ("modes_current", "models_current", "impacts_current", *SINGLE_TABLES)
EMPTY_TABLES = ("passages_current", "passage_scores", "findings_newest", "fit_adjusted", "fit_effects")


def bars():
    """CPU time of all pages, from ``N_WRITTEN`` of them and the fleet's page of all."""
    folder = Path(tempfile.mkdtemp())
    try:
        connection = _network(folder)
        write_pages(connection, folder / "warm", turnouts=["t00000"], progress=False)  # imports, compiled templates
        with stopwatch() as nothing:
            write_pages(connection, folder / "pages", turnouts=[], progress=False)
        some = [f"t{k:05d}" for k in range(0, N_TURNOUT, N_TURNOUT // N_WRITTEN)][:N_WRITTEN]
        with stopwatch() as watch:
            write_pages(connection, folder / "pages", turnouts=some, progress=False)
        per_page = (watch.cpu - nothing.cpu) / len(some)
        event = "insert into events (turnout_id, event_id, event_at_utc, kind, resets_ballast, resets_railpad)"
        connection.execute(f"{event} values ('{some[0]}', 'new', '2024-05-20', 'tamping', true, false)")
        with stopwatch() as again:
            n_changed = write_pages(connection, folder / "pages", turnouts=some, progress=False) - 1
        index = (folder / "pages" / "index.html").stat().st_size / 1e6
        page = sum(p.stat().st_size for p in (folder / "pages" / "turnouts").iterdir()) / len(some) / 1e3
        yield Bar(
            f"pages of {N_TURNOUT} turnouts x 8 sections",
            nothing.cpu + N_TURNOUT * per_page,
            100.0,
            "CPU s",
            n=f"n={len(some)} pages",
        )
        yield Bar("fleet page alone", nothing.cpu, None, "CPU s", "")
        yield Bar("turnouts' pages written after one new event", n_changed, 1, "pages", n=f"of {len(some)} asked for")
        yield Bar("the same with the fleet's page", again.cpu, None, "CPU s", "")
        yield Bar("fleet page", index, 5.0, "MB")
        yield Bar("a turnout's page", page, None, "kB", "")
    finally:
        shutil.rmtree(folder)


def _network(folder):
    """In-memory database with the views of the registry as tables, in which one turnout is repeated."""
    bench_pipeline._write_raw_files(folder / "raw", "hdf5")
    configuration = load_configuration("config")
    turnout = with_raw(configuration.turnout("tommerup_s1"), folder / "raw")
    results = [bench_pipeline._hammer_result(u, turnout, folder / "raw") for u in scan(turnout, folder / "raw").units]
    batch = write_batch(folder / "work", results)
    tables = configuration_rows(configuration, folder / "raw", [])
    register([batch], folder / "registry", read=read_results, tables=tables)
    open_registry(folder / "registry").close()
    connection = duckdb.connect()
    connection.execute(f"attach '{folder}/registry/registry.duckdb' as r (read_only)")
    # a macro takes its names from the search path of the caller: the tables made here come first
    connection.execute("set search_path = 'memory.main,r.main'")
    for name in EMPTY_TABLES:
        connection.execute(f"create table {name} as select * from r.{name} limit 0")
    for name in (*TURNOUT_TABLES, *CAMPAIGN_TABLES):
        times = N_CAMPAIGN if name in CAMPAIGN_TABLES and name not in SINGLE_TABLES else 1
        connection.execute(_repeat(connection, name, times))
    return connection


def _repeat(connection, name, times):
    """SQL that makes table ``name``: the rows of one turnout under the id of every turnout, for ``times`` campaigns."""
    columns = [d[0] for d in connection.execute(f"select * from r.{name} limit 0").description]
    replacements = {
        "turnout_id": "printf('t%05d', k)",
        "section_id": "replace(section_id, turnout_id, printf('t%05d', k))",
        "model_id": "printf('%s-%d-%d', model_id, k, j)",
        "campaign_id": "printf('t%05d/%03d', k, 100 - j)",
        "measured_at_utc": "measured_at_utc - to_days(cast(30 * j as integer))",
    }
    chosen = ", ".join(f"{replacements[c]} as {c}" if c in replacements else c for c in columns)
    return (
        f"create table {name} as select {chosen} from r.{name}, range({N_TURNOUT}) a(k), range({times}) b(j) "
        "where turnout_id = 'tommerup_s1'"
    )
