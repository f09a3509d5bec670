"""A fleet of tiny raw files, and a stage function that only reads them: the real workflow with little computation."""

import hashlib
import json
import multiprocessing
import os
import runpy
import shutil
import signal
import subprocess
import sys
import time
import traceback
from functools import partialmethod
from multiprocessing.connection import Client, Listener
from pathlib import Path

import numpy as np

REPOSITORY = Path(__file__).resolve().parents[2]
RATE, N_SAMPLE, N_RECORD = 5000.0, 32, 2
LAYOUT = """
sections:
{sections}
hammer:
  files: "hammer/{{campaign}}/{{section}}_{{test}}.{{ext}}"
  rate: {rate}
  records: {records}
  samples: {samples}
  force: force
  response: rail
  channels:
    force: {{source: force, quantity: force, unit: N, mounting: hammer}}
    rail: {{source: rail, quantity: acceleration, unit: m/s²}}
"""


def unit(unit, turnout, raw_root, algo=""):
    """Read every file; give one row for the file and one row per record."""
    from turnout.stages.raw_files import read_or_quarantine, recording_row

    base = {
        "turnout_id": unit.turnout,
        "section_id": turnout.section_id(unit.section),
        "campaign_id": f"{unit.turnout}/{unit.campaign}",
    }
    description = turnout.hammer.descriptions[unit.section]
    rows = {"recordings": [], "impacts": [], "quarantine": []}
    time.sleep(float(Path("pause").read_text()) if Path("pause").exists() else 0.0)
    for path, size, _ in unit.files:
        if path.endswith("_bug.npz"):
            raise ZeroDivisionError("toy bug")
        result = read_or_quarantine(path, raw_root, description, base, rows["quarantine"], "hammer")
        if result is None:
            continue
        rows["recordings"].append(recording_row(result, path, size, description, base, "hammer"))
        rows["impacts"] += [_impact(r, result.sha256[:32], base) for r in result.recordings]
    return rows


def nothing(unit, turnout, raw_root, algo=""):
    """Function that gives no row: only the work of the workflow remains."""
    return {}


def _impact(recording, recording_id, base):
    return {
        **base,
        "impact_id": f"{recording_id}:{recording.record}",
        "recording_id": recording_id,
        "test": 1,
        "record": recording.record,
        "status": "accepted",
        "peak_n": float(recording.signal("force").max()),
    }


def raw_bytes(seed, folder, **changes):
    """Bytes of an npz file with two channels; the same seed gives the same bytes."""
    rng = np.random.default_rng(seed)
    arrays = {"channels": np.array(["force", "rail"]), "units": np.array(["N", "m/s²"]), "fs": RATE}
    for k in range(N_RECORD):
        arrays[f"record_{k:03d}"] = np.stack([rng.uniform(1.0, 9.0, N_SAMPLE), rng.normal(0.0, 1.0, N_SAMPLE)])
    arrays.update(changes)
    path = Path(folder) / f".{os.getpid()}.npz"
    np.savez(path, **{k: v for k, v in arrays.items() if v is not None})
    content = path.read_bytes()
    path.unlink()
    return content


