"""A row with a bad value is rejected, becomes a row of the quarantine, and does not affect any other row."""

import json
import math
from functools import partial

import pyarrow as pa
import pytest
from registry_rows import hammer_result, parquet_hashes

from turnout.errors import RegistryError
from turnout.registry.arrow_types import arrow_schema
from turnout.registry.batch_stream import chunks
from turnout.registry.connection import connect
from turnout.registry.database import open_registry
from turnout.registry.derived_tables import publish
from turnout.registry.job import register
from turnout.registry.registration import Registration
from turnout.registry.schema import create_table, tables
from turnout.workflow.batches import UnitResult

NAN, INF = math.nan, math.inf


def results_as_given(path):
    """Results as the test made them, without the encoding of batches, which turns NaN into NULL."""
    return iter(RAW_RESULTS[path.name])


RAW_RESULTS: dict[str, list[UnitResult]] = {}


@pytest.fixture
def register_raw(tmp_path):
    """Register results that no batch file can contain."""

    def run(*results):
        path = tmp_path / f"raw-{len(RAW_RESULTS)}"
        path.write_text("x" * len(RAW_RESULTS))
        RAW_RESULTS[path.name] = sorted(results, key=lambda r: r.unit)
        return register([path], tmp_path / "registry", read=results_as_given)

    return run


BAD_MODES = [
    ("frequency_hz", NAN, "nan", "between 0.1 and 2000 Hz"),
    ("frequency_hz", INF, "inf", "between 0.1 and 2000 Hz"),
    ("frequency_hz", -INF, "-inf", "between 0.1 and 2000 Hz"),
    ("frequency_hz", None, "missing", "given"),
    ("frequency_hz", 0.0, "0.0", "between 0.1 and 2000 Hz"),
    ("frequency_hz", 2000.5, "2000.5", "between 0.1 and 2000 Hz"),
    ("frequency_hz", "150 Hz", "'150 Hz'", "of type double"),
    ("frequency_hz", True, "True", "of type double"),
    ("frequency_se_hz", NAN, "nan", "between 0 and 2000 Hz"),
    ("frequency_se_hz", -0.1, "-0.1", "between 0 and 2000 Hz"),
    ("damping_ratio", 1.0, "1.0", "between 0.000001 and 0.999"),
    ("rail_temperature_c", 80.1, "80.1", "between -50 and 80 °C"),
    ("rail_temperature_c", NAN, "nan", "between -50 and 80 °C"),
    ("band", "rail", "rail", "one of ballast, railpad"),
    ("n_impacts", -1, "-1", "at least 0"),
    ("n_impacts", 2.5, "2.5", "of type integer"),
    ("measured_at_utc", "yesterday", "'yesterday'", "of type timestamp"),
    ("measured_at_utc", "2026-01-05T10:00:00+02:00", "+02:00'", "of type timestamp"),
    ("turnout_id", 7, "7", "of type varchar"),
    ("frequency_khz", 0.15, "0.15", "a column of columns.csv"),
]


@pytest.fixture(scope="module")
def all_bad_rows(tmp_path_factory):
    """Register every bad row in its own unit, with valid units between: place and message by section."""
    root = tmp_path_factory.mktemp("bad")
    bad = [hammer_result(section=f"B{i:02d}", **{c: v}) for i, (c, v, *_) in enumerate(BAD_MODES)]
    sound = [hammer_result(section=s) for s in ("A1", "B05x", "C1")]
    (root / "raw").write_text("raw")
    RAW_RESULTS["raw"] = sorted([*bad, *sound], key=lambda r: r.unit)
    done = register([root / "raw"], root / "registry", read=results_as_given)
    assert done.n_rejected == len(BAD_MODES)
    with open_registry(root / "registry") as connection:
        rows = connection.execute(
            "select section_id, place, found, stage, reason_code, path from quarantine_open"
        ).fetchall()
        modes = connection.execute("select section_id from modes_current order by 1").fetchall()
        assert connection.execute("select count(*) from models").fetchall() == [(len(BAD_MODES) + 3,)]
    return {row[0]: row[1:] for row in rows}, modes


def test_bad_rows_do_not_affect_valid_rows(all_bad_rows):
    assert all_bad_rows[1] == [("t1/A1",), ("t1/B05x",), ("t1/C1",)]


@pytest.mark.parametrize("i", range(len(BAD_MODES)), ids=[f"{c}={v}" for c, v, *_ in BAD_MODES])
def test_the_rejection_of_a_bad_value_states_its_column_value_and_limits(all_bad_rows, i):
    column, _, bad_value, required = BAD_MODES[i]
    place, found, stage, reason, path = all_bad_rows[0][f"t1/B{i:02d}"]
    assert place == f"modes, row 1, column {column}"
    assert bad_value in found.split(", must be ")[0]
    assert found.split(", must be ")[1].startswith(required)
    assert (stage, reason, path) == ("register", "internal_error", f"t1/hammer/2026-01-05/B{i:02d}_1.uff")


