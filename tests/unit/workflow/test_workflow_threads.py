"""A stage job and a command start one BLAS thread, whatever the environment has set."""

import os
import subprocess
import sys

CODE = """
import sys
from turnout.threads import use_one_thread
assert "numpy" not in sys.modules, "too late: it has read the variables"
use_one_thread()
import numpy
from threadpoolctl import threadpool_info
print(max([pool["num_threads"] for pool in threadpool_info()], default=1))
"""


def test_one_thread_is_asked_for_before_numpy_comes(repository):
    two = {"OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2", "MKL_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", CODE], env=os.environ | two, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "1"
    calls = [
        line for line in (repository / "scripts/stage.py").read_text().splitlines() if "(" in line or "import" in line
    ]
    assert calls[:2] == ["from turnout.threads import use_one_thread", "use_one_thread()"]


def test_a_command_asks_for_one_thread_before_numpy_comes():
    code = "import sys, turnout.cli.main as m; m.use_one_thread = lambda: sys.exit('numpy' in sys.modules)"
    code += "; m.main(['check'])"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
