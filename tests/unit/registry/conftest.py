"""Fixtures of the registry tests; their rows are in a separate module, as fixtures of module scope need them, too."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from registry_rows import Bench, hammer_result, parquet_hashes, quarantined_result


@pytest.fixture
def bench(tmp_path):
    (tmp_path / "work").mkdir()
    return Bench(tmp_path)


@pytest.fixture(name="hammer")
def _hammer():
    return hammer_result


@pytest.fixture(name="quarantined")
def _quarantined():
    return quarantined_result


@pytest.fixture(name="hashes")
def _hashes():
    return parquet_hashes


@pytest.fixture(scope="session")
def fleet(tmp_path_factory):
    """The small made-up fleet in a registry, and a connection to it."""
    from registry_fleet import fleet_tables, hammer_results, passage_results, quarantine_results

    root = tmp_path_factory.mktemp("fleet")
    (root / "work").mkdir()
    bench = Bench(root)
    bench.register(*hammer_results(), *passage_results(), *quarantine_results(), tables=fleet_tables())
    return bench
