"""The workflow on a real Slurm: the same registry as on one machine, and a cancelled job is tried again."""

import importlib.util
import shutil
import subprocess
import time

import private_slurm
import pytest
import toy_fleet as toy

LACKING = private_slurm.missing()
if importlib.util.find_spec("snakemake_executor_plugin_slurm") is None:
    LACKING.append("snakemake-executor-plugin-slurm")
pytestmark = [
    pytest.mark.slurm,
    pytest.mark.slow,
    pytest.mark.skipif(bool(LACKING), reason=f"no Slurm here: {', '.join(LACKING)} not found"),
]
FAST = ("--slurm-init-seconds-before-status-checks", "3", "--latency-wait", "20")


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    # the path of the socket must be shorter than 108 characters
    folder = tmp_path_factory.mktemp("s")
    with private_slurm.Slurm(folder) as running:
        yield running


def test_slurm_gives_the_same_registry_and_a_cancelled_job_is_tried_again(slurm, tmp_path):
    here = toy.make(tmp_path / "here", n_turnout=4)
    cluster = tmp_path / "cluster"
    shutil.copytree(here, cluster)
    toy.run(here, shards=2)

    profile = str(toy.REPOSITORY / "profiles/slurm")
    command = toy.command("--workflow-profile", profile, *FAST, shards=2, cores=None)
    environment = (
        toy.environment()
        | slurm.environment
        | {"PATH": f"{slurm.base}/bin:{toy.environment()['PATH']}:{private_slurm.SBIN}"}
    )
    # each unit waits, so that there is a job to cancel
    (cluster / "pause").write_text("3")
    with open(cluster / "said", "w") as output:
        run = subprocess.Popen(command, cwd=cluster, env=environment, stdout=output, stderr=subprocess.STDOUT)
        try:
            cancelled = cancel_one(slurm)
            assert run.wait(170) == 0, (cluster / "said").read_text()
        finally:
            run.kill()
    output = (cluster / "said").read_text()
    assert cancelled in output and "Trying to restart job" in output
    assert toy.data_files(cluster) == toy.data_files(here)
    again = subprocess.run(command, cwd=cluster, env=environment, capture_output=True, text=True, timeout=100)
    assert "Nothing to be done" in again.stdout + again.stderr


def cancel_one(slurm):
    """Cancel the first job that runs; return its id."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        running = slurm.call("squeue", "-h", "-t", "R", "-o", "%i").split()
        if running:
            time.sleep(2.0)
            slurm.call("scancel", running[0])
            return running[0]
        time.sleep(0.3)
    raise TimeoutError("no job started within 60 s")
