"""Exports of acquisition programs in which the form of the numbers says what they are.

Times among channels, rows that are no samples, statements in cells, durations, triggers, records in another order.
"""

from datetime import UTC, datetime, timedelta

import h5py
import nptdms
import numpy as np
import pandas as pd
import pytest
import scipy.io

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 25600.0
N = 400
TIME = np.arange(N) / RATE
SAMPLES = np.random.default_rng(20261129).normal(size=(2, N)) * [[900.0], [30.0]]
FORCE, RAIL = SAMPLES
START = datetime(2026, 5, 13, 8, 30, 12, 250_000)


def outcome(path, rate=RATE, sources=("force", "rail"), units=(None, None), **fields):
    """Samples, sampling rates and start times of the recordings, and all messages."""
    quantities = ("force", "acceleration")
    channels = tuple(map(RawChannel, ("force", "rail"), sources, quantities, units))
    try:
        result = read(path.name, path.parent, RawDescription(channels, rate=rate, **fields))
    except ReadError as error:
        return [], [str(error)]
    return list(result.recordings), [str(error) for error in result.errors]


def is_read(recordings, rtol=1e-3):
    (recording,) = recordings
    np.testing.assert_allclose(recording.samples, SAMPLES, atol=rtol * 30.0)
    return abs(recording.rate / RATE - 1.0) < 1e-5


def text(path, head, columns, form="{:.4f}", separator=";", tail=""):
    rows = [separator.join(x if isinstance(x, str) else form.format(x) for x in row) for row in zip(*columns)]
    path.write_text(head + "\n".join(rows) + "\n" + tail, encoding="utf-8")
    return path


@pytest.fixture
def units():
    return ("N", "m/s²")


