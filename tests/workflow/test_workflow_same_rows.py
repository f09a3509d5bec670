"""The registry does not depend on the numbers of shards and cores, on checkpoints or on kills."""

import random
import subprocess
import sys
import time

import pytest
import toy_fleet as toy

from turnout.config import load_configuration
from turnout.registry.database import open_registry
from turnout.registry.job import register
from turnout.workflow.batches import read_results
from turnout.workflow.configuration_rows import configuration_rows, fleet_hash
from turnout.workflow.plan import write_plans
from turnout.workflow.shard import run_shard
from turnout.workflow.state import batch_paths
from turnout.workflow.tasks import Stage

pytestmark = pytest.mark.slow
ALGO = "toy_fleet:unit"


# The tests of this file use one fleet in their order, as a worker runs all tests of a file.


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    folder = toy.make(tmp_path_factory.mktemp("same"), n_turnout=12, n_section=3)
    for path, (content, *_) in zip(
        sorted((folder / "raw").glob("*/hammer/*/*.npz"))[2::4], toy.damages(folder).values()
    ):
        path.write_bytes(content)
    return folder


@pytest.fixture(scope="module")
def undisturbed(fleet):
    toy.remove_outputs(fleet)
    toy.run(fleet, shards=1, cores=1, check=False)
    return toy.data_files(fleet)


def run_without_snakemake(folder, shards, threads):
    """The steps of the workflow, called one after another."""
    from turnout import __version__

    configuration, raw = load_configuration(folder / "config"), folder / "raw"
    names = write_plans(configuration, raw, folder / "work/plan", shards)
    plans = [folder / f"work/plan/{name}.json" for name in names]
    states = [folder / f"work/hammer/{name}.json" for name in names]
    for plan, state in zip(plans, states):
        run_shard(plan, state, Stage("hammer", toy.unit, ALGO), configuration, raw, threads=threads)
    register(
        batch_paths(states), folder / "results/registry", read=read_results, code_version=__version__,
        tables=configuration_rows(configuration, raw, plans), config_hash=fleet_hash(configuration),
    )  # fmt: skip


def test_a_run_writes_data(undisturbed):
    assert {"recordings", "impacts", "quarantine", "turnouts", "campaigns"} <= {table for table, _ in undisturbed}


@pytest.mark.parametrize("shards, threads", [(7, 2), (64, 1)])
def test_the_numbers_of_shards_and_cores_change_no_byte(fleet, undisturbed, shards, threads):
    toy.remove_outputs(fleet)
    run_without_snakemake(fleet, shards, threads)
    assert toy.data_files(fleet) == undisturbed


def test_snakemake_with_two_cores_and_seven_shards_changes_no_byte(fleet, undisturbed):
    toy.remove_outputs(fleet)
    toy.run(fleet, shards=7, cores=2, check=False)
    assert toy.data_files(fleet) == undisturbed


def test_a_campaign_that_is_moved_to_its_correct_day_is_used_once(tmp_path):
    folder = toy.make(tmp_path, n_turnout=1, n_section=1)
    run_without_snakemake(folder, shards=1, threads=1)
    campaigns = folder / "raw/T00000/hammer"
    (campaigns / "2024-01-01").rename(campaigns / "2024-01-02")
    run_without_snakemake(folder, shards=1, threads=1)
    with open_registry(folder / "results/registry") as connection:
        for table in ("recordings_current", "impacts_current"):
            query = f"select distinct campaign_id from {table}"
            assert connection.execute(query).fetchall() == [("T00000/2024-01-02",)]


def test_kills_at_random_times_change_no_byte(fleet, undisturbed):
    toy.remove_outputs(fleet)
    (fleet / "config/config.yaml").write_text("fleet: {checkpoint_units: 2}\n")
    (fleet / "pause").write_text("0.1")
    moments = random.Random(20171001)
    for _ in range(3):
        kill_after(fleet, moments.uniform(2.0, 7.0))
    (fleet / "pause").unlink()
    nightly(fleet)
    (fleet / "config/config.yaml").write_text("")
    assert toy.data_files(fleet) == undisturbed


def kill_after(folder, seconds):
    """Start a run, and kill it and all its jobs after a time."""
    run = subprocess.Popen(
        nightly_command(), cwd=folder, env=toy.environment(), start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    time.sleep(seconds)
    toy.kill(run)


def nightly_command():
    options = toy.command(shards=2)[3:]
    profile = str(toy.REPOSITORY / "profiles/default")
    return [sys.executable, "-m", "turnout.cli.main", "nightly", "--profile", profile, "--", *options]


def nightly(folder):
    done = subprocess.run(
        nightly_command(), cwd=folder, env=toy.environment(), text=True, capture_output=True, check=False
    )
    assert "units known" in done.stdout, done.stdout + done.stderr
    return done
