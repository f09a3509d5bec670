"""The nightly update of a registry: derived tables, files by year, the worklist, and commands."""

import shutil
import sys

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from benchmarks.trend_fleet import Fleet, drift, modes
from benchmarks.trend_registry import small_registry

from turnout.config.settings.trend import TrendSettings
from turnout.registry.database import build_database, open_registry
from turnout.registry.generation import Generation, commit, load
from turnout.trend.update import update

FLEET = Fleet(turnouts=3, weeks=120, phi=0.1)


@pytest.fixture(scope="module")
def rows():
    which = np.zeros((3, 8), bool)
    which[1, 4] = True
    return modes(FLEET, 3, drift(FLEET, which, -4.0, 60))


@pytest.fixture(scope="module")
def registry(tmp_path_factory, rows, settings):
    root = tmp_path_factory.mktemp("registry")
    small_registry(root, rows)
    return root, update(root, settings)


@pytest.fixture(scope="module")
def week_before(tmp_path_factory, rows, settings):
    """The registry of a week before, and the digests of its update."""
    root = tmp_path_factory.mktemp("week_before") / "registry"
    small_registry(root, rows[rows["measured_at_utc"] < rows["measured_at_utc"].max()])
    return root, update(root, settings)


def test_every_mode_has_its_row_and_every_chart_its_state(registry, rows):
    root, done = registry
    assert done.rows["charts"] == len(rows) + 3 * 120  # and the median of each turnout
    assert done.rows["chart_status"] == 3 * 9
    with open_registry(root) as con:
        first = con.execute("select section_id, state from worklist").fetchall()[0]
        assert first == ("T00001/S4", "inspect this week")
        assert con.execute("select count(*) from charts where isnan(z) or isnan(expected_hz)").fetchall() == [(0,)]
        assert con.execute("select count(*) from chart_states").fetchall() == [(27,)]


def test_a_second_update_of_the_same_data_writes_no_files(registry, settings):
    root, done = registry
    before = load(root)
    again = update(root, settings, done.digests)
    assert again.written == () and again.generation == done.generation
    assert load(root) == before
    whole = update(root, settings)  # without the digests it writes the same files again
    assert load(root) == before and whole.digests == done.digests


def test_rows_in_another_order_give_the_same_files(registry, rows, settings, tmp_path):
    root, _ = registry
    small_registry(tmp_path, rows.sample(frac=1.0, random_state=1))
    update(tmp_path, settings)
    assert {f.path for f in load(tmp_path).files if f.table == "charts"} == {
        f.path for f in load(root).files if f.table == "charts"
    }


def test_a_further_week_rewrites_only_its_year(rows, week_before, settings, tmp_path):
    last, (backup, first) = rows["measured_at_utc"].max(), week_before
    shutil.copytree(backup, tmp_path, dirs_exist_ok=True)
    assert first.written == (2016, 2017, 2018)
    small_registry(tmp_path, rows, 5)
    second = update(tmp_path, settings, first.digests)
    assert second.written == (2018,)
    with open_registry(tmp_path) as con:
        assert con.execute("select count(*) from charts").fetchall()[0][0] == len(rows) + 360
        assert con.execute("select max(measured_at_utc) from charts").fetchall()[0][0] == last


def test_charts_of_a_backup_that_was_put_back_are_written_again(rows, week_before, settings, tmp_path):
    """The folder of the workflow holds the digests of the last night; the registry is a week older."""
    last, (backup, _) = rows["measured_at_utc"].max(), week_before
    shutil.copytree(backup, tmp_path / "registry")
    small_registry(tmp_path / "registry", rows, 5)
    remembered = update(tmp_path / "registry", settings).digests
    shutil.rmtree(tmp_path / "registry")
    shutil.copytree(backup, tmp_path / "registry")
    small_registry(tmp_path / "registry", rows, 9)
    assert update(tmp_path / "registry", settings, remembered).written == (2018,)
    with open_registry(tmp_path / "registry") as con:
        assert con.execute("select max(measured_at_utc) from charts").fetchall() == [(last,)]


def test_a_split_of_the_fleet_does_not_change_the_results(registry, settings, monkeypatch):
    root, done = registry
    monkeypatch.setattr("turnout.trend.update.CELLS_PER_PART", 960)
    assert update(root, settings).digests == done.digests


