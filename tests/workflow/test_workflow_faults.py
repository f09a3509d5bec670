"""Faults of the machine in single units and jobs delay no other unit. The tests use one fleet in their order."""

import re
import shutil
import subprocess
import sys

import pytest
import toy_fleet as toy

from turnout.workflow.plan import shard_of

pytestmark = pytest.mark.slow
SHARDS = 3
FUNCTION = '''"""The toy function, on a machine that has a bad sector or ends a process while a file says so."""
import errno, os
from pathlib import Path
import toy_fleet
def unit(unit, turnout, raw_root, algo=""):
    if Path("bad_sector").exists() and unit.turnout == "T00001":
        raise OSError(errno.EIO, "Input/output error")
    if Path("killer").exists() and unit.turnout == "T00003":
        os._exit(9)
    return toy_fleet.unit(unit, turnout, raw_root, algo)
'''


# The tests of this file use one fleet in their order, as a worker runs all tests of a file.


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = toy.make(tmp_path_factory.mktemp("faulty"), n_turnout=6, n_section=1)
    assert len({shard_of(f"T{i:05d}", SHARDS) for i in range(6)}) > 1
    (folder / "faulty.py").write_text(FUNCTION)
    return folder


def run(fleet):
    return toy.run(fleet, function="faulty:unit", shards=SHARDS, check=False)


def measured(fleet):
    return {t for row in toy.rows(fleet)["recordings"] for t in row if re.fullmatch(r"T\d{5}", str(t))}


def test_an_unreadable_unit_is_in_quarantine_in_the_second_run_and_is_tried_again_in_every_run(fleet):
    (fleet / "bad_sector").touch()
    done = run(fleet)
    assert done.returncode != 0 and "1 units wait for the next run, first T00001/hammer/A1" in done.stdout
    assert "1 postponed" in done.stdout
    done = run(fleet)
    assert done.returncode == 0 and "1 tried again in every run" in done.stdout, done.stdout
    assert measured(fleet) == {f"T{i:05d}" for i in (0, 2, 3, 4, 5)}
    ((fault,),) = [[v for v in row if "Input/output" in str(v)] for row in toy.rows(fleet)["quarantine"]]
    assert fault == "OSError: [Errno 5] Input/output error"
    (fleet / "bad_sector").unlink()
    done = run(fleet)
    assert done.returncode == 0, done.stdout
    assert len(measured(fleet)) == 6
    assert "Nothing to be done" in run(fleet).stdout


def test_a_failed_registration_is_repeated_without_new_files(fleet):
    toy.add_raw(fleet, "T00002", n_section=1, n_campaign=1, first=1)
    recordings = fleet / "results/registry/recordings"
    recordings.rename(fleet / "away")
    recordings.write_text("in the way of its folder")
    assert run(fleet).returncode != 0
    recordings.unlink()
    (fleet / "away").rename(recordings)
    assert run(fleet).returncode == 0
    assert sum("2024-02-01" in repr(row) for row in toy.rows(fleet)["recordings"]) == 1
    assert "Nothing to be done" in run(fleet).stdout


def test_a_damaged_registry_is_repaired_each_time_and_the_next_run_has_nothing_to_do(fleet):
    assert run(fleet).returncode == 0
    before = toy.rows(fleet)
    for file in ("recordings/**/*.parquet", "registry.duckdb", "registry.duckdb"):
        next((fleet / "results/registry").glob(file)).unlink()
        assert run(fleet).returncode == 0 and toy.rows(fleet) == before
        assert "Nothing to be done" in run(fleet).stdout


def test_a_file_at_two_turnouts_is_reported_by_the_run_and_in_the_registry(fleet):
    name, copy = "T00004/hammer/2024-01-01/A1_1.npz", "T00005/hammer/2024-01-01/A1_2.npz"
    shutil.copy(fleet / "raw" / name, fleet / "raw" / copy)
    done = run(fleet)
    assert done.returncode == 0 and f"WARNING {copy}: same bytes as {name}; it counts at both" in done.stdout
    assert sum("other_turnout" in row for row in toy.rows(fleet)["quarantine"]) == 2


def test_a_job_that_dies_delays_only_the_units_that_it_has_not_computed(fleet):
    for turnout in ("T00000", "T00001", "T00003"):
        toy.add_raw(fleet, turnout, n_section=1, n_campaign=1, first=1)
    assert shard_of("T00000", SHARDS) != shard_of("T00001", SHARDS) == shard_of("T00003", SHARDS)
    (fleet / "config/config.yaml").write_text("fleet: {checkpoint_units: 1}\n")
    (fleet / "killer").touch()
    options = toy.command(function="faulty:unit", shards=SHARDS)[3:]
    profile = str(toy.REPOSITORY / "profiles/default")
    night = [sys.executable, "-m", "turnout.cli.main", "nightly", "--profile", profile, "--", *options]
    done = subprocess.run(night, cwd=fleet, env=toy.environment(), text=True, capture_output=True, check=False)
    assert done.returncode != 0 and "not published" not in done.stdout
    assert sum("2024-02-01" in repr(row) for row in toy.rows(fleet)["recordings"]) == 3
    (fleet / "killer").unlink()
    done = run(fleet)  # no plan has changed since the last run
    assert done.returncode == 0 and re.search(r"hammer 02of03: 4 known, 1 processed", done.stdout), done.stdout
    assert sum("2024-02-01" in repr(row) for row in toy.rows(fleet)["recordings"]) == 4