def test_the_quarantine_contains_the_whole_rejected_row(bench, register_raw, hammer):
    register_raw(hammer(frequency=-1.0, damping_se=0.0123))
    found = bench.ask("select found, measured_value from quarantine_open")[0]
    row = json.loads(found[0].split("; row: ")[1])
    assert (row["frequency_hz"], row["damping_se"]) == (-1.0, 0.0123)
    assert found[1] == -1.0


@pytest.mark.parametrize("matrix", [[0.5, NAN], [INF, 0.5], [0.5, None], "0.5 0.5", [["a"]]], ids=str)
def test_a_model_with_one_bad_element_of_a_list_is_rejected_together_with_its_modes(
    bench, register_raw, hammer, matrix
):
    bad = hammer(section="A1")
    bad.tables["models"][0]["a_matrix"] = matrix
    register_raw(bad, hammer(section="A2"))
    assert bench.ask("select section_id from models") == bench.ask("select section_id from modes") == [("t1/A2",)]
    assert bench.ask("select place from quarantine_open") == [("models, row 1, column a_matrix",)]


def test_the_second_row_of_a_key_is_rejected(bench, register_raw, hammer):
    twice = hammer(section="A1")
    twice.tables["modes"].append(dict(twice.tables["modes"][0], frequency_hz=99.0))
    copied = hammer(section="A2")
    copied.tables["models"][0]["model_id"] = copied.tables["modes"][0]["model_id"] = twice.tables["models"][0][
        "model_id"
    ]
    done = register_raw(twice, copied)
    assert done.n_rejected == 2  # the mode of the copied model is rejected with it, without its own row
    assert bench.ask("select section_id, frequency_hz from modes") == [("t1/A1", 150.0)]
    assert bench.ask("select section_id from models") == [("t1/A1",)]
    places = bench.ask("select turnout_id, place from quarantine_open order by place, section_id")
    assert [p for _, p in places] == [
        "models, row 1, column model_id", "modes, row 2, column model_id+band",
    ]  # fmt: skip


def _same_model_twice(hammer):
    first, second = hammer(section="A1"), hammer(section="A2")
    second.tables["models"][0]["model_id"] = second.tables["modes"][0]["model_id"] = first.tables["models"][0][
        "model_id"
    ]
    return first, second


def _row_twice(hammer):
    first, second = hammer(section="A1"), hammer(section="A2")
    first.tables["modes"].append(dict(first.tables["modes"][0]))
    return first, second


def _mode_twice_of_a_bad_model(hammer):
    first, second = _same_model_twice(hammer)
    first.tables["models"][0]["a_matrix"] = [NAN]
    return first, second


@pytest.mark.parametrize("size", [1, 1024])
@pytest.mark.parametrize("make", [_same_model_twice, _row_twice, _mode_twice_of_a_bad_model])
def test_a_check_of_keys_at_the_end_gives_the_same_bytes_as_an_index(tmp_path, monkeypatch, hammer, make, size):
    monkeypatch.setattr("turnout.registry.job.chunks", partial(chunks, size=size))
    (tmp_path / "raw").write_text("")
    RAW_RESULTS["raw"] = list(make(hammer))
    late = register([tmp_path / "raw"], tmp_path / "late", read=results_as_given)
    monkeypatch.setattr("turnout.registry.job.Registration", lambda *a, **_: Registration(*a, is_indexed=True))
    RAW_RESULTS["raw"] = list(make(hammer))
    at_once = register([tmp_path / "raw"], tmp_path / "at_once", read=results_as_given)
    assert late.n_rejected == at_once.n_rejected > 0
    assert parquet_hashes(tmp_path / "late") == parquet_hashes(tmp_path / "at_once")


def test_an_unknown_table_and_a_row_of_a_wrong_type_are_rejected(bench, register_raw, hammer):
    strange = hammer(section="A1")
    strange.tables["weather"] = [{"rain": 1}]
    strange.tables["impacts"] = ["not a row"]
    register_raw(strange)
    assert bench.ask("select place from quarantine_open order by 1") == [
        ("impacts, row 1, column all",),
        ("weather, row 1, column any",),
    ]
    assert bench.ask("select count(*) from modes") == [(1,)]


def test_a_faulty_row_of_the_quarantine_becomes_a_valid_one(bench, register_raw, quarantined):
    wrong = quarantined()
    wrong.tables["quarantine"][0] |= {"kind": "telegram", "path": None, "measured_value": NAN}
    register_raw(wrong)
    rows = bench.ask("select reason_code, stage, place from quarantine_open")
    assert rows == [("internal_error", "register", "quarantine, row 1, column kind")]