def test_an_empty_registry_is_no_error(tmp_path, settings):
    generation = Generation()
    commit(tmp_path, generation)
    build_database(tmp_path, generation)
    done = update(tmp_path, settings)
    assert done.rows == {"chart_status": 0, "baselines": 0, "alarms": 0, "charts": 0} and done.newest is None


def test_the_printed_list_states_position_cause_and_certainty(registry, capsys, tmp_path):
    from turnout.cli.main import main

    root, _ = registry
    assert main(["worklist", "--registry", str(root)]) == 0
    output = capsys.readouterr().out
    assert "INSPECT THIS WEEK: T00001, S4, railpad" in output and "How sure: " in output and "Look at: worn" in output
    assert main(["worklist", "--registry", str(root), "--csv", str(tmp_path / "list.csv")]) == 0
    table = pd.read_csv(tmp_path / "list.csv")
    assert table.loc[0, "section_id"] == "T00001/S4" and len(table) <= 20
    assert main(["worklist", "--registry", str(root), "--as-of", "yesterday"]) == 2
    assert "YYYY-MM-DD" in capsys.readouterr().err


def test_a_list_of_a_day_before_the_first_measurement_states_that(registry, rows, capsys, tmp_path):
    from turnout.cli.main import main

    root, _ = registry
    first = rows["measured_at_utc"].min()
    for more in ([], ["--all"], ["--csv", str(tmp_path / "list.csv")]):
        assert main(["worklist", "--registry", str(root), "--as-of", "1999-12-31", *more]) == 2
        output = capsys.readouterr()
        assert (
            f"'1999-12-31': nothing was measured by then, the first measurement is of {first:%Y-%m-%d %H:%M}"
            in output.err
        )
        assert output.out == "" and not (tmp_path / "list.csv").exists()
    assert main(["worklist", "--registry", str(root), "--as-of", f"{first:%Y-%m-%dT%H:%M:%S}"]) == 0


def test_the_export_writes_tables_in_common_formats(registry, tmp_path, capsys):
    from turnout.cli.main import main

    root, _ = registry
    assert main(["export", str(tmp_path / "out"), "--only", "charts", "worklist", "--registry", str(root)]) == 0
    assert len(pd.read_parquet(tmp_path / "out" / "charts.parquet")) == 3 * 9 * 120
    assert (
        main(["export", str(tmp_path / "out"), "--format", "csv", "--only", "worklist", "--registry", str(root)]) == 0
    )
    assert pd.read_csv(tmp_path / "out" / "worklist.csv")["rank"].tolist()[0] == 1
    assert f"{tmp_path / 'out' / 'worklist.csv'}: " in capsys.readouterr().out
    assert main(["export", str(tmp_path), "--only", "nonsense", "--registry", str(root)]) == 2
    assert "no table or view 'nonsense'" in capsys.readouterr().err


def test_a_delta_lake_holds_the_tables_of_the_registry_in_versions(registry, tmp_path):
    deltalake = pytest.importorskip("deltalake", reason="the extra 'lakehouse' is not installed")
    from turnout.cli.main import main

    names = ["alarms", "charts", "worklist", "modes_current"]
    command = ["export", str(tmp_path), "--format", "delta", "--only", *names, "--registry", str(registry[0])]
    assert main(command) == 0 and main(command) == 0
    with open_registry(registry[0]) as con:
        for name in names:
            lake = deltalake.DeltaTable(str(tmp_path / name))
            assert lake.version() == 1, "a second export is a new version"
            con.register("lake", pa.table(lake.to_pyarrow_table()))
            n, same = con.execute(
                f"select (select count(*) from {name}), (select count(*) from (from {name} except all from lake))"
            ).fetchall()[0]
            assert (len(lake.to_pyarrow_table()), same) == (n, 0) and n > 0


def test_an_export_without_the_package_states_what_to_install(registry, tmp_path, capsys, monkeypatch):
    from turnout.cli.main import main

    monkeypatch.setitem(sys.modules, "deltalake", None)
    code = main(["export", str(tmp_path), "--format", "delta", "--only", "alarms", "--registry", str(registry[0])])
    assert code == 2 and "pip install '.[lakehouse]'" in capsys.readouterr().err


