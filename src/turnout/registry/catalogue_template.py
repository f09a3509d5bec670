"""A file with the catalogue of an empty registry, made once per version of the program and copied at each commit.

To create the views takes 0.5 CPU seconds, because DuckDB binds each of them with all that it reads; to copy their file
and to set the constants of a generation takes a tenth.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from datetime import UTC, datetime
from functools import cache
from importlib.resources import files
from pathlib import Path

import duckdb

from turnout.files import changed_at, write_atomic
from turnout.registry import view_texts
from turnout.registry.catalogue import comment_catalogue, create_catalogue
from turnout.registry.connection import connect
from turnout.registry.generation import Generation
from turnout.registry.ids import content_id
from turnout.registry.schema import literal, tables

# Every DuckDB since 1.2 opens it; tools with an older DuckDB could not read the newest format.
STORAGE_VERSION = "v1.2.0"
N_KEPT = 4  # templates in a cache folder, of several versions
_DIGEST_SIZE = hashlib.sha256().digest_size
_templates: dict[str, bytes] = {}


def catalogue_template() -> bytes:
    """Content of a DuckDB file with all views, macros and comments, for no files.

    It is kept in this process and in the first writable cache folder: beside the source, else in the user's cache. A
    damaged or outdated file there is not used.

    Returns
    -------
    bytes
        The file.

    Raises
    ------
    RegistryError
        When a view is not valid.
    OSError, duckdb.Error
        When no temporary file can be written.
    """
    key = _key()
    if key not in _templates:
        _templates[key] = _read(key) or _keep(key, _make())
    return _templates[key]


def _key() -> str:
    """Hash of all that the template depends on."""
    columns = [(c.table, c.name, c.type, c.unit, c.meaning, c.key) for t in tables().values() for c in t]
    texts = (view_texts.view_files(), view_texts.reasons_sql(), list(view_texts.view_columns()))
    return content_id("catalogue", duckdb.__version__, _code(), columns, *texts)


@cache
def _code() -> str:
    """Hash of the modules of the registry, which write the statements."""
    modules = sorted((p for p in files("turnout.registry").iterdir() if p.name.endswith(".py")), key=lambda p: p.name)
    return hashlib.sha256(b"".join(module.read_bytes() for module in modules)).hexdigest()


def _make() -> bytes:
    with tempfile.TemporaryDirectory(prefix="turnout-catalogue-") as name:
        folder = Path(name)
        file = folder / "catalogue.duckdb"
        con = connect()
        try:
            con.execute(f"attach {literal(str(file))} as registry (storage_version '{STORAGE_VERSION}')")
            con.execute("use registry")
            con.execute("begin")
            create_catalogue(con, folder, Generation(0), datetime.now(UTC))
            con.execute("commit")
            comment_catalogue(con)
            con.execute("use memory")
            con.execute("detach registry")
        finally:
            con.close()
        return file.read_bytes()


def _folders() -> list[Path]:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return [Path(__file__).parent / "__pycache__", Path(home) / "turnout"]


def _paths(key: str) -> list[Path]:
    return [folder / f"catalogue-{key}.cache" for folder in _folders()]


def _read(key: str) -> bytes | None:
    for path in _paths(key):
        try:
            content = path.read_bytes()
        except OSError:
            continue
        if hashlib.sha256(content[_DIGEST_SIZE:]).digest() == content[:_DIGEST_SIZE]:
            return content[_DIGEST_SIZE:]
    return None


def _keep(key: str, template: bytes) -> bytes:
    content = hashlib.sha256(template).digest() + template
    for path in _paths(key):
        try:
            write_atomic(path, lambda stream: stream.write(content))
            for older in sorted(path.parent.glob("catalogue-*.cache"), key=changed_at)[:-N_KEPT]:
                older.unlink(missing_ok=True)
        except OSError:
            continue
        break
    return template
