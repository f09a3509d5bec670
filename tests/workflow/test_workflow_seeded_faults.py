"""A few seeds of ``python -m benchmarks faults``: after a fault, query results are again those of the raw files."""

import os
import shutil
import subprocess
import sys

import pytest

N_SEED = int(os.environ.get("TURNOUT_FAULT_SEEDS", "40"))  # 0.6 CPU s each; CI uses 200


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("cc"), reason="there is no C compiler for the library that injects the faults")
def test_the_runs_after_a_fault_give_the_right_results(repository):
    """The benchmark can use any number of seeds."""
    command = [sys.executable, "-m", "benchmarks", "faults", "--seeds", str(N_SEED), "--strict"]
    done = subprocess.run(command, cwd=repository, capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0 and "No bar missed" in done.stdout, done.stdout + done.stderr
