"""The fleet of lengths is a module of its own, for its calls and its function are asked about, too."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from length_fleet import Fleet


@pytest.fixture
def fleet(tmp_path):
    return Fleet(tmp_path)
