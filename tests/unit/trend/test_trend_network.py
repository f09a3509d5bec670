"""The nightly update reads the registry of simulated modes of its benchmark."""

from benchmarks.trend_registry import registry_of_modes

from turnout.registry.database import open_registry
from turnout.trend.update import update


def test_a_small_network_is_written_with_all_columns_and_gets_its_charts(tmp_path, settings):
    add = registry_of_modes(tmp_path, turnouts=4, weeks=60)
    update(tmp_path, settings)
    with open_registry(tmp_path) as con:
        before = con.execute("select count(*) from modes_current").fetchall()[0][0]
    add()
    update(tmp_path, settings)
    with open_registry(tmp_path) as con:
        after, n_charts = con.execute(
            "select (select count(*) from modes_current), (select count(*) from chart_status where section_id <> '*')"
        ).fetchall()[0]
    assert (before, after) == (4 * 16 * 59, 4 * 16 * 60) and n_charts >= 4 * 16
