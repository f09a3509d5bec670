"""A registry without measurements answers queries of every view and macro, offline, and opens in older DuckDB."""

import csv

import duckdb
import pytest
from benchmarks import bench_registry

from turnout.cli.main import main
from turnout.reasons import REASONS
from turnout.registry.database import open_registry
from turnout.registry.documentation import views
from turnout.registry.job import register
from turnout.registry.view_texts import view_columns

# DuckDB writes its storage version after the magic bytes of the main header; versions 0.9.2 to 1.2 write 64.
MAGIC, OLDEST_READ_BY_1_2 = b"DUCK", 64 + 3
ARGUMENTS = {
    "section": "'t1/A7'", "resonance": "'ballast'", "days": "365", "asof": "timestamp '2026-01-01'", "most": "20",
    "event_kind": "'tamping'", "kind_of_event": "'tamping'", "turnout": "'t1'", "from_utc": "'2026-01-01'",
    "to_utc": "'2026-02-01'", "since": "timestamp '2025-01-01'", "k": "1.0", "h": "5.0", "target_pct": "1.5",
    "base_days": "365", "at_most": "20", "above": "0.0003", "kind_of_class": "'speed'",
    "effect": "'hanging_sleeper'", "quantity": "'gap'", "size_limit": "0.002", "falls": "false",
}  # fmt: skip


@pytest.fixture(scope="module")
def empty(tmp_path_factory):
    root = tmp_path_factory.mktemp("empty") / "registry"
    register([], root, read=iter)
    return root


def sql_of(call):
    """The query of the view, or of the macro with one value for each parameter, by position."""
    name, _, parameters = call.partition("(")
    wanted = [p.split(":=")[0].strip() for p in parameters.rstrip(")").split(",") if p.strip()]
    return f"from {name}" + (f"({', '.join(ARGUMENTS[p] for p in wanted)})" if wanted else "")


@pytest.mark.parametrize("call", sorted(views()))
def test_every_view_and_macro_can_be_queried_without_measurements(empty, call):
    with open_registry(empty) as connection:
        rows = connection.execute(sql_of(call)).fetchall()
    assert len(rows) == {"registry_info": 1, "reasons": len(REASONS)}.get(call, 0)


@pytest.mark.parametrize("path", ["r.main", "memory.main,r.main"])
def test_every_view_and_macro_can_be_queried_in_an_attached_registry_on_the_search_path(empty, path):
    with duckdb.connect() as connection:
        connection.execute(f"attach '{empty}/registry.duckdb' as r (read_only)")
        for call in [c for c in views() if "(" not in c]:
            connection.execute(sql_of(f"r.{call}")).fetchall()
        connection.execute(f"set search_path = '{path}'")
        for call in views():
            connection.execute(sql_of(call)).fetchall()
            connection.execute(bench_registry._sql(call)).fetchall()


def test_the_registry_has_all_documented_views():
    documented = {
        "modes_current", "models_current", "epochs", "section_trend", "resonance_drift", "change_since_event",
        "rejected", "cannot_see", "quarantine_open", "fleet_state", "campaigns_of", "fit_by_type", "fit_by_speed",
        "fit_by_axle_load", "passage_fits_weekly", "fit_by_cluster_week", "sections_whose_scores_fell",
        "passages_behind",
    }  # fmt: skip
    assert documented <= {call.partition("(")[0] for call in views()}


def test_the_storage_version_is_1_2(empty):
    with open(empty / "registry.duckdb", "rb") as stream:
        header = stream.read(32)
    assert header[8:12] == MAGIC
    assert int.from_bytes(header[12:20], "little") <= OLDEST_READ_BY_1_2
    with open_registry(empty) as connection:
        tags = connection.execute("select tags from duckdb_databases() where database_name = 'registry'").fetchall()
    assert tags[0][0]["storage_version"].startswith("v1.2.0")


def test_no_extension_is_loaded_or_installed(empty):
    with open_registry(empty) as connection:
        settings = connection.execute(
            "select name, value from duckdb_settings() where name like 'auto%known_extensions' order by 1"
        ).fetchall()
        assert [v for _, v in settings] == ["false", "false"]
        with pytest.raises(duckdb.Error, match="read-only"):
            connection.execute("create table x(i integer)")


def test_the_database_contains_no_tables(empty):
    with open_registry(empty) as connection:
        assert connection.execute("select count(*) from duckdb_tables()").fetchall() == [(0,)]


def test_the_comment_of_a_column_contains_its_unit(empty):
    with open_registry(empty) as connection:
        comments = connection.execute(
            "select comment from duckdb_columns() where table_name in ('modes', 'modes_current') "
            "and column_name = 'frequency_se_hz'"
        ).fetchall()
    assert len(comments) == 2
    assert all(c.startswith("standard error of frequency_hz") and c.endswith(" [Hz]") for (c,) in comments)


def test_query_prints_a_table_and_writes_csv(empty, tmp_path, capsys):
    assert main(["query", "select 1.5 as a, null as b, 'x' as c", "--registry", str(empty)]) == 0
    assert capsys.readouterr().out.splitlines() == ["  a  b  c", "---  -  -", "1.5     x", "(1 row)"]
    target = tmp_path / "out.csv"
    assert main(["query", "from range(3) t(i)", "--csv", str(target), "--registry", str(empty)]) == 0
    assert list(csv.reader(target.open(encoding="utf-8-sig"))) == [["i"], ["0"], ["1"], ["2"]]
    assert main(["query", "from range(100) t(i)", "--rows", "2", "--registry", str(empty)]) == 0
    assert capsys.readouterr().out.endswith("(2 of 100 rows)\n")


def test_a_wrong_query_gives_one_message_and_exit_code_2(empty, capsys):
    assert main(["query", "from modes_curent", "--registry", str(empty)]) == 2
    message = capsys.readouterr().err
    assert "modes_curent" in message and "turnout query --list" in message and "Traceback" not in message


def test_the_registry_command_checks_compacts_and_describes_an_empty_registry(empty, capsys):
    for action, message in [
        ("check", "The files of the registry agree with its list."),
        ("compact", "Nothing to do."),
        ("vacuum", "Nothing to delete."),
        ("relocate", "views over"),
    ]:
        assert main(["registry", action, "--registry", str(empty)]) == 0
        assert message in capsys.readouterr().out
    assert main(["registry", "describe", "section_trend"]) == 0
    assert "frequency_hz" in capsys.readouterr().out
    assert main(["registry", "describe", "section_trends"]) == 2
    assert "Did you mean section_trend?" in capsys.readouterr().err
    assert main(["registry", "check", "--registry", str(empty.parent)]) == 2


def test_view_columns_are_listed_once():
    listed = [(row["view"], row["parameters"], row["column"]) for row in view_columns()]
    assert len(listed) == len(set(listed))