def damages(folder):
    """Ten kinds of damage of a file: name -> (bytes, reason in quarantine, whether a valid record remains)."""
    valid = raw_bytes(99, folder)
    ok = np.random.default_rng(5).normal(size=(2, N_SAMPLE))
    nan, dead = ok.copy(), ok.copy()
    nan[1, 3], dead[1] = np.nan, 3.0
    return {
        "empty": (b"", "empty", False),
        "half copied": (valid[: len(valid) // 2], "unreadable", False),
        "not of its format": (np.random.default_rng(3).bytes(600), "unreadable", False),
        "a byte flipped": (_flip(valid), "unreadable", True),
        "wrong rate": (raw_bytes(11, folder, fs=4000.0), "wrong_rate", False),
        "channel missing": (raw_bytes(12, folder, channels=np.array(["force", "wheel"])), "channel_missing", False),
        "not a number": (raw_bytes(13, folder, record_001=nan), "not_finite", True),
        "dead channel": (raw_bytes(14, folder, record_001=dead), "dead_channel", True),
        "samples missing": (raw_bytes(15, folder, record_001=ok[:, :20]), "truncated", True),
        "record missing": (raw_bytes(16, folder, record_001=None), "truncated", True),
    }


def _flip(content):
    """Change one bit in the samples of the last record: the checksum of the archive no longer agrees."""
    at = content.index(b"record_001.npy") + 200
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


def labels(n):
    return [f"A{i}" for i in range(1, n + 1)]


def make(folder, n_turnout=6, n_section=2, n_campaign=1, n_test=1, config=""):
    """Write the configuration and the raw files of a fleet."""
    folder = Path(folder)
    for sub in ("config/layouts", "raw"):
        (folder / sub).mkdir(parents=True, exist_ok=True)
    sections = "\n".join(f"  {s}: {{panel: CP, track: main, position: {i}.5}}" for i, s in enumerate(labels(n_section)))
    text = LAYOUT.format(sections=sections, rate=RATE, records=N_RECORD, samples=N_SAMPLE)
    (folder / "config/layouts/toy.yaml").write_text(text)
    shutil.copy(__file__, folder / "toy_fleet.py")
    (folder / "config/config.yaml").write_text(config)
    header = "turnout\tlayout\tline\n"
    ids = [f"T{i:05d}" for i in range(n_turnout)]
    (folder / "config/turnouts.tsv").write_text(
        header + "".join(f"{t}\ttoy\tline {i % 2}\n" for i, t in enumerate(ids))
    )
    for turnout in ids:
        add_raw(folder, turnout, n_section, n_campaign, n_test)
    return folder


def add_raw(folder, turnout, n_section=2, n_campaign=1, n_test=1, first=0):
    """Write the raw files and campaigns.csv of one turnout."""
    base = Path(folder) / "raw" / turnout
    base.mkdir(parents=True, exist_ok=True)
    days = [f"2024-{1 + k % 12:02d}-{1 + k // 12:02d}" for k in range(first + n_campaign)]
    (base / "campaigns.csv").write_text(campaigns_csv(days))
    for day in days[first:]:
        (base / "hammer" / day).mkdir(parents=True, exist_ok=True)
        for section in labels(n_section):
            for test in range(1, n_test + 1):
                name = f"{day}/{section}_{test}.npz"
                seed = int(hashlib.sha256(f"{turnout}/{name}".encode()).hexdigest()[:12], 16)
                (base / "hammer" / name).write_bytes(raw_bytes(seed, base))


def campaigns_csv(days):
    header = "campaign,started_at_utc,rail_temperature_c,hammer_id,tip,operator"
    return (
        "\n".join([header, *(f"{day},{day}T09:00:00,{10 + k}.5,h1,plastic,crew" for k, day in enumerate(days))]) + "\n"
    )


def environment():
    """Environment of a run: the programs of this interpreter are first in the path."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    more = {"PATH": path, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return os.environ | more


def command(*options, cores=2, shards=1, function="toy_fleet:unit", target="work/verdict.json"):
    """Command line of a run with the toy function, up to the verdict."""
    base = [sys.executable, "-m", "snakemake", "--snakefile", str(REPOSITORY / "Snakefile")]
    base += [target] if target else []
    base += ["--cores", str(cores)] if cores else []
    setting = [f"shards={shards}"] + ([f"functions={{hammer: '{function}'}}"] if function else [])
    extra = [o for o in options if "=" in o and not o.startswith("-")]
    return [*base, *[o for o in options if o not in extra], "--config", *setting, *extra]


def run(folder, *options, check=True, **more):
    """Run the workflow in ``folder``; return the completed process with its output in ``stdout``.

    Snakemake and the scripts of its jobs run in forks of processes that have imported all they need, as imports take
    longer than a whole run of a toy fleet. The nightly runs in these tests and the tutorial start new interpreters.
    """
    words, output = command(*options, **more), Path(folder) / ".output"
    process = FORKS.Process(target=snakemake, args=(words[3:], str(folder), str(output), environment()))
    process.start()
    process.join()
    done = subprocess.CompletedProcess(words, process.exitcode, output.read_text())
    output.unlink()
    if check and done.returncode:
        raise AssertionError(f"exit code {done.returncode}\n{done.stdout}")
    return done


FORKS = multiprocessing.get_context("forkserver")
FORKS.set_forkserver_preload(
    [
        "snakemake.cli", "pandas", "turnout.workflow.launch", "turnout.readers.formats", "turnout.workflow.jobs",
        "turnout.registry.job", "turnout.stages.common", "turnout.stages.trend", "turnout.stages.worklist",
        "turnout.report.job", "turnout.stages.change_units",
    ]
)  # fmt: skip


def snakemake(words, folder, output, variables):
    """Do the same as ``python -m snakemake``, in ``folder`` and with the output in a file."""
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(variables)
    with open(output, "wb") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    from snakemake.cli import main
    from snakemake.script import PythonScript

    with Listener(family="AF_UNIX") as listener:
        # Snakemake has threads, so its process must not be forked; this process has no threads.
        server = os.fork()
        if server == 0:
            serve_scripts(listener)
        PythonScript.execute_script = partialmethod(execute_script, listener.address)
        try:
            main(words)
        finally:
            os.kill(server, signal.SIGKILL)
            os.waitpid(server, 0)


def execute_script(job, address, path, edit=False):
    """Replace the method of Snakemake: the server runs the script; raise the error of a new interpreter."""
    from snakemake.benchmark import benchmarked

    with Client(address) as connection:
        connection.send(path)
        with benchmarked(connection.recv(), job.bench_record):
            code = connection.recv()
    if code:
        raise subprocess.CalledProcessError(code, path)


def serve_scripts(listener):
    """Run each script that a client requests in a fork; send its process number, and at its end its exit code."""
    signal.signal(signal.SIGCHLD, lambda *_: os.waitpid(-1, os.WNOHANG))
    while True:
        connection = listener.accept()
        if os.fork() == 0:
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            path, process = connection.recv(), os.fork()
            if process == 0:
                os._exit(run_script(path))
            connection.send(process)
            connection.send(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]))
            os._exit(0)
        connection.close()


def run_script(path):
    """Exit code of the script. A traceback is not kept, as its frames would keep a pool of processes open."""
    try:
        runpy.run_path(path, run_name="__main__")
    except SystemExit as end:
        return end.code or 0
    except BaseException:
        traceback.print_exc()
        return 1
    finally:
        sys.stdout.flush()
    return 0


def kill(process):
    """Kill a run and all its jobs without warning."""
    for pid in [*_descendants(process.pid), process.pid]:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
    process.wait()


def _descendants(pid):
    """All processes below ``pid``."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except FileNotFoundError:
        return []
    return [p for child in map(int, children) for p in [*_descendants(child), child]]


def rows(folder):
    """Rows of every table of the registry except ``runs``, sorted, without the columns that identify the run."""
    import duckdb

    found = {}
    with duckdb.connect(str(Path(folder) / "results/registry/registry.duckdb"), read_only=True) as con:
        generation = json.loads((Path(folder) / "results/registry/_generation.json").read_text())
        for table in sorted({f["table"] for f in generation["files"]} - {"runs"}):
            columns = [c[0] for c in con.sql(f"describe {table}").fetchall() if c[0] not in ("run_id", "generation")]
            found[table] = sorted(con.sql(f"select {', '.join(columns)} from {table}").fetchall(), key=repr)
    return found


def data_files(folder):
    """(table, sha256) of every data file of the registry except those of ``runs``."""
    generation = json.loads((Path(folder) / "results/registry/_generation.json").read_text())
    return sorted((f["table"], f["sha256"]) for f in generation["files"] if f["table"] != "runs")


def remove_outputs(folder):
    """Remove everything that a run wrote."""
    for name in ("work", "results", "logs", ".snakemake"):
        shutil.rmtree(Path(folder) / name, ignore_errors=True)