def test_a_rejected_row_is_no_longer_in_quarantine_when_the_code_is_fixed(bench, register_raw, hammer):
    register_raw(hammer(frequency=NAN, algo="1"))
    register_raw(hammer(frequency=150.0, algo="2"))
    assert bench.ask("select count(*) from quarantine_open") == [(0,)]
    assert bench.ask("select frequency_hz from modes_current") == [(150.0,)]


def test_a_truncated_batch_does_not_affect_the_others(bench, hammer):
    sound = bench.batch(hammer(section="A1"))
    broken = bench.batch(hammer(section="A2"))
    whole = broken.read_bytes()
    broken.write_bytes(whole[: len(whole) // 2])
    done = bench.register()
    assert list(done.faults) == [str(broken)] and sound.exists()
    assert bench.ask("select section_id from modes_current") == [("t1/A1",)]
    broken.write_bytes(whole)
    assert bench.register().faults == {}
    assert bench.ask("select count(*) from modes_current") == [(2,)]


def test_a_missing_batch_does_not_affect_the_others(bench, hammer):
    gone = bench.batch(hammer(section="A1"))
    bench.batch(hammer(section="A2"))
    gone.unlink()
    done = bench.register()
    assert list(done.faults) == [str(gone)] and "No such file" in done.faults[str(gone)]
    assert bench.ask("select section_id from modes_current") == [("t1/A2",)]


def test_every_column_of_type_double_rejects_nan_and_infinity():
    connection, tried = connect(), 0
    for table, columns in tables().items():
        connection.execute(create_table(table, f"t_{table}").replace("not null", "").split(", primary key")[0] + ")")
        for column in columns:
            if column.type.removesuffix("[]") not in ("double", "float"):
                continue
            for bad in ("'nan'", "'inf'", "'-inf'"):
                value = f"[1.0, {bad}::double]" if column.is_list else f"{bad}::double"
                with pytest.raises(Exception, match="CHECK constraint"):
                    connection.execute(f'insert into t_{table} ("{column.name}") values ({value})')
                tried += 1
    assert tried > 200


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ({"state": ["ok", "fine"]}, "column state: fine, must be one of ok, baseline"),
        ({"epoch": [0, None]}, "column epoch: None, must be given"),
        ({"z": [0.0, INF]}, "column z: inf, must be"),
        ({"zz": [0.0, 1.0]}, "column zz: columns.csv does not know it"),
    ],
)
def test_a_derived_table_with_a_bad_row_is_rejected_completely(tmp_path, rows, message):
    days = pa.array(["2026-01-01", "2026-01-08"]).cast(pa.timestamp("us"))
    good = {
        "turnout_id": ["t1"] * 2, "section_id": ["t1/A1"] * 2, "band": ["ballast"] * 2, "source": ["hammer"] * 2,
        "measured_at_utc": days, "epoch": [0, 0], "state": ["ok", "ok"], "z": [0.5, NAN], "is_sibling": [True, True],
    }  # fmt: skip
    assert publish(tmp_path / "registry", {"charts": pa.table(good)}).number == 1
    with pytest.raises(RegistryError, match=message) as caught:
        publish(tmp_path / "registry", {"charts": pa.table(good | rows)})
    assert "2026-01-08" in str(caught.value) or "zz" in str(caught.value)
    assert publish(tmp_path / "registry", {"charts": pa.table(good)}).number == 1
    assert arrow_schema("charts").field("measured_at_utc").type == days.type


@pytest.mark.parametrize("size", [1, 1024])
def test_of_two_passages_with_one_id_one_is_registered_and_the_other_is_in_quarantine(bench, monkeypatch, size):
    """In the same chunk of units or in another: the second is rejected, and all other rows are registered."""
    monkeypatch.setattr("turnout.registry.job.chunks", partial(chunks, size=size))
    passage = {"turnout_id": "t1", "passage_id": "p", "recording_id": "r", "passed_at_utc": "2026-01-05T10:00:00"}
    passage |= {"status": "accepted", "n_axles": 8, "track": "main", "axle_load_source": "unavailable"}
    fit = {"passage_id": "p", "section_id": "t1/A1", "channel": "A1", "model_id": "m", "turnout_id": "t1"}
    fit |= {"passed_at_utc": "2026-01-05T10:00:00", "status": "accepted", "n_wheels": 8}
    units = [
        UnitResult(f"t1/passage/{name}.h5", "t1", "passage", name, "1", "ok",
                   {"passages": [dict(passage)], "passage_fits": [dict(fit)]})
        for name in ("20260105T100000Z", "20260105T100001Z")
    ]  # fmt: skip
    done = bench.register(*units)
    assert done.n_rejected == 1 and bench.ask("select count(*) from passages") == [(1,)]
    assert bench.ask("select count(*) from passage_fits") == [(1,)]
    message = bench.ask("select reason_code, place, remedy from quarantine_open")
    assert [(code, place) for code, place, _ in message] == [("internal_error", "passages, row 1, column passage_id")]
    assert "fault of the stage" in message[0][2]
