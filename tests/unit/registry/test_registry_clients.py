"""All documented versions of DuckDB can query the registry: all views, and macros with their defaults.

pip installs the versions into temporary folders; the test of a version is skipped if pip cannot install it.
"""

import subprocess
import sys

import pytest

PROMISED = ("1.4.2", "1.5.0")  # the oldest of docs/recipes.md, and that of pyproject.toml
ASK = """
import json, sys
sys.path.insert(0, sys.argv[1])
import duckdb
con = duckdb.connect(sys.argv[2], read_only=True)
names = [row[0] for row in con.execute("select view_name from duckdb_views() where not internal").fetchall()]
errors = {}
for name in [f'"{name}"' for name in names] + [
    "worklist(newest_measurement())", "worklist(newest_measurement(), most := 3)", "cannot_see()", "unusable()",
    "cannot_see(asof := newest_measurement())", "cusum(timestamp '2020-01-01')", "resonance_drift(days := 900)",
    "hanging_sleepers_that_grow()", "sections_whose_scores_fell(28)", "change_since_event('tamping', 90)",
]:
    try:
        con.execute(f"select * from {name}").fetchall()
    except duckdb.Error as error:
        errors[name] = str(error)
print(json.dumps([duckdb.__version__, len(names), errors]))
"""


@pytest.fixture(scope="module", params=PROMISED)
def old_duckdb(request, tmp_path_factory):
    """(version, folder) of an older DuckDB."""
    folder = tmp_path_factory.mktemp("duckdb")
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--only-binary", ":all:", "--retries", "0",
               "--timeout", "5", "--target", str(folder), f"duckdb=={request.param}"]  # fmt: skip
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    except subprocess.TimeoutExpired:
        pytest.skip(f"pip needs more than 120 s for duckdb {request.param}")
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        pytest.skip(f"pip cannot get duckdb {request.param}: {last}")
    return request.param, folder


def test_an_older_duckdb_can_query_all_views_and_macros(fleet, old_duckdb, repository):
    import json

    version, folder = old_duckdb
    command = [sys.executable, "-c", ASK, str(folder), str(fleet.registry / "registry.duckdb")]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=180, check=True, env={})
    name, n_view, errors = json.loads(answer.stdout)
    assert (name, errors) == (version, {}) and n_view > 40
    promise = f"DuckDB {PROMISED[0]} and later"
    assert promise in (repository / "docs" / "recipes.md").read_text(encoding="utf-8")
