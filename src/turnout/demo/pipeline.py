"""Run the workflow as a user would."""

import subprocess
import sys


def run_pipeline(cores, *options) -> int:
    """Snakemake on ``cores`` processors with further ``options``; its exit code."""
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores), *options]
    return subprocess.run(command).returncode