@pytest.mark.parametrize("is_transposed", [False, True])
def test_pairs_of_time_and_value_are_no_two_records(is_transposed, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["rate"] = RATE
        for name, unit, x in (("force", "N", FORCE), ("rail", "m/s²", RAIL)):
            pairs = np.column_stack([TIME, x])
            file.create_dataset(name, data=pairs.T if is_transposed else pairs).attrs["unit"] = unit
    recordings, errors = outcome(tmp_path / "a.h5")
    assert is_read(recordings) and recordings[0].record == 1
    assert ["record 1 of 2, channel 'force': its samples rise in equal steps" in e for e in errors] == [True]


@pytest.mark.parametrize("first", [TIME, 1.7786e9 + TIME, np.arange(N), np.arange(1, N + 1) * 39.0625])
def test_a_time_or_a_count_is_no_channel_of_a_sensor(first, units, tmp_path):
    np.savez(tmp_path / "a.npz", force=first, rail=RAIL, fs=RATE)
    recordings, errors = outcome(tmp_path / "a.npz", units=units)
    assert not recordings and "channel 'force': its samples rise in equal steps: they are times" in errors[0]


@pytest.mark.parametrize("slow", [np.cumsum(np.abs(RAIL)), np.linspace(0.0, 1.0, N) ** 2, np.linspace(0, 1, N)[::-1]])
def test_a_signal_that_rises_or_falls_is_a_signal(slow, units, tmp_path):
    np.savez(tmp_path / "a.npz", force=FORCE, rail=slow, fs=RATE)
    recordings, errors = outcome(tmp_path / "a.npz", units=units)
    assert len(recordings) == 1 and not errors


def test_a_table_in_another_order_than_its_index_is_rejected(units, tmp_path):
    order = np.random.default_rng(3).permutation(N)
    table = pd.DataFrame({"force": FORCE, "rail": RAIL})
    table.iloc[order].to_parquet(tmp_path / "a.parquet")
    recordings, errors = outcome(tmp_path / "a.parquet", units=units)
    assert not recordings and "not in the order in which column '__index_level_0__' counts them" in errors[0]
    pd.concat([table[:200], table[:200] + 0.5]).to_parquet(tmp_path / "a.parquet")  # an index that begins again
    recordings, errors = outcome(tmp_path / "a.parquet", units=units)
    assert not recordings and "'__index_level_0__' begins again once, each 200 rows" in errors[0]


ROWS = {
    "from one": "1;2", "ranges": "20000;2000", "sensitivities": "2.3;10.2",
    "rate": "25600;25600", "step": "0.0000390625;0.0000390625", "serial numbers": "21054;21877",
    "count and step": "400;3.90625e-05",
}  # fmt: skip


@pytest.mark.parametrize("head", ["", "force;rail\n"])
@pytest.mark.parametrize("row", ROWS)
def test_a_first_row_that_is_written_otherwise_is_no_sample(row, head, units, tmp_path):
    path = text(tmp_path / "a.csv", f"{head}{ROWS[row]}\n", SAMPLES)
    recordings, errors = outcome(path, sources=("force", "rail") if head else (0, 1), units=units)
    line = 2 if head else 1
    assert not recordings and f"line {line}: its numbers have other decimals than those of the other rows" in errors[0]


@pytest.mark.parametrize("row", ["0;1", "0.0;1.0", "20;0"])
def test_a_first_row_with_a_zero_is_read_with_a_remark(row, units, tmp_path):
    """Numbers of columns by pandas, or a computed sine and cosine."""
    (recording,), (error,) = outcome(text(tmp_path / "a.csv", f"force;rail\n{row}\n", SAMPLES), units=units)
    assert recording.samples.shape == (2, N + 1) and "line 2: its numbers have other decimals" in error


@pytest.mark.parametrize("n_extra", [1, 2])
def test_a_last_row_with_the_means_of_a_spreadsheet_is_no_sample(n_extra, units, tmp_path):
    means = "".join(f"{FORCE.mean():.12f};{RAIL.mean():.12f}\n" for _ in range(n_extra))
    recordings, errors = outcome(text(tmp_path / "a.csv", "force;rail\n", SAMPLES, tail=means), units=units)
    assert not recordings and f"line {N + 1 + n_extra}: its numbers have other decimals" in errors[0]


@pytest.mark.parametrize("first", ["0;0", "0.0;0.0", "0,0;0,0"])
def test_a_first_row_of_zeros_is_a_sample(first, units, tmp_path):
    path = text(tmp_path / "a.csv", f"force;rail\n{first.replace(',', '.')}\n", SAMPLES)
    (recording,), errors = outcome(path, units=units)
    assert recording.samples.shape == (2, N + 1) and not errors


def test_a_first_row_of_whole_numbers_is_none_of_numbers_in_full_length(units, tmp_path):
    path = text(tmp_path / "a.csv", "force;rail\n20000;2000\n", SAMPLES, form="{}")
    assert "line 2: its numbers have other decimals" in outcome(path, units=units)[1][0]


def test_numbers_of_varying_length_have_no_first_row_of_another_kind(units, tmp_path):
    path = text(tmp_path / "a.csv", "force;rail\n0.25;1.5\n", np.round(SAMPLES, 3), form="{}")
    (recording,), errors = outcome(path, units=units)
    assert recording.samples.shape == (2, N + 1) and not errors


@pytest.mark.parametrize(
    "line",
    [
        "dx=3.90625E-5 s;dx=3.90625E-5 s",
        "dx [ms]: 0.0390625;dx [ms]: 0.0390625",
        "Bandwidth: 10 kHz;Sample rate: 25.6 kHz",
        "Kanal=1, fs=25600 Hz;Kanal=2, fs=25600 Hz",
    ],
)
def test_a_cell_that_is_a_statement_is_read_by_itself(line, units, tmp_path):
    """A comma or a semicolon within it separates its parts if tabs separate the cells."""
    path = text(
        tmp_path / "a.csv", f"{line}\nforce;rail\n".replace(";", "\t").replace(",", ";"), SAMPLES, separator="\t"
    )
    recordings, errors = outcome(path, units=units)
    assert is_read(recordings) and not errors
    recordings, errors = outcome(path, rate=RATE / 2, units=units)
    assert not recordings and "25600 Hz" in errors[0]


def test_a_statement_for_each_column_but_that_of_the_time(tmp_path):
    head = ";fs=25600 Hz;fs=25600 Hz\nt [s];force [N];rail [m/s²]\n"
    path = text(tmp_path / "a.csv", head, [[f"{t:.7f}" for t in TIME], *SAMPLES])
    recordings, errors = outcome(path)
    assert is_read(recordings) and not errors


def test_different_steps_in_the_cells_of_a_line_are_an_error(units, tmp_path):
    path = text(tmp_path / "a.csv", "dx=3.90625E-5 s;dx=1.5625E-4 s\nforce;rail\n", SAMPLES)
    recordings, errors = outcome(path, units=units)
    assert not recordings and "dx" in errors[0]


@pytest.mark.parametrize("line", ["Scaled by 1/1000", "Slope 0.5 Intercept 3", "Rescaled with 0.01"])
def test_a_scale_in_a_sentence_is_reported(line, units, tmp_path):
    recordings, errors = outcome(text(tmp_path / "a.csv", f"{line}\nforce;rail\n", SAMPLES), units=units)
    assert not recordings and f"'text: {line}' in line 1 may state a scale" in errors[0]


@pytest.mark.parametrize(
    ("line", "is_reported"),
    [
        ("Duration: 10 s", True), ("Messdauer [s];10", True), ("Total recording time: 2 min", True),
        ("Record length 0.03 s, 400 points", True), ("Duration: 0.015625 s", False), ("Averaging time: 10 s", False),
        ("Trigger duration: 3 s", False), ("Time: 10 s", False),
    ],
)  # fmt: skip
def test_a_duration_of_the_recording_is_compared_with_its_samples(line, is_reported, units, tmp_path):
    path = text(tmp_path / "a.csv", f"{line}\nSampling rate: 25600 Hz\nforce;rail\n", SAMPLES)
    recordings, errors = outcome(path, units=units)
    assert is_read(recordings) and ["may state a duration" in e for e in errors] == [True] * is_reported


@pytest.mark.parametrize(("name", "offset"), [("Trigger", -10.0), ("Trigger time", -10.0), ("Start time", 0.0)])
def test_the_time_of_a_trigger_is_that_of_zero_on_the_time_axis(name, offset, tmp_path):
    head = f"{name}: 2026-05-13 08:30:12.250\nTime [s];force [N];rail [m/s²]\n"
    path = text(tmp_path / "a.csv", head, [[f"{t:.7f}" for t in TIME - 0.01], *SAMPLES])
    (recording,), _ = outcome(path)
    assert recording.started_at == START + timedelta(milliseconds=offset)


@pytest.mark.parametrize("code", ["32767", "-32767", "8388607"])
def test_the_highest_code_of_a_converter_among_physical_numbers_is_no_sample(code, units, tmp_path):
    cells = [f"{x:.4f}" for x in RAIL]
    cells[100:102] = [code, code]
    recordings, errors = outcome(text(tmp_path / "a.csv", "force;rail\n", [FORCE, cells]), units=units)
    assert not recordings and f"2 of 400 samples are {code}, a usual code" in errors[0]


@pytest.mark.parametrize("line", ["*** END OF FILE ***", "---- end of data ----", "// closed"])
def test_a_closing_line_may_begin_with_marks(line, units, tmp_path):
    recordings, errors = outcome(text(tmp_path / "a.csv", "force;rail\n", SAMPLES, tail=f"{line}\n"), units=units)
    assert is_read(recordings) and not errors


@pytest.mark.parametrize("row", ["* 5;7", "-nan;-nan", "***;***"])
def test_a_row_with_numbers_or_codes_is_no_closing_line(row, units, tmp_path):
    recordings, errors = outcome(text(tmp_path / "a.csv", "force;rail\n", SAMPLES, tail=f"{row}\n"), units=units)
    assert not recordings and errors


@pytest.mark.parametrize("kind", ["datetime64", "float"])
def test_a_table_of_pandas_in_hdf5_has_its_names_and_its_times(kind, units, tmp_path):
    nanoseconds = int(START.replace(tzinfo=UTC).timestamp() * 1e9) + np.round(TIME * 1e9).astype("int64")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        group = file.create_group("df")
        for name in ("axis0", "block0_items"):
            group[name] = np.array([b"force", b"rail"])
        group["axis1"] = nanoseconds if kind == "datetime64" else TIME
        group["block0_values"] = SAMPLES.T
    recordings, errors = outcome(tmp_path / "a.h5", units=units)
    assert is_read(recordings) and not errors
    recordings, errors = outcome(tmp_path / "a.h5", rate=RATE / 2, units=units)
    assert not recordings and "instead of 12800 Hz" in errors[0]


@pytest.mark.parametrize(("name", "is_error"), [("position_m", False), ("temperature", False), ("axis", True)])
def test_a_vector_beside_a_matrix_is_its_time_unless_its_name_is_of_something_else(name, is_error, units, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["rate"] = RATE
        file["channel_names"] = np.array([b"force", b"rail"])
        file["values"] = SAMPLES.T
        file[name] = 25.0 * TIME
    recordings, errors = outcome(tmp_path / "a.h5", units=units)
    assert (not recordings and "two rates" in errors[0]) if is_error else is_read(recordings)


def test_times_since_a_moment_with_a_fraction_state_the_start(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("time", data=TIME).attrs["units"] = "seconds since 2026-05-13 08:30:12.250"
        for name, unit, x in (("force", "N", FORCE), ("rail", "m/s²", RAIL)):
            file.create_dataset(name, data=x).attrs["units"] = unit
    recordings, errors = outcome(tmp_path / "a.h5")
    assert is_read(recordings) and recordings[0].started_at == START and not errors


@pytest.mark.parametrize(("step", "is_error"), [(1 / RATE, False), (2 / RATE, True)])
def test_a_time_channel_of_tdms_needs_no_step_and_is_compared(step, is_error, tmp_path):
    with nptdms.TdmsWriter(str(tmp_path / "a.tdms")) as writer:
        axis = {"wf_increment": 1 / RATE, "wf_start_offset": -0.001}
        channels = [("Time", np.arange(N) * step, {"unit_string": "s"})]
        channels += [
            ("force", FORCE, {**axis, "NI_UnitDescription": "N"}),
            ("rail", RAIL, {**axis, "unit_string": "m/s²"}),
        ]
        writer.write_segment([nptdms.ChannelObject("hit", *channel) for channel in channels])
    recordings, errors = outcome(tmp_path / "a.tdms")
    assert (not recordings and "two rates" in errors[0]) if is_error else (is_read(recordings) and not errors)


def test_a_channel_of_a_lower_rate_is_named_with_its_length(units, tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"force": FORCE, "rail": RAIL[::4], "fs": RATE})
    recordings, errors = outcome(tmp_path / "a.mat", units=units)
    assert not recordings and "the channel 'rail' holds 100 samples, and another channel 400" in errors[0]


def test_channels_in_rows_are_named_as_such(tmp_path):
    lines = [("Time [s]", TIME), ("force [N]", FORCE), ("rail [m/s²]", RAIL)]
    text_of_rows = "".join(f"{name};{';'.join(f'{x:.5f}' for x in row)}\n" for name, row in lines)
    (tmp_path / "a.csv").write_text(text_of_rows, encoding="utf-8")
    recordings, errors = outcome(tmp_path / "a.csv")
    assert not recordings and "'rail [m/s²]', and 400 numbers follow: channels are rows. Transpose" in errors[0]


@pytest.mark.parametrize(
    ("head", "names"),
    [
        ("Частота дискретизации: 25,6 кГц\n", "force [N];rail [m/s²]"),
        ("fs: 25600 Hz\n", "force [N];rail [m/(s^2)]"),
    ],
)
def test_further_notations_of_units(head, names, tmp_path):
    path = text(tmp_path / "a.csv", f"{head}{names}\n", SAMPLES)
    recordings, errors = outcome(path)
    assert is_read(recordings) and not errors
    assert not outcome(path, rate=RATE / 2)[0]


@pytest.mark.parametrize("name", ["physical_max", "digital_maximum", "PhysMin"])
def test_limits_of_whole_numbers_may_convert_them(name, units, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["rate"] = RATE
        for channel, x in (("force", FORCE), ("rail", RAIL)):
            file.create_dataset(channel, data=np.rint(100 * x).astype("int32")).attrs[name] = 327.5
    recordings, errors = outcome(tmp_path / "a.h5", units=units)
    assert len(recordings) == 1 and f"'{name}: 327.5' may convert them" in errors[0]
