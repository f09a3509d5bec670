"""The types that the code declares are those it uses, in every part that pyproject.toml lists for mypy."""

import subprocess
import sys


def test_declared_types_are_sound(repository):
    done = subprocess.run([sys.executable, "-m", "mypy"], cwd=repository, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
