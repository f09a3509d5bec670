"""Fixtures of the workflow tests; the fleet is in a separate module, as tests use its list of calls, too."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from length_fleet import Fleet


@pytest.fixture
def fleet(tmp_path):
    return Fleet(tmp_path)
