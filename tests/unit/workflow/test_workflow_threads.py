"""Jobs of stages and commands use one BLAS thread; jobs of the registry return the memory that Arrow has freed."""

import os
import subprocess
import sys

import pytest

CODE = """
import sys
from turnout.threads import use_one_thread
assert "numpy" not in sys.modules, "too late: it has read the variables"
use_one_thread()
import numpy
from threadpoolctl import threadpool_info
print(max([pool["num_threads"] for pool in threadpool_info()], default=1))
"""


def test_one_thread_is_set_before_numpy_is_imported(repository):
    two = {"OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2", "MKL_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", CODE], env=os.environ | two, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "1"
    calls = [
        line for line in (repository / "scripts/stage.py").read_text().splitlines() if "(" in line or "import" in line
    ]
    assert calls[:2] == ["from turnout.threads import use_one_thread", "use_one_thread()"]


def test_a_command_sets_one_thread_before_numpy_is_imported():
    code = "import sys, turnout.cli.main as m; m.use_one_thread = lambda: sys.exit('numpy' in sys.modules)"
    code += "; m.main(['check'])"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


@pytest.mark.parametrize(
    ("environment", "expected"), [({}, "system"), ({"ARROW_DEFAULT_MEMORY_POOL": "mimalloc"}, "mimalloc")]
)
def test_jobs_that_copy_rows_use_the_allocator_of_the_system_unless_the_user_states_one(
    repository, environment, expected
):
    for name in ("register", "trend_update"):
        lines = (repository / f"scripts/{name}.py").read_text().splitlines()
        calls = "\n".join(line for line in lines if not line.startswith(('"""', "with", " ")))
        code = f"{calls}\nimport pyarrow\nprint(pyarrow.default_memory_pool().backend_name)"
        bare = {k: v for k, v in os.environ.items() if k != "ARROW_DEFAULT_MEMORY_POOL"}
        done = subprocess.run(
            [sys.executable, "-c", code], env=bare | environment, capture_output=True, text=True, check=True
        )
        assert done.stdout.strip() == expected
