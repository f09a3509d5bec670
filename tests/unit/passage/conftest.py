"""Settings of the passage stage, and the root of the repository on the path for the module ``benchmarks``."""

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
