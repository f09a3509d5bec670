"""Columns that rise or fall evenly beside a time axis: it proves the order of the samples, and the others are none."""

import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from turnout.readers import read
from turnout.readers.time_axes import is_unit_of_no_time
from turnout.records import RawChannel, RawDescription

RATE, N = 25600.0, 1500
INDEX = np.arange(N)
FORCE, RAIL = np.random.default_rng(12).normal(size=(2, N)) * [[900.0], [30.0]]
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
UNITS = [
    *("ft in mi mph km/t rev U Nm W kWh °/s gon ‰ MPa psi yd kA lbf mV/V rad/s".split()),
    *("pulses ticks frames qwxz".split()),
]


def outcome(path, columns, rate=RATE, checked=(), step=None):
    """Number of recordings and reasons of the errors; ``columns`` maps "name [unit]" to numbers."""
    columns = columns | {"force [N]": FORCE, "rail [m/s²]": RAIL}
    split = {n: (n.partition(" [")[0], n.partition(" [")[2].rstrip("]")) for n in columns}
    if path.suffix == ".csv":
        rows = "".join(";".join(f"{x:.12g}" for x in row) + "\n" for row in zip(*columns.values()))
        path.write_text(";".join(columns) + "\n" + rows, encoding="utf-8")
    elif path.suffix == ".parquet":
        fields = [pa.field(n, pa.float64(), metadata={"unit": u}) for n, u in split.values()]
        arrays = [np.asarray(x, dtype=float) for x in columns.values()]
        pq.write_table(pa.table(arrays, schema=pa.schema(fields)), path)
    else:
        waveform = {} if step is None else {"wf_increment": step}
        with nptdms.TdmsWriter(str(path)) as writer:
            channels = [(*split[n], np.asarray(x, dtype=float)) for n, x in columns.items()]
            writer.write_segment(
                [nptdms.ChannelObject("g", n, x, {"unit_string": u, **waveform}) for n, u, x in channels]
            )
    ignored = [
        RawChannel(f"x{i}", n, "ignored") for i, (n, _) in enumerate(split.values()) if n not in ("force", "rail")
    ]
    result = read(path.name, path.parent, RawDescription((*SENSORS, *ignored), rate=rate, checked_entries=checked))
    return len(result.recordings), [e.reason for e in result.errors]


@pytest.mark.parametrize("format", ["csv", "parquet"])
@pytest.mark.parametrize("rate", [RATE, None])
@pytest.mark.parametrize("slope", [1e-3, -1e-3])
@pytest.mark.parametrize("unit", UNITS)
def test_a_column_in_any_unit_beside_a_time_column_is_no_axis(unit, slope, rate, format, tmp_path):
    columns = {"time [s]": INDEX / RATE, f"x [{unit}]": 80.0 + slope * INDEX}
    assert outcome(tmp_path / f"a.{format}", columns, rate) == (1, [])


@pytest.mark.parametrize(
    "name",
    ["Km", "Speed", "Temp", "Ramp", "Dist [ft]", "Mileage [mi]", "Speed [kph]", "Remaining", "Chainage", "Lon [°]"],
)
@pytest.mark.parametrize("slope", [1e-3, -1e-3, -1.0])
@pytest.mark.parametrize("axis", ["time [s]", "time [ms]", "Time"])
def test_a_column_without_a_unit_beside_a_time_column_is_no_axis(name, slope, axis, tmp_path):
    columns = {axis: INDEX / RATE * (1e3 if "ms" in axis else 1.0), name: 2000.0 + slope * INDEX}
    assert outcome(tmp_path / "a.csv", columns) == (1, [])


@pytest.mark.parametrize("column", [80.0 - 1e-3 * INDEX, 3e-3 * INDEX, N - INDEX])
def test_the_step_of_a_waveform_and_a_time_column_prove_the_order_of_the_samples(column, tmp_path):
    assert outcome(tmp_path / "a.tdms", {"qwx": column}, step=1 / RATE) == (1, [])
    assert outcome(tmp_path / "a.csv", {"time [s]": INDEX / RATE, "qwx": column}) == (1, [])


@pytest.mark.parametrize("unit", ["", "qwxz"])
@pytest.mark.parametrize(("slope", "reason"), [(-1.0, "clock_backwards"), (3e-3, "wrong_rate")])
def test_without_a_time_axis_a_column_in_an_unknown_unit_is_an_error_unless_it_is_checked(
    unit, slope, reason, tmp_path
):
    name = f"qwx [{unit}]" if unit else "qwx"
    columns = {name: 2000.0 + slope * INDEX}
    assert outcome(tmp_path / "a.csv", columns) == (0, [reason])
    assert outcome(tmp_path / "a.csv", columns, checked=("QWX",)) == (1, [])


def test_a_time_axis_of_another_rate_proves_nothing(tmp_path):
    columns = {"time [s]": INDEX / 20000.0, "qwx": 3e-3 * INDEX}
    assert outcome(tmp_path / "a.csv", columns) == (0, ["wrong_rate"])
    assert outcome(tmp_path / "a.tdms", {"qwx": 3e-3 * INDEX}, step=1 / 20000.0) == (0, ["wrong_rate"])


def test_a_gap_or_a_disorder_is_found_beside_a_time_axis(tmp_path):
    time = {"time [s]": INDEX / RATE}
    assert outcome(tmp_path / "a.csv", time | {"n": INDEX + 7 * (INDEX > 700)}) == (0, ["truncated"])
    assert outcome(tmp_path / "a.csv", time | {"n": np.roll(INDEX, 700)}) == (0, ["clock_backwards"])


@pytest.mark.parametrize("unit", ["s", "ms", "min", "h", "samples", "ticks", "frames", "Zeit", "t", "d"])
def test_no_word_of_time_is_a_unit_of_another_quantity(unit):
    assert not is_unit_of_no_time(unit)
