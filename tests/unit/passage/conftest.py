"""Settings of the passage part, and the repository's root on the path for the truth in ``benchmarks``."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))


@pytest.fixture(scope="session")
def settings():
    from turnout.config.settings.passage import PassageSettings

    return PassageSettings()
