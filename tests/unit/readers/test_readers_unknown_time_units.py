"""Columns that rise evenly in a unit that no list has: they are time axes until a known unit says otherwise."""

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE, N = 25600.0, 600
TIME = np.arange(N) / RATE
FORCE, RAIL = np.random.default_rng(12).normal(size=(2, N)) * [[900.0], [30.0]]
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
MS_UNITS = ("ezredmp", "qwxz", "ms (rel.)", "10^-3 s", "毫秒", "ms since start", "milisekundy", "millisecondi", "mSek")


def write_file(path, name, unit, axis):
    columns = {name: (axis, unit), "force": (FORCE, "N"), "rail": (RAIL, "m/s²")}
    if path.suffix == ".csv":
        head = ";".join(f"{n} [{u}]" if u else n for n, (_, u) in columns.items())
        rows = "".join(f"{t:.12g};{f:.6g};{a:.6g}\n" for t, f, a in zip(axis, FORCE, RAIL))
        path.write_text(f"{head}\n{rows}", encoding="utf-8")
    elif path.suffix == ".tdms":
        with nptdms.TdmsWriter(str(path)) as writer:
            channels = [nptdms.ChannelObject("g", n, x, {"unit_string": u}) for n, (x, u) in columns.items()]
            writer.write_segment(channels)
    elif path.suffix == ".parquet":
        fields = [pa.field(n, pa.float64(), metadata={"unit": u}) for n, (_, u) in columns.items()]
        pq.write_table(pa.table([x for x, _ in columns.values()], schema=pa.schema(fields)), path)
    else:
        with h5py.File(path, "w") as file:
            for n, (x, u) in columns.items():
                file[n] = x
                file[n].attrs["units"] = u


def outcome(path, name, unit, axis, rate, layout_unit=None):
    """Rates of the recordings, reason of each error, all messages."""
    write_file(path, name, unit, axis)
    channels = (*SENSORS, RawChannel("t", name, "ignored", unit=layout_unit))
    result = read(path.name, path.parent, RawDescription(channels, rate=rate))
    return [r.rate for r in result.recordings], [e.reason for e in result.errors], " ".join(map(str, result.errors))


@pytest.mark.parametrize("format", ["csv", "tdms", "parquet", "h5"])
@pytest.mark.parametrize("name", ["Čas", "qwx", "x"])
@pytest.mark.parametrize("unit", MS_UNITS)
def test_a_rate_that_an_axis_in_an_unknown_unit_contradicts_is_an_error(format, name, unit, tmp_path):
    path = tmp_path / f"a.{format}"
    assert outcome(path, name, unit, 1e3 * TIME, 20000.0)[:2] == ([], ["wrong_rate"])
    assert outcome(path, name, unit, 1e3 * TIME, RATE)[:2] == ([RATE], [])


@pytest.mark.parametrize("scale, unit", [(1.0, "qwxz"), (1e6, "qwxz"), (1e9, "qwxz"), (1.0 / 60.0, "qwxz")])
def test_any_scale_of_time_may_be_that_of_an_unknown_unit(scale, unit, tmp_path):
    assert outcome(tmp_path / "a.csv", "qwx", unit, scale * TIME, RATE)[:2] == ([RATE], [])
    assert outcome(tmp_path / "a.csv", "qwx", unit, scale * TIME, 12800.0)[1] == ["wrong_rate"]


@pytest.mark.parametrize("unit", ["m", "km", "°C", "V", "%", "rad", "Hz"])
def test_a_known_unit_of_another_quantity_is_none_of_time(unit, tmp_path):
    assert outcome(tmp_path / "a.csv", "qwx", unit, 1e3 * TIME, 20000.0)[:2] == ([20000.0], [])


def test_a_unit_of_the_layout_says_that_a_column_is_no_time(tmp_path):
    rates, _, message = outcome(tmp_path / "a.csv", "qwx", "qwxz", 1e3 * TIME, 20000.0)
    assert not rates and "column 'qwx' in the unknown unit 'qwxz', which rises evenly" in message
    assert outcome(tmp_path / "a.csv", "qwx", "qwxz", 1e3 * TIME, 20000.0, layout_unit="m")[0] == [20000.0]


@pytest.mark.parametrize("unit", ["qwxz", "ms (rel.)", ""])
@pytest.mark.parametrize("n_gap", [1, 2, 5])
def test_a_gap_in_an_axis_of_an_unknown_unit_is_an_error(n_gap, unit, tmp_path):
    axis = 1e3 * (TIME + np.searchsorted(100 * np.arange(1, n_gap + 1), np.arange(N), side="right") * 17 / RATE)
    assert outcome(tmp_path / "a.csv", "qwx", unit, axis, RATE)[:2] == ([], ["truncated"])


@pytest.mark.parametrize(
    "unit", ["milisekundy", "milisegundos", "millisecondi", "millisegundos", "msecs", "mSek", "milissegundos"]
)
def test_milliseconds_of_further_languages_give_the_rate(unit, tmp_path):
    write_file(tmp_path / "a.csv", "Čas", unit, 1e3 * TIME)
    assert [r.rate for r in read("a.csv", tmp_path, RawDescription(SENSORS)).recordings] == [RATE]
