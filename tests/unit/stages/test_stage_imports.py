"""Stages that only read the registry load no package that they do not use: each takes 20 to 65 MB in every job."""

import subprocess
import sys

import pytest

HEAVY = {"pyarrow", "pandas", "matplotlib", "numba", "sklearn"}
JOBS = {
    "worklist": "from turnout.stages.worklist import worklist_job; "
    "worklist_job(root / '_generation.json', root / 'list.csv')",
    "pages": "from turnout.report.job import report_job as job; job(root, root / 'pages', log=root / 'log')",
}


@pytest.fixture(scope="module")
def registry(tmp_path_factory):
    from turnout.registry.job import register

    root = tmp_path_factory.mktemp("registry")
    turnouts = [{"turnout_id": "t1", "layout": "small", "config_hash": "h"}]
    register([], root, read=iter, tables={"turnouts": turnouts})
    return root


@pytest.mark.parametrize("stage", JOBS)
def test_a_stage_that_only_reads_the_registry_loads_neither_arrow_nor_pandas(registry, stage):
    code = f"import sys, pathlib; root = pathlib.Path(sys.argv[1]); {JOBS[stage]}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code, registry], capture_output=True, text=True, check=True, cwd=registry
    )
    assert HEAVY.isdisjoint(done.stdout.split())
