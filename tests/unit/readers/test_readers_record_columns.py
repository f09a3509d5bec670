"""Columns that number the records of a table: their names, their blocks, and numbers that are missing."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

N = 30
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
NAMES = ("record", "Record", "impact", "Impact No", "hit", "rec_nr", "segment", "Schlag")


def outcome(folder, format, name, numbers, lengths=None):
    """Numbers of samples of the records, and the problems."""
    number = np.repeat(numbers, lengths or [N] * len(numbers))
    force, rail = np.random.default_rng(3).normal(size=(2, len(number))) * [[900.0], [30.0]]
    if format == "csv":
        rows = "\n".join(f"{f:.9g};{a:.9g};{k:g}" for f, a, k in zip(force, rail, number))
        (folder / "a.csv").write_text(f"force;rail;{name}\n{rows}\n", encoding="utf-8")
    else:
        pq.write_table(pa.table({"force": force, "rail": rail, name: number}), folder / "a.parquet")
    result = read(f"a.{format}", folder, RawDescription(SENSORS, rate=2e4))
    return [r.n_sample for r in result.recordings], [(e.where, e.reason) for e in result.errors]


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize("name", NAMES)
def test_a_missing_number_is_reported_and_the_other_impacts_are_read(format, name, tmp_path):
    assert outcome(tmp_path, format, name, (1, 2, 4, 5)) == ([N] * 4, [("record 3 of 5", "truncated")])
    lost = [("record 2 of 6", "truncated"), ("record 3 of 6", "truncated")]
    assert outcome(tmp_path, format, name, (7, 10, 11, 12)) == ([N] * 4, lost)


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize("numbers", [(0, 1, 2), (4, 5, 6), (10, 20, 30), (1, 3, 5, 7), (3, 2, 1), (101, 214, 388)])
def test_numbers_of_another_counter_are_no_missing_records(format, numbers, tmp_path):
    assert outcome(tmp_path, format, "record", numbers) == ([N] * len(numbers), [])


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize(
    "numbers, lengths", [((0, 1), (7, 53)), ((1, 2, 3), (9, 11, 7)), ((5,), (40,)), ((1, 0), (9, 9))]
)
def test_a_flag_of_the_contact_does_not_cut_a_record(format, numbers, lengths, tmp_path):
    assert outcome(tmp_path, format, "hit", numbers, lengths) == ([], [("record 1 of 1", "channel_unknown")])
