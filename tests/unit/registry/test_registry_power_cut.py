"""A power cut preserves only flushed data: a file is renamed to its final name only after its content is flushed."""

import ast
import os
from pathlib import Path

from registry_rows import hammer_result

from turnout.config.settings.trend import TrendSettings
from turnout.registry.compaction import compact
from turnout.registry.database import open_registry, rebuild_database
from turnout.registry.integrity import check
from turnout.report.site import write_pages
from turnout.trend.update import update
from turnout.workflow.retries import note_postponed

RENAMING = {"replace", "rename", "renames", "move"}


def test_only_one_module_renames_files(repository):
    """``turnout.files`` renames after fsync; all other modules call it."""
    wrong = []
    for path in sorted((repository / "src" / "turnout").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in RENAMING:
                module = getattr(node.func.value, "id", "")
                is_method = node.func.attr in ("rename", "replace") and len(node.args) == 1 and not node.keywords
                if (module in ("os", "shutil") or is_method) and path.name != "files.py":
                    wrong.append(f"{path.relative_to(repository)}:{node.lineno}")
    assert not wrong


def test_every_file_is_flushed_before_it_is_renamed(bench, monkeypatch):
    """The test records the system calls of a registration, trends, compaction, relocation and pages."""
    flushed, renamed, unflushed = set(), [], []
    real_sync, real_replace = os.fsync, os.replace

    def sync(handle):
        status = os.fstat(handle)
        flushed.add((status.st_ino, status.st_size))
        real_sync(handle)

    def replace(source, target, **more):
        status = os.stat(source)
        renamed.append(str(target))
        if (status.st_ino, status.st_size) not in flushed:
            unflushed.append(str(target))
        real_replace(source, target, **more)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(os, "replace", replace)
    monkeypatch.setattr(os, "rename", replace)
    for day in ("2026-01-05", "2026-01-12"):
        bench.register(hammer_result(day=day))
    update(bench.registry, TrendSettings(), day="2026-02-01")
    compact(bench.registry)
    rebuild_database(bench.registry)
    with open_registry(bench.registry) as connection:
        write_pages(connection, bench.root / "pages", progress=False)
    note_postponed(bench.root / "work" / "00of01.json", {"a": "fault"})
    assert unflushed == [] and len(renamed) > 40
    names = {Path(name).name.partition("-")[0] for name in renamed}
    assert {"_schema", "batch", "compact", "_generation.json", "registry.duckdb", "index.html"} <= names


def test_a_damaged_schema_file_of_an_empty_table_is_written_again(bench):
    bench.register(hammer_result())
    damaged = sorted(bench.registry.glob("*/_schema-*.parquet"))
    assert len(damaged) > 5
    for k, path in enumerate(damaged):
        path.write_bytes((b"", b"PAR1", b"PAR1" + 4096 * b"\0" + b"PAR1")[k % 3])
    assert any("_schema" in problem for problem in check(bench.registry))
    bench.register(hammer_result(day="2026-01-12"))
    assert bench.ask("select count(*) from modes") == [(2,)] and bench.ask("from passages") == []
    assert check(bench.registry) == []