@pytest.mark.parametrize("stamp", ["1970-01-01 00:00:10", "2031-05-05"], ids=["never set", "ahead"])
def test_one_wrong_clock_does_not_stop_the_nightly_update(registry, rows, settings, tmp_path, stamp):
    root, _ = registry
    extra = rows[(rows["measured_at_utc"] == rows["measured_at_utc"].max()) & (rows["turnout_id"] == "T00001")]
    wrong = pd.concat([rows, extra.assign(measured_at_utc=np.datetime64(stamp, "us"))], ignore_index=True)
    small_registry(tmp_path, wrong)
    done = update(tmp_path, settings)
    again = update(tmp_path, settings, done.digests)
    assert again.written == () and again.generation == done.generation
    question = "select section_id, state, n_campaigns, detectable_pct from chart_status order by all"
    with open_registry(root) as sound, open_registry(tmp_path) as con:
        assert con.execute(question).fetchall() == sound.execute(question).fetchall()
        wrong_times = con.execute(
            "select section_id, measured_at_utc from charts where state = 'wrong_time'"
        ).fetchall()
        assert len(wrong_times) == 8 and {at for _, at in wrong_times} == {pd.Timestamp(stamp).to_pydatetime()}
        assert con.execute("select section_id from worklist").fetchall()[0] == ("T00001/S4",)


def weekly(rng, turnout, section, phi, drop=0.0):
    """Three years of one section: AR(1) of 0.6 %, and a fall by ``drop`` in the last 14 weeks."""
    when = pd.date_range("2016-01-04", periods=157, freq="7D")
    noise = rng.normal(size=157)
    for k in range(1, 157):
        noise[k] = phi * noise[k - 1] + np.sqrt(1.0 - phi**2) * noise[k]
    rail = 10 + 15 * np.sin(2 * np.pi * np.arange(157) / 52) + rng.normal(0, 4, 157)
    value = 150 * (1 - 0.0015 * (rail - 10) + 0.006 * noise - drop * (np.arange(157) >= 143))
    row = {"turnout_id": turnout, "section_id": f"{turnout}/{section}", "band": "ballast", "source": "hammer"}
    return pd.DataFrame(
        row | {"measured_at_utc": when, "frequency_hz": value, "frequency_se_hz": 0.3, "rail_temperature_c": rail}
    )


def test_an_alarm_that_is_not_raised_again_is_closed_and_stays_listed(settings, tmp_path, caplog):
    """Forty turnouts with more memory join six without. With the common memory a former alarm is none."""
    rng = np.random.default_rng(5)
    few = pd.concat([weekly(rng, f"T{k}", s, 0.0, 0.016 * (k == 0)) for k in range(6) for s in "AB"])
    many = pd.concat([few, *[weekly(rng, f"U{k}", s, 0.8) for k in range(40) for s in "AB"]], ignore_index=True)
    query = "select alarm_id, closed_at_utc, closed_by from alarms where alarm_id like 'T0/%' and raised_at_utc > '{}'"
    query = query.format("2018-09-01")
    listed = "select section_id, state, sentence from worklist where section_id like 'T0/%'"
    small_registry(tmp_path, few)
    update(tmp_path, settings)
    with open_registry(tmp_path) as con:
        before = con.execute(query).fetchall()
    assert before and {row[1:] for row in before} == {(None, None)}
    small_registry(tmp_path, many, 2)
    done = update(tmp_path, settings)
    taken = f"the alarm {before[0][0]} is not raised again"
    assert taken in caplog.text
    with open_registry(tmp_path) as con:
        found, states = con.execute(query).fetchall(), con.execute(listed).fetchall()
        then = con.execute("select max(measured_at_utc) from charts").fetchall()[0][0]
    assert (before[0][0], then, "recomputed") in found and len(found) == len(before)
    assert any("is not raised again" in sentence for _, state, sentence in states if state == "cannot tell")
    again = update(tmp_path, settings, done.digests)
    assert again.generation == done.generation and caplog.text.count(taken) == 1, "the next night changes nothing"
    later = many[many["section_id"] == "U1/A"].tail(1)
    later = later.assign(measured_at_utc=later["measured_at_utc"] + pd.Timedelta("7D"))
    small_registry(tmp_path, pd.concat([many, later]), 9)
    update(tmp_path, settings)
    with open_registry(tmp_path) as con:
        assert con.execute(query).fetchall() == found
        assert not [row for row in con.execute(listed).fetchall() if "is not raised again" in row[2]]


STATES = "select * from chart_status order by turnout_id, section_id, band, source"


