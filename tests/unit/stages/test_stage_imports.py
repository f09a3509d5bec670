"""Stages that only read the registry import no heavy package: each package takes 20 to 65 MB in every job."""

import subprocess
import sys

import pytest

HEAVY = {"pyarrow", "pandas", "matplotlib", "numba", "sklearn"}
JOBS = {
    "worklist": "from turnout.stages.worklist import worklist_job; "
    "worklist_job(root / '_generation.json', root / 'list.csv')",
    "change without an alarm": "from turnout.stages.change_units import alarmed_groups as groups; "
    "from turnout.stages import change_units as units; units.REGISTRY = root; assert not list(groups(root, None))",
    "pages": "from turnout.report.job import report_job as job; job(root, root / 'pages', progress=False)",
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


RARELY_USED = {"scipy.signal", "scipy.stats", "scipy.interpolate", "scipy.optimize"}


@pytest.mark.parametrize(
    ("modules", "loads"),
    [
        ("turnout.stages.file_contents, turnout.stages.layout_draft", False),
        ("turnout.stages.layout_checks, turnout.stages.layout_reading", False),
        ("turnout.stages.hammer", True),
        ("turnout.stages.passage", True),
    ],
)
def test_parts_of_scipy_are_imported_only_where_they_are_used_and_before_a_fork(modules, loads):
    """They took 0.7 of the 2.2 CPU s of ``turnout check``. Forked processes analyse the recordings."""
    done = subprocess.run(
        [sys.executable, "-c", f"import sys, {modules}; print(*sys.modules)"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    loaded = RARELY_USED & set(done.stdout.split())
    assert loaded == (RARELY_USED if loads else set())
