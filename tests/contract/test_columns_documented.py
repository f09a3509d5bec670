"""Tables, views, comments and pages agree, as they are all generated from the same two lists."""

import re

import pytest

from turnout.reasons import REASONS
from turnout.registry import documentation
from turnout.registry.arrow_types import ARROW_TYPES
from turnout.registry.database import open_registry
from turnout.registry.documentation import views
from turnout.registry.job import register
from turnout.registry.schema import CHILDREN, FILLED_BY_REGISTER, key, sort_order, tables, time_column
from turnout.registry.supersede import KINDS, LARGE_TABLES
from turnout.registry.view_texts import view_files

UNIT_SUFFIX = {
    "_hz": "Hz", "_pct": "%", "_c": "°C", "_t": "t", "_kmh": "km/h", "_ms2": "m/s²", "_at_utc": "UTC", "_utc": "UTC",
    "_m": "m", "_ms": "ms", "_s": "s", "_km": "km", "_deg": "deg", "_n": "N", "_ns": "N s", "_m_n": "m/N",
    "_pct_per_year": "%/a", "_pct_per_c": "%/°C", "_pct_per_c2": "%/°C²", "_per_s": "1/s", "_hz_per_c": "Hz/°C",
    "_days": "d", "_mn_m": "MN/m", "_m2_s3": "(m/s²)²/Hz", "_nats": "nats",
}  # fmt: skip
ALL = [column for columns in tables().values() for column in columns]


@pytest.fixture(scope="module")
def reported(tmp_path_factory):
    """Columns of every table and view, as DuckDB reports them for an empty registry."""
    root = tmp_path_factory.mktemp("columns") / "registry"
    register([], root, read=iter)
    with open_registry(root) as connection:
        rows = connection.execute(
            "select table_name, column_name, lower(data_type) from duckdb_columns() "
            "where not internal order by table_name, column_index"
        ).fetchall()
        macros = connection.execute(
            "select function_name, parameters from duckdb_functions() where function_type = 'table_macro' "
            "and not internal and database_name = 'registry'"
        ).fetchall()
    inner = {f"{table}_{part}" for table in LARGE_TABLES for part in ("settled", "touched")}
    rows = [row for row in rows if row[0] not in inner]
    found: dict[str, list[tuple[str, str]]] = {}
    for table, column, kind in rows:
        found.setdefault(table, []).append((column, kind))
    return found, macros


def test_tables_have_the_listed_columns(reported):
    for table, columns in tables().items():
        assert reported[0][table] == [(c.name, c.type) for c in columns]


def test_every_view_is_documented_with_its_columns(reported):
    actual = {name: columns for name, columns in reported[0].items() if name not in tables()}
    listed = {call: [(r["column"], r["type"]) for r in rows] for call, (_, rows) in views().items() if "(" not in call}
    assert actual == listed


def test_every_macro_is_documented_with_its_parameters(reported):
    actual = {(name, *parameters) for name, parameters in reported[1]}
    listed = set()
    for call in views():
        name, _, parameters = call.partition("(")
        if parameters:
            listed.add((name, *(p.split(":=")[0].strip() for p in parameters.rstrip(")").split(","))))
    assert actual == listed


@pytest.mark.parametrize("call", sorted(views()))
def test_every_view_has_a_description_of_its_rows_and_columns(call):
    what, rows = views()[call]
    assert what.startswith("One row") and what.endswith(".")
    assert all(r["meaning"] for r in rows)


def test_the_page_gives_every_column_of_a_view_or_where_it_is_described():
    """A block of the page is read back: columns of its table, and those that its sentence takes from another one."""
    meaning = {table: {c.name: c.meaning for c in columns} for table, columns in tables().items()}
    meaning |= {call: {r["column"]: r["meaning"] for r in rows} for call, (_, rows) in views().items()}
    n_shared = 0
    for call, block in zip(sorted(views()), documentation.view_tables().split("### ")[1:], strict=True):
        read_back = dict(re.findall(r"^\| ([a-z]\w*) \| [^|]*\| [^|]*\| (.*) \|$", block, re.M))
        read_back.pop("column", None)
        if match := re.search(r"^Columns as in \[(\w+)\]\(#\w+\): (all but )?(.*?)\.(?: And:)?$", block, re.M):
            base, but, names = meaning[match[1]], match[2], match[3].split(", ")
            shared = base if names == ["all"] else [n for n in base if (n not in names) == bool(but)]
            read_back |= {name: base[name] for name in shared}
            n_shared += 1
        assert read_back == meaning[call], call
    assert n_shared >= 20


