"""Cost of the workflow itself on a network, and its behaviour after damage and kills.

The raw files are tiny and only read, so that the orchestration is measured. TURNOUT_BENCH_SHARE (default 1) scales the
number of turnouts of the cost for a quick look.
"""

import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.bar import Bar, stopwatch
from benchmarks.workflow_hammer import hammer_same_rows

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "workflow"))
import toy_fleet as toy

SHARE = float(os.environ.get("TURNOUT_BENCH_SHARE", "1"))
N_TURNOUT, N_SECTION, N_TEST, SHARDS = int(3500 * SHARE), 8, 5, 64
N_KILL, N_DAMAGE_TURNOUT = 20, 125


def bars():
    """All bars; each figure is that of a new, cold process."""
    folder = Path(tempfile.mkdtemp(prefix="turnout-bench-"))
    try:
        yield from network(folder / "network")
        yield from damage_and_kills(folder)
        yield from same_rows(folder)
        yield from hammer_same_rows(folder / "hammer", toy)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def network(folder):
    """Cost on a network of 3,500 turnouts x 8 sections, five files each."""
    make_network(folder)
    n_file = sum(len(files) for _, _, files in os.walk(folder / "raw")) - N_TURNOUT
    output, watch, _ = run_workflow(folder)
    n = f"{N_TURNOUT} turnouts, {n_file} files, {SHARDS} shards"
    processed = count(output, "processed")
    yield Bar("first run of all: units processed", processed, N_TURNOUT * N_SECTION, "units", ">=", n)
    note = "starts, imports, scan, hashing all files, register; the stage itself only reads"
    yield Bar(
        "first run of all: orchestration", watch.cpu, 420.0, "CPU s", "<=", f"{count_jobs(output)} hammer jobs", note
    )
    output, watch, peak = run_workflow(folder)
    assert "Nothing to be done" in output, output
    note = f"{watch.cpu:.2f} CPU s; load of the machine {os.getloadavg()[0]:.1f}"
    yield Bar("nothing new: wall", watch.wall, 5.0, "s", "<=", n, note)
    yield Bar("nothing new: memory of the process", peak, 300.0, "MB", "<=", n)
    yield Bar("nothing new: CPU", watch.cpu, None, "CPU s", "", n)

    turnout = "T00042" if N_TURNOUT > 42 else "T00001"
    day = folder / "raw" / turnout / "hammer" / "2024-01-01"
    (day / "A3_9.npz").write_bytes(toy.raw_bytes(1, folder))
    output, watch, _ = run_workflow(folder)
    yield Bar("one new file: units processed", count(output, "processed"), 1, "units", "<=")
    yield Bar("one new file: hammer jobs", count_jobs(output), 1, "jobs", "<=")
    yield Bar("one new file: wall", watch.wall, 15.0, "s", "<=", "", f"{watch.cpu:.2f} CPU s")

    toy.add_raw(folder, "T99999", N_SECTION)
    with open(folder / "config/turnouts.tsv", "a") as table:
        table.write("T99999\ttoy\tline 1\n")
    output, watch, _ = run_workflow(folder)
    yield Bar("one new turnout row: units processed", count(output, "processed"), N_SECTION, "units", "<=")
    yield Bar("one new turnout row: wall", watch.wall, 15.0, "s", "<=", "", f"{watch.cpu:.2f} CPU s")

    changed = [f"T{i:05d}" for i in range(0, N_TURNOUT, max(1, N_TURNOUT // 200))][:200]
    for name in changed:
        toy.add_raw(folder, name, N_SECTION, n_campaign=1, first=1)
    output, watch, _ = run_workflow(folder)
    off = abs(count(output, "processed") - N_SECTION * len(changed))
    yield Bar(f"{len(changed)} turnouts with a new campaign: units off", off, 0, "units", "<=")
    yield Bar("orchestration of these", watch.cpu, 420.0, "CPU s", "<=", f"{count_jobs(output)} hammer jobs")


def make_network(folder):
    """Write many turnouts quickly: all files share the same bytes, followed by their name."""
    toy.make(folder, n_turnout=1, n_section=N_SECTION)
    shutil.rmtree(folder / "raw")
    ids = [f"T{i:05d}" for i in range(N_TURNOUT)]
    lines = ["turnout\tlayout\tline", *(f"{t}\ttoy\tline {i % 20}" for i, t in enumerate(ids))]
    (folder / "config/turnouts.tsv").write_text("\n".join(lines) + "\n")
    (folder / "raw").mkdir()
    content = toy.raw_bytes(7, folder)
    notes = toy.campaigns_csv(["2024-01-01"])
    for turnout in ids:
        day = folder / "raw" / turnout / "hammer" / "2024-01-01"
        day.mkdir(parents=True)
        (folder / "raw" / turnout / "campaigns.csv").write_text(notes)
        for section in toy.labels(N_SECTION):
            for test in range(1, N_TEST + 1):
                (day / f"{section}_{test}.npz").write_bytes(content + f"{turnout}{section}{test}".encode())


def run_workflow(folder):
    """Run the workflow: (its output, CPU and wall seconds, peak memory of its largest process [MB])."""
    with stopwatch() as watch, open(folder / "said", "w") as out:
        run = subprocess.Popen(
            toy.command(shards=SHARDS, function="toy_fleet:nothing"), cwd=folder, env=toy.environment(), stdout=out,
            stderr=subprocess.STDOUT,
        )  # fmt: skip
        _, status, usage = os.wait4(run.pid, 0)
        run.returncode = os.waitstatus_to_exitcode(status)
    output = (folder / "said").read_text()
    assert run.returncode == 0, output[-3000:]
    return output, watch, usage.ru_maxrss / 1024


def count(output, word):
    """Sum over the shards of one number in their summary lines."""
    return sum(int(n) for n in re.findall(rf"^hammer \d+of\d+:.*?(\d+) {word}", output, re.M))


def count_jobs(output):
    return len(re.findall(r"^(?:local)?rule hammer:", output, re.M))


def damage_and_kills(folder):
    """One per cent of the files damaged in ten ways, and twenty kills. The registry must be unaffected."""
    fleet = toy.make(folder / "fleet", n_turnout=N_DAMAGE_TURNOUT, n_section=8)
    files = sorted((fleet / "raw").glob("*/hammer/*/*.npz"))
    damage_types = toy.damages(fleet)
    broken = dict(zip(files[17 :: len(files) // len(damage_types)], damage_types))
    expected = {(str(f.relative_to(fleet / "raw")), damage_types[k][1]) for f, k in broken.items()}
    for path, damage_type in broken.items():
        path.write_bytes(damage_types[damage_type][0])
    toy.run(fleet, shards=4)
    undisturbed = toy.data_files(fleet)
    in_quarantine = quarantine_rows(fleet)
    n = f"{len(files)} files, {len(broken)} damaged in {len(damage_types)} ways"
    yield Bar("damaged files without their reason in quarantine", len(expected - in_quarantine), 0, "files", "<=", n)
    yield Bar("undamaged files in quarantine", len(in_quarantine - expected), 0, "files", "<=", n)
    lost = len(files) - len(toy.rows(fleet)["recordings"]) - sum(not damage_types[k][2] for k in broken.values())
    yield Bar("undamaged recordings that are not in the registry", abs(lost), 0, "files", "<=", n)

    toy.remove_outputs(fleet)
    (fleet / "config/config.yaml").write_text("fleet: {checkpoint_units: 10}\n")
    moments, n_dead = random.Random(20171001), 0
    for _ in range(N_KILL):
        n_dead += kill_run(fleet, moments.uniform(0.5, 6.0))
    toy.run(fleet, "--rerun-incomplete", shards=4)
    differs = int(toy.data_files(fleet) != undisturbed)
    note = f"{n_dead} of {N_KILL} kills met a run that was not finished"
    yield Bar("registry differs after 20 kills -9 and a last run", differs, 0, "", "<=", n, note)


def quarantine_rows(folder):
    import duckdb

    with duckdb.connect(str(folder / "results/registry/registry.duckdb"), read_only=True) as con:
        return set(con.sql("select distinct path, reason_code from quarantine").fetchall())


def kill_run(folder, seconds):
    """Start the unattended run and kill it with all its jobs; True if it had not ended before."""
    profile = str(toy.REPOSITORY / "profiles/default")
    command = [
        sys.executable,
        "-m",
        "turnout.cli.main",
        "nightly",
        "--profile",
        profile,
        "--",
        *toy.command(shards=4)[3:],
    ]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    run = subprocess.Popen(command, cwd=folder, env=toy.environment(), start_new_session=True, **quiet)
    time.sleep(seconds)
    alive = run.poll() is None
    toy.kill(run)
    return alive


def same_rows(folder):
    """Shards and cores change no byte of the registry's data files."""
    fleet = folder / "fleet"
    (fleet / "config/config.yaml").write_text("")
    registries = {}
    for shards, cores in ((1, 1), (1, 2), (7, 2), (64, 2)):
        toy.remove_outputs(fleet)
        toy.run(fleet, shards=shards, cores=cores)
        registries[shards, cores] = tuple(toy.data_files(fleet))
    n = "shards x cores " + ", ".join(f"{s}x{c}" for s, c in registries)
    yield Bar("different registries", len(set(registries.values())), 1, "", "<=", n)