@pytest.mark.parametrize("ahead", [["2019-03-05"], ["2099-01-05", "2099-01-12"]], ids=["a month mistyped", "2099"])
def test_a_campaign_with_a_future_date_is_shown_and_not_used(registry, rows, settings, tmp_path, ahead):
    """Eleven months ahead, and further ahead with neighbours: a future date is wrong in both cases."""
    own = rows[(rows["section_id"] == "T00000/S3")].tail(len(ahead))
    wrong = own.assign(measured_at_utc=np.array(ahead, "datetime64[us]"), frequency_hz=[400.0, 390.0][: len(own)])
    small_registry(tmp_path, pd.concat([rows, wrong], ignore_index=True))
    done = update(tmp_path, settings, day=rows["measured_at_utc"].max() + pd.Timedelta(days=3))
    assert done.newest == rows["measured_at_utc"].max()
    with open_registry(registry[0]) as sound, open_registry(tmp_path) as con:
        pd.testing.assert_frame_equal(con.execute(STATES).df(), sound.execute(STATES).df())
        wrong_times = con.execute(
            "select section_id, measured_at_utc::date::varchar from charts where state = 'wrong_time'"
        )
        assert wrong_times.fetchall() == [("T00000/S3", day) for day in ahead]


def test_if_most_charts_are_ahead_the_clock_of_this_machine_is_late(registry, settings, tmp_path, rows):
    small_registry(tmp_path, rows)
    update(tmp_path, settings, day=pd.Timestamp("2017-03-01"))
    with open_registry(registry[0]) as sound, open_registry(tmp_path) as con:
        assert con.execute(STATES).fetchall() == sound.execute(STATES).fetchall()


def test_a_registry_with_wrong_dates_alone_is_shown_and_is_no_error(rows, settings, tmp_path):
    """No campaign can be used: the charts state that, and the update continues."""
    only = rows[(rows["turnout_id"] == "T00001") & (rows["measured_at_utc"] == rows["measured_at_utc"].max())]
    small_registry(tmp_path, only.assign(measured_at_utc=np.datetime64("1970-01-01T10:00:00", "us")))
    done = update(tmp_path, settings)
    assert done.rows == {"chart_status": 9, "baselines": 0, "alarms": 0, "charts": 8} and done.newest is None
    with open_registry(tmp_path) as con:
        assert con.execute("select distinct reason from chart_status where section_id <> '*'").fetchall() == [
            ("never",)
        ]
        assert con.execute("select distinct state from charts").fetchall() == [("wrong_time",)]
        assert con.execute("select count(*) from worklist").fetchall() == [(0,)]


def test_campaigns_before_the_earliest_accepted_year_are_shown_and_not_used(rows, tmp_path):
    small_registry(tmp_path, rows)
    done = update(tmp_path, TrendSettings(earliest_year=2017))
    with open_registry(tmp_path) as con:
        found = con.execute("select year(measured_at_utc) = 2016, state = 'wrong_time' from charts").fetchall()
    assert all(early == wrong for early, wrong in found) and len(found) == done.rows["charts"]


def test_the_evaluation_of_an_earlier_day_equals_the_update_of_that_day(rows, settings, tmp_path):
    then = pd.Timestamp("2018-01-15 12:00")
    small_registry(tmp_path / "then", rows[rows["measured_at_utc"] <= then])
    small_registry(tmp_path / "now", rows)
    early, look = update(tmp_path / "then", settings), update(tmp_path / "now", settings, as_of=then)
    assert look.digests == early.digests and look.rows == early.rows
    question = "select * from chart_status order by all"
    with open_registry(tmp_path / "then") as a, open_registry(tmp_path / "now") as b:
        assert a.execute(question).fetchall() == b.execute(question).fetchall()


def test_parts_with_few_and_many_sections_give_one_table(settings, tmp_path, monkeypatch):
    monkeypatch.setattr("turnout.trend.update.CELLS_PER_PART", 300)
    small = modes(Fleet(turnouts=1, sections=4, weeks=70, prefix="A"), 5)
    large = modes(Fleet(turnouts=1, sections=140, weeks=2, prefix="B"), 6)
    texts = {k: object for k in ("turnout_id", "section_id", "band", "source")}
    rows = pd.concat([small.astype(texts), large.astype(texts)], ignore_index=True)
    small_registry(tmp_path, rows)
    # and one row per campaign of each whole turnout
    assert update(tmp_path, settings).rows["charts"] == len(rows) + 70 + 2
