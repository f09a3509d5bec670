"""Fixtures of the trend tests: the fleet simulator of the benchmarks, and settings."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))


@pytest.fixture(scope="session")
def settings():
    from turnout.config.settings.trend import TrendSettings

    return TrendSettings()
