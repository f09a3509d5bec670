"""Tables with a first column that has no name, as R and pandas write the numbers of their rows."""

from datetime import datetime

import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
SAMPLES = np.random.default_rng(17).normal(size=(200, 2)).round(4) * [900.0, 40.0]
TIME = np.arange(200) / RATE
COUNT = np.arange(1, 201)
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
FORMATS = [("{:.0f}", COUNT), ("{:.5f}", TIME), ("{:.3f}", TIME * 1e3)]


def outcome(folder, head, columns, separator, rate=RATE):
    """Samples of the record, or the error."""
    rows = [separator.join(f.format(x) for (f, _), x in zip(columns, row)) for row in zip(*(c for _, c in columns))]
    lines = [separator.join(line) for line in head]
    (folder / "a.txt").write_text("\n".join([*lines, *rows, ""]), "utf-8")
    try:
        result = read("a.txt", folder, RawDescription(SENSORS, rate=rate))
    except ReadError as error:
        return error
    return result.errors[0] if result.errors else result.recordings[0].samples.T


SIGNALS = [("{:.4f}", SAMPLES[:, 0]), ("{:.4f}", SAMPLES[:, 1])]


@pytest.mark.parametrize("separator", [";", "\t", ",", " "])
@pytest.mark.parametrize("first", FORMATS)
def test_names_with_units_are_those_of_the_columns_behind_the_first(first, separator, tmp_path):
    for head in ([["force[N]", "rail[m/s²]"]], [["force", "rail"], ["N", "m/s²"]]):
        np.testing.assert_allclose(outcome(tmp_path, head, [first, *SIGNALS], separator), SAMPLES)
    if "f" in first[0] and first[0] != "{:.0f}":
        assert outcome(tmp_path, head, [first, *SIGNALS], separator, 25600.0).reason == "wrong_rate"


@pytest.mark.parametrize("separator", [";", "\t", ",", " "])
@pytest.mark.parametrize("count", ["{:.0f}", '"{:.0f}"'])
def test_the_numbers_of_rows_stand_before_the_time(count, separator, tmp_path):
    columns = [(count, COUNT), ("{:.5f}", TIME), *SIGNALS]
    np.testing.assert_allclose(outcome(tmp_path, [["t", "force", "rail"]], columns, separator), SAMPLES)
    assert outcome(tmp_path, [["t", "force", "rail"]], columns, separator, 25600.0).reason == "wrong_rate"
    np.testing.assert_allclose(
        outcome(tmp_path, [['"force"', '"rail"']], [('"{:.0f}"', COUNT), *SIGNALS], separator), SAMPLES
    )


def test_a_line_of_units_may_have_a_unit_for_the_time_alone_or_none(tmp_path):
    columns = [("{:.5f}", TIME), *SIGNALS]
    np.testing.assert_allclose(outcome(tmp_path, [["force", "rail"], ["s", "N", "m/s²"]], columns, ";"), SAMPLES)
    np.testing.assert_allclose(outcome(tmp_path, [["t", "force", "rail"], ["N", "m/s²"]], columns, ";"), SAMPLES)


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ([["Nr", "force"]], [("{:.0f}", COUNT), *SIGNALS]),  # the last column has no name
        ([["t", "force"]], [("{:.5f}", TIME), *SIGNALS]),
        ([["t[s]", "force[N]"]], [("{:.5f}", TIME), *SIGNALS]),
        ([["force[N]", "rail[m/s²]"]], [*SIGNALS, ("{:.0f}", COUNT)]),
        ([["force[N]", "rail[m/s²]"]], [*SIGNALS, ("{:.4f}", SAMPLES[::-1, 0])]),
    ],
)
def test_names_stay_unused_where_another_column_may_have_none(head, columns, tmp_path):
    assert outcome(tmp_path, head, columns, ";").reason == "channel_missing"


def test_times_of_day_need_no_name(tmp_path):
    stamps = [f"2026-05-13 08:30:{12 + t:08.5f}" for t in TIME]
    rows = [f"{stamp};{a:.4f};{b:.4f}" for stamp, (a, b) in zip(stamps, SAMPLES)]
    (tmp_path / "a.txt").write_text("\n".join(["force [N];rail [m/s²]", *rows, ""]), "utf-8")
    (recording,) = read("a.txt", tmp_path, RawDescription(SENSORS, rate=RATE)).recordings
    np.testing.assert_allclose(recording.samples.T, SAMPLES)
    assert recording.started_at == datetime(2026, 5, 13, 8, 30, 12)
    assert read("a.txt", tmp_path, RawDescription(SENSORS, rate=25600.0)).errors[0].reason == "wrong_rate"
