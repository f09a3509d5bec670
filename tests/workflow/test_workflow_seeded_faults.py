"""A few seeds of ``python -m benchmarks faults``: after a fault the answers are again those of the raw files."""

import subprocess
import sys


def test_the_nights_after_a_fault_are_right(repository):
    """Three seeds, one process: CI has 30 s for them. The benchmark takes any number."""
    command = [sys.executable, "-m", "benchmarks", "faults", "--seeds", "3", "--strict"]
    done = subprocess.run(command, cwd=repository, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and "No bar missed" in done.stdout, done.stdout + done.stderr