@pytest.mark.parametrize("column", ALL, ids=lambda c: f"{c.table}.{c.name}")
def test_a_column_is_fully_described(column):
    assert column.meaning and column.type.removesuffix("[]") in ARROW_TYPES
    if column.type.removesuffix("[]") in ("double", "float"):
        assert column.check, "a double without a two-sided check accepts NaN"
    if column.type == "double" and column.minimum is not None:
        assert column.minimum < column.maximum
    if column.allowed:
        assert column.type == "varchar"


@pytest.mark.parametrize("column", ALL, ids=lambda c: f"{c.table}.{c.name}")
def test_a_name_that_ends_in_a_unit_has_that_unit(column):
    fitting = [suffix for suffix in UNIT_SUFFIX if f"_{column.name}".endswith(suffix)]
    if column.unit and column.type in ("double", "float", "double[]", "float[]", "timestamp"):
        assert fitting, f"{column.name} carries {column.unit} but not in its name"
        assert UNIT_SUFFIX[max(fitting, key=len)] == column.unit


def test_every_table_has_a_key_and_a_total_order():
    for table in tables():
        assert key(table) and {f'"{k}"' for k in key(table)} <= set(sort_order(table))
    assert all(time_column(t) for t in ("modes", "models", "passages", "passage_fits", "events", "campaigns"))


def test_tables_have_the_columns_that_the_registration_needs():
    for table, id_column, _ in KINDS.values():
        names = {c.name for c in tables()[table]}
        assert {id_column, "result_id"} <= names
    for parent, (id_column, children) in CHILDREN.items():
        for child in (parent, *children):
            assert id_column in {c.name for c in tables()[child]}
    assert set(FILLED_BY_REGISTER) == {"run_id", "result_id"}


def test_views_use_no_clock_and_no_newer_syntax():
    for name, sql in view_files().items():
        code = re.sub(
            r"'[^']*'", "''", re.sub(r"--.*", "", sql)
        ).lower()  # words in texts are not the functions of a clock
        assert not re.search(r"\b(now|current_date|current_timestamp|today|random|uuid)\b", code), name
        assert not re.search(r"(^|;)\s*(install|load|attach|copy|pragma)\b", code), name
        assert not re.search(r"\bif\s*\(", code), f"{name}: DuckDB 1.5 has no if(), write case when"


def test_the_pages_are_up_to_date_with_the_lists(repository):
    page = (repository / "docs" / "registry.md").read_text(encoding="utf-8")
    parts = {"tables": documentation.table_tables(), "views": documentation.view_tables()}
    assert documentation.with_sections(page, parts) == page, "run: python -m turnout.registry.documentation docs"
    assert (repository / "docs" / "reasons.md").read_text(encoding="utf-8") == documentation.reasons_page()
    assert len(REASONS) > 30


def test_every_view_column_and_macro_of_the_catalogue_has_a_comment(tmp_path):
    """Database tools show the comments; an empty registry has all views."""
    from turnout.registry.database import open_registry
    from turnout.registry.job import register

    register([], tmp_path / "registry", read=iter)
    with open_registry(tmp_path / "registry") as con:
        own = "database_name = current_database() and not internal and coalesce(comment, '') = ''"
        for kind, name in (
            ("views", "view_name"),
            ("columns", "table_name || '.' || column_name"),
            ("functions", "function_name"),
        ):
            assert con.execute(f"select {name} from duckdb_{kind}() where {own}").fetchall() == [], kind
        (words,) = con.execute("select comment from duckdb_views() where view_name = 'receptances_current'").fetchone()
        assert words == "One row per receptance that counts: without what was computed again since."
        (unit,) = con.execute(
            "select comment from duckdb_columns() where table_name = 'modes_current' and column_name = 'frequency_hz'"
        ).fetchone()
        assert unit.endswith("[Hz]")
