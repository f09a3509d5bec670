"""Parquet tables with a row for each record, in which a cell holds all samples of a channel."""

from datetime import datetime

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
LENGTHS = (300, 300, 220)
RECORDS = [np.random.default_rng(n + k).normal(size=(2, n)) * [[900.0], [40.0]] for k, n in enumerate(LENGTHS)]
LISTS = {"force": [list(r[0]) for r in RECORDS], "rail": [list(r[1]) for r in RECORDS]}
STARTS = [np.datetime64("2026-05-13T08:30:12.250") + np.timedelta64(k, "m") for k in range(3)]


def outcome(folder, columns, fs="20000"):
    table = pa.table(columns).replace_schema_metadata({"fs": fs} if fs else {})
    pq.write_table(table, folder / "a.parquet")
    try:
        return read("a.parquet", folder, RawDescription(SENSORS, rate=RATE))
    except ReadError as error:
        return error


@pytest.mark.parametrize("further", [{}, {"impact": [1, 2, 3]}, {"name": ["A7_1", "A7_2", "A7_3"]}, {"fs": [RATE] * 3}])
def test_each_row_is_a_record(further, tmp_path):
    result = outcome(tmp_path, {**further, **LISTS}, None if "fs" in further else "20000")
    assert not result.errors
    for recording, samples in zip(result.recordings, RECORDS, strict=True):
        np.testing.assert_allclose(recording.samples, samples)


def test_the_cells_beside_the_samples_are_those_of_their_record(tmp_path):
    result = outcome(tmp_path, {"start": STARTS, **LISTS})
    assert [r.started_at for r in result.recordings] == [
        datetime(2026, 5, 13, 8, 30 + k, 12, 250_000) for k in range(3)
    ]
    result = outcome(tmp_path, {**LISTS, "dt": [5e-5, 1e-4, 5e-5]}, None)
    assert [r.record for r in result.recordings] == [0, 2] and result.errors[0].reason == "wrong_rate"
    single = {name: pa.array([cells[2]], pa.list_(pa.float32())) for name, cells in LISTS.items()}
    (recording,) = outcome(tmp_path, single).recordings
    np.testing.assert_allclose(recording.samples, RECORDS[2], rtol=1e-6)


def test_channels_of_one_row_must_have_as_many_samples(tmp_path):
    error = outcome(tmp_path, {**LISTS, "rail": [*LISTS["rail"][:2], LISTS["rail"][2][:-1]]})
    assert error.reason == "truncated" and "row 3 has 219 samples in 'rail' and 220 in 'force'" in str(error)
