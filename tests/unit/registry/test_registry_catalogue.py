"""The catalogue of ``registry.duckdb`` is a copy of a template with the constants of its generation."""

import hashlib
from datetime import UTC, datetime

import duckdb
import pytest
from registry_rows import Bench, hammer_result

from turnout.registry import catalogue_template, view_texts
from turnout.registry.catalogue import comment_catalogue, create_catalogue
from turnout.registry.database import build_database
from turnout.registry.generation import load

LISTS = (
    "select view_name, comment from duckdb_views() where not internal",
    "select table_name, column_name, data_type, comment from duckdb_columns() where not internal",
    "select function_name, function_type, parameters, comment, "  # the constants of a generation have no parameters
    "case when function_type = 'macro' and len(parameters) = 0 then macro_definition end from duckdb_functions() "
    "where not internal",
)


@pytest.fixture
def no_cache(tmp_path, monkeypatch):
    """No template is cached in this process, and the cache folder is empty."""
    monkeypatch.setattr(catalogue_template, "_templates", {})
    monkeypatch.setattr(catalogue_template, "_folders", lambda: [tmp_path / "cache"])
    return tmp_path / "cache"


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Two campaigns in two generations."""
    root = tmp_path_factory.mktemp("catalogue")
    (root / "work").mkdir()
    bench = Bench(root)
    for day in ("2026-01-05", "2026-01-12"):
        bench.register(hammer_result(day=day))
    return bench


def entries(file):
    with duckdb.connect() as con:
        con.execute(f"attach '{file}' as registry (read_only)")
        rows = [con.execute(f"{sql} and database_name = 'registry'").fetchall() for sql in LISTS]
        rows.append(con.execute("from registry.registry_info").fetchall())
    return [sorted(str(row).replace("TIMESTAMP_US", "TIMESTAMP") for row in some) for some in rows]


def test_a_copy_of_the_template_equals_a_catalogue_that_is_created_for_its_generation(bench, tmp_path):
    generation, root, created = load(bench.registry), bench.registry.resolve(), tmp_path / "made.duckdb"
    with duckdb.connect() as con:
        con.execute(f"attach '{created}' as registry")
        con.execute("use registry")
        create_catalogue(con, root, generation, datetime.now(UTC))
        comment_catalogue(con)
    build_database(bench.registry, generation)
    expected, copied = entries(created), entries(root / "registry.duckdb")
    assert min(map(len, expected[:3])) > 50
    assert copied == expected


def test_the_template_is_created_once_and_read_by_other_processes(no_cache, monkeypatch):
    template = catalogue_template.catalogue_template()
    monkeypatch.setattr(catalogue_template, "_make", lambda: pytest.fail("made again"))
    assert catalogue_template.catalogue_template() is template
    catalogue_template._templates.clear()  # another process
    assert catalogue_template.catalogue_template() == template


def test_a_damaged_template_is_created_again(no_cache, monkeypatch):
    catalogue_template.catalogue_template()
    (path,) = no_cache.iterdir()
    content = bytearray(path.read_bytes())
    for damaged in (b"", bytes(content[:-1]), bytes(content[:5000]) + bytes([content[5000] ^ 1]) + content[5001:]):
        path.write_bytes(damaged)
        catalogue_template._templates.clear()
        monkeypatch.setattr(catalogue_template, "_make", lambda: b"made again")
        assert catalogue_template.catalogue_template() == b"made again"
        assert path.read_bytes() == hashlib.sha256(b"made again").digest() + b"made again"


def test_other_views_have_another_template(no_cache, monkeypatch):
    monkeypatch.setattr(catalogue_template, "_make", lambda: b"made")
    catalogue_template.catalogue_template()
    texts = view_texts.view_files() | {"added": "create or replace view added as select 1 as one"}
    monkeypatch.setattr(view_texts, "view_files", lambda: texts)
    monkeypatch.setattr(catalogue_template, "_make", lambda: b"with another view")
    assert catalogue_template.catalogue_template() == b"with another view"


def test_each_process_creates_the_template_if_the_cache_folder_cannot_be_written(no_cache, monkeypatch):
    no_cache.write_text("a file, not a folder")
    template = catalogue_template.catalogue_template()
    assert template[8:12] == b"DUCK" and no_cache.read_text() == "a file, not a folder"


def test_only_the_newest_templates_are_kept(no_cache, monkeypatch):
    monkeypatch.setattr(catalogue_template, "_make", lambda: b"made")
    for k in range(catalogue_template.N_KEPT + 3):
        monkeypatch.setattr(catalogue_template, "_key", lambda k=k: f"{k:02d}")
        catalogue_template.catalogue_template()
    assert len(list(no_cache.iterdir())) == catalogue_template.N_KEPT
