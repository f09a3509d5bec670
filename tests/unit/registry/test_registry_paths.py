"""A generation file with paths outside the registry is rejected: no file outside is read or deleted."""

import json

import pytest

from turnout.errors import RegistryError
from turnout.registry.generation import GENERATION_FILE, Generation, commit, load
from turnout.workflow.launch import launch


@pytest.mark.parametrize("path", ["../victim", "modes/../../victim", "/etc/passwd", ""])
@pytest.mark.parametrize("where", ["retired", "files"])
def test_a_path_outside_the_registry_is_rejected(tmp_path, path, where):
    registry, victim = tmp_path / "registry", tmp_path / "victim"
    registry.mkdir()
    victim.write_text("x")
    commit(registry, Generation(number=9, retired=[("modes/old.parquet", 1)]))
    assert load(registry).retired == [("modes/old.parquet", 1)]
    content = json.loads((registry / GENERATION_FILE).read_text())
    file = {"path": path, "table": "modes", "year": None, "rows": 1, "bytes": 1, "sha256": "0", "schema": "s"}
    content[where] = [[path, 1]] if where == "retired" else [file]
    (registry / GENERATION_FILE).write_text(json.dumps(content))
    with pytest.raises(RegistryError, match="leads out of the registry"):
        load(registry)
    assert victim.exists()


def test_a_folder_name_that_duckdb_cannot_use_is_rejected_before_any_computation(tmp_path, monkeypatch):
    folder = tmp_path / "what?"
    (folder / "config").mkdir(parents=True)
    (folder / "config" / "turnouts.tsv").write_text("turnout\tlayout\n")
    monkeypatch.chdir(folder)
    with pytest.raises(RegistryError, match=r"DuckDB can make no database where a folder has \? in its name"):
        launch({}, scan=True)
    assert not (folder / "work").exists()
