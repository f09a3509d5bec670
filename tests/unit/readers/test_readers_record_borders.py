"""Columns that number records under any name, in blocks or by a counter that begins again, and columns that do not."""

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 25600.0
SENSORS = (
    RawChannel("force", "force", "force", unit="N"),
    RawChannel("rail", "rail", "acceleration", unit="m/s²"),
)
LENGTHS = (600, 580, 590)
N = sum(LENGTHS)
FORCE, RAIL = np.random.default_rng(11).normal(size=(2, N)) * [[900.0], [30.0]]


def write_file(path, name, column, unit=""):
    columns = {"force": FORCE[: len(column)], "rail": RAIL[: len(column)], name: column}
    format = path.suffix[1:]
    if format == "csv":
        head = ";".join(f"{n} [{unit}]" if n == name and unit else n for n in columns)
        rows = "".join(f"{f:.6g};{a:.6g};{x:.9g}\n" for f, a, x in zip(*columns.values()))
        path.write_text(f"{head}\n{rows}", encoding="utf-8")
    elif format == "parquet":
        pq.write_table(pa.table(columns), path)
    elif format == "npz":
        np.savez(path, **columns)
    elif format == "mat":
        scipy.io.savemat(path, columns)
    elif format == "h5":
        with h5py.File(path, "w") as file:
            for n, x in columns.items():
                file[n] = x
    else:
        with nptdms.TdmsWriter(str(path)) as writer:
            writer.write_segment([nptdms.ChannelObject("g", n, x) for n, x in columns.items()])


def outcome(path, name, column, unit="", layout_unit=None, checked=()):
    """Numbers of samples of the records, and reasons of the errors."""
    write_file(path, name, column, unit)
    channels = (*SENSORS, RawChannel("x", name, "ignored", unit=layout_unit))
    result = read(path.name, path.parent, RawDescription(channels, rate=RATE, checked_entries=checked))
    return [r.n_sample for r in result.recordings], [e.reason for e in result.errors], [*map(str, result.errors)]


@pytest.mark.parametrize("format", ["csv", "parquet", "npz", "mat", "h5", "tdms"])
@pytest.mark.parametrize("numbers", [(1, 2, 3), (0, 1, 2), (3, 2, 1)])
def test_a_column_that_counts_in_blocks_is_an_error_under_any_name(format, numbers, tmp_path):
    column = np.repeat(numbers, LENGTHS).astype(float)
    lengths, reasons, messages = outcome(tmp_path / f"a.{format}", "qwxz", column)
    assert (lengths, reasons) == ([], ["wrong_length"])
    assert "'qwxz' changes 2 times" in messages[0] and "checked_entries: qwxz" in messages[0]


@pytest.mark.parametrize("format", ["csv", "parquet", "npz", "h5", "tdms"])
@pytest.mark.parametrize("first", [0.0, 1.0])
@pytest.mark.parametrize("step", [1.0, 1e3 / RATE])
def test_a_count_or_an_axis_that_begins_again_is_reported_under_any_name(format, first, step, tmp_path):
    column = np.concatenate([first + step * np.arange(n) for n in LENGTHS])
    lengths, reasons, messages = outcome(tmp_path / f"a.{format}", "qwxz", column)
    assert (lengths, reasons) == ([], ["wrong_length"]) and "'qwxz' begins again 2 times" in messages[0]


@pytest.mark.parametrize("name", ["Impact No", "Hit #", "record"])
def test_a_column_that_says_number_divides_blocks_of_any_length(name, tmp_path):
    write_file(tmp_path / "a.csv", name, np.repeat([1, 2, 3], LENGTHS))
    result = read("a.csv", tmp_path, RawDescription(SENSORS, rate=RATE))
    assert [r.n_sample for r in result.recordings] == [*LENGTHS] and not result.errors
    assert np.allclose(result.recordings[1].signal("force"), FORCE[600:1180], rtol=1e-5, atol=0.0)


FLAGS = {
    "trigger": np.repeat([0, 1], [200, N - 200]), "pulse": np.repeat([0, 1, 0], [200, 40, N - 240]),
    "state of 5 V": np.repeat([0, 5], [200, N - 200]), "square wave": np.arange(N) // 64 % 2, "constant": np.full(N, 7),
    "noise": np.rint(FORCE), "one byte": np.arange(N) % 256, "count": np.arange(N), "bits": np.arange(N) % 4,
    "fast states": np.arange(N) // 8, "seconds since 1970": 1_715_609_130 + np.arange(N) // int(RATE / 64) // 64,
    "late state": np.repeat([3, 4], [N - 1, 1])[::-1],
}  # fmt: skip


@pytest.mark.parametrize("format", ["csv", "npz"])
@pytest.mark.parametrize("name", FLAGS)
def test_a_flag_or_a_counter_does_not_cost_a_record(format, name, tmp_path):
    assert outcome(tmp_path / f"a.{format}", "qwxz", FLAGS[name])[:2] == ([N], [])


AMBIGUOUS = {
    "numbers from 7 on, or degrees": np.repeat([7, 8, 9], LENGTHS), "falling": np.repeat([9, 8, 7], LENGTHS),
    "numbers in wide steps": np.repeat([101, 214, 388], LENGTHS),
    "0 and 1 in like parts": np.repeat([0, 1], [900, N - 900]), "counts to 1000": 1 + np.arange(N) % 1000,
    "two sections": np.repeat([1, 2, 1, 2], [400, 450, 460, 460]),
    "held values": np.repeat([21, 25, 22, 24, 20], N // 5),
}  # fmt: skip


@pytest.mark.parametrize("name", AMBIGUOUS)
def test_a_form_that_leaves_it_open_is_a_remark(name, tmp_path):
    lengths, reasons, _ = outcome(tmp_path / "a.csv", "qwxz", AMBIGUOUS[name])
    assert (lengths, reasons) == ([len(AMBIGUOUS[name])], ["entry_unknown"])


def test_the_layout_or_a_unit_can_say_that_a_column_numbers_nothing(tmp_path):
    column = np.repeat([20, 21, 22], LENGTHS)
    assert outcome(tmp_path / "a.csv", "qwxz", column)[1] == ["entry_unknown"]
    assert outcome(tmp_path / "a.csv", "qwxz", column, unit="°C")[:2] == ([N], [])
    assert outcome(tmp_path / "a.csv", "qwxz", column, layout_unit="°C")[:2] == ([N], [])
    assert outcome(tmp_path / "a.csv", "qwxz", column, checked=("QWXZ",))[:2] == ([N], [])


def test_whole_seconds_of_a_clock_are_no_numbers_of_records(tmp_path):
    """At 500 Hz each second has 500 samples, and the first and the last one fewer: that is a remark only."""
    seconds = (np.arange(N) + 130) // 500
    write_file(tmp_path / "a.csv", "qwxz", seconds)
    channels = (*SENSORS, RawChannel("x", "qwxz", "ignored"))
    result = read("a.csv", tmp_path, RawDescription(channels, rate=500.0))
    assert len(result.recordings) == 1 and [e.reason for e in result.errors] == ["entry_unknown"]
    result = read("a.csv", tmp_path, RawDescription(channels, rate=2000.0))
    assert not result.recordings and [e.reason for e in result.errors] == ["wrong_length"]


def test_a_vector_beside_a_matrix_that_numbers_the_records_is_reported(tmp_path):
    matrix = np.array([FORCE, RAIL])
    for vector, n_record in ((np.repeat([1, 2, 3], LENGTHS), 0), (np.zeros(N, dtype=int), 1)):
        np.savez(tmp_path / "a.npz", data=matrix, channels=["force", "rail"], fs=RATE, qwxz=vector)
        result = read("a.npz", tmp_path, RawDescription(SENSORS, rate=RATE))
        assert len(result.recordings) == n_record and len(result.errors) == 1 - n_record
        assert n_record or "'qwxz' changes 2 times" in str(result.errors[0])


@pytest.mark.parametrize("format", ["parquet", "npz"])
def test_texts_that_change_in_blocks_are_reported_and_flags_are_not(format, tmp_path):
    for texts, n_record in (
        (("qw 1", "qw 2", "qw 3"), 0),
        (("off", "on", "off"), 1),
        (("qw", "qw", "qw"), 1),
    ):
        write_file(tmp_path / f"a.{format}", "qwxz", np.repeat(texts, LENGTHS))
        result = read(f"a.{format}", tmp_path, RawDescription(SENSORS, rate=RATE))
        assert len(result.recordings) == n_record and len(result.errors) == 1 - n_record
        assert n_record or "'qwxz' changes 2 times, from 0 to 2" in str(result.errors[0])


# Columns of right files: one impact in the whole record, early in it.
RATE_HIT, N_HIT = 2e4, 24000
INDEX = np.arange(N_HIT)
HIT = 4000.0 * np.exp(-(((INDEX - 300) / 8.0) ** 2)) + np.random.default_rng(5).normal(size=N_HIT)
RINGING = 60.0 * np.exp(-np.maximum(INDEX - 300, 0) / 80.0) * np.sin(0.18 * INDEX) * (INDEX >= 300)


def in_blocks(*numbers):
    """Whole numbers in blocks of unequal lengths."""
    lengths = [900 + 150 * i for i in range(len(numbers) - 1)]
    return np.repeat(numbers, [*lengths, N_HIT - sum(lengths)])


STATES = {
    "Axles": in_blocks(0, 1, 2, 3), "Pulses": INDEX // 1000, "GPS fix": in_blocks(1, 2), "State": in_blocks(0, 1, 2, 3),
    "Range": in_blocks(1, 2), "Packet": INDEX // 512, "n": INDEX % 20000, "Encoder": INDEX % 1024, "Angle": INDEX % 360,
    "Count": (INDEX + 30000) % 2**15, "Status": np.repeat([0, 1], [11000, 13000]), "Temp": np.repeat([21, 22], 12000),
    "Battery": in_blocks(87, 86), "Satellites": in_blocks(7, 8, 9), "RH": in_blocks(65, 66), "Minute": in_blocks(5, 6),
    "Dir": np.repeat([-1, 1], 12000), "TTL": np.repeat([0, 1], 12000),
}  # fmt: skip


def outcome_of_hit(path, name, column, kind="hammer", force=HIT, unit="", with_time=False, layout=SENSORS):
    """As ``outcome``, of a record with the given force."""
    columns = {"time": INDEX / RATE_HIT} if with_time else {}
    columns |= {"force": force, "rail": RINGING + 0.1 * HIT / 4000.0, name: column}
    if path.suffix == ".csv":
        head = ";".join({"time": "time [s]", name: f"{name} [{unit}]" if unit else name}.get(n, n) for n in columns)
        rows = "".join(
            ";".join(c if isinstance(c, str) else f"{c:.9g}" for c in row) + "\n" for row in zip(*columns.values())
        )
        path.write_text(f"{head}\n{rows}", encoding="utf-8")
    elif path.suffix == ".parquet":
        pq.write_table(pa.table(columns), path)
    elif path.suffix == ".npz":
        np.savez(path, **columns)
    elif path.suffix == ".mat":
        scipy.io.savemat(path, columns)
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            for n, x in columns.items():
                file[n] = x
    else:
        with nptdms.TdmsWriter(str(path)) as writer:
            writer.write_segment([nptdms.ChannelObject("g", n, x) for n, x in columns.items()])
    ignored = () if column.dtype.kind == "U" else (RawChannel("x", name, "ignored"),)
    result = read(path.name, path.parent, RawDescription((*layout, *ignored), rate=RATE_HIT, kind=kind))
    return len(result.recordings), [e.reason for e in result.errors]


@pytest.mark.parametrize("format", ["csv", "parquet", "npz", "mat", "h5", "tdms"])
@pytest.mark.parametrize("name", STATES)
def test_a_column_over_one_impact_numbers_no_records(format, name, tmp_path):
    assert outcome_of_hit(tmp_path / f"a.{format}", name, STATES[name]) == (1, [])


@pytest.mark.parametrize("with_time", [False, True])
@pytest.mark.parametrize("unit", ["", "count", "-", "1", "bool"])
@pytest.mark.parametrize("name", ["State", "Axles", "Packet"])
def test_neither_unit_nor_time_axis_is_needed_over_one_impact(name, unit, with_time, tmp_path):
    path = tmp_path / "a.csv"
    assert outcome_of_hit(path, name, STATES[name], unit=unit, with_time=with_time) == (1, [])
    layout = (RawChannel("force", "force", "ignored"), SENSORS[1])  # without a force the other sensors tell
    assert outcome_of_hit(path, name, STATES[name], unit=unit, with_time=with_time, layout=layout) == (1, [])


@pytest.mark.parametrize("name", STATES)
def test_a_column_that_counts_within_a_passage_does_not_cost_it(name, tmp_path):
    noise = np.random.default_rng(6).normal(size=N_HIT)
    assert outcome_of_hit(tmp_path / "a.csv", name, STATES[name], "passage", noise) == (1, [])


@pytest.mark.parametrize("format", ["parquet", "npz"])
@pytest.mark.parametrize("kind", ["hammer", "passage"])
def test_states_in_words_do_not_cost_a_record(format, kind, tmp_path):
    texts = np.repeat(["approach", "on", "off"], [8000, 7000, 9000])
    assert outcome_of_hit(tmp_path / f"a.{format}", "phase", texts, kind) == (1, [])


def test_numbers_of_passages_are_a_remark(tmp_path):
    noise = np.random.default_rng(6).normal(size=N_HIT)
    column = in_blocks(1, 2, 3)
    assert outcome_of_hit(tmp_path / "a.csv", "qwxz", column, "passage", noise) == (1, ["entry_unknown"])


LONG = (8200, 7600, 8200)
THREE_HITS = np.concatenate([HIT[:n] * share for n, share in zip(LONG, (1.0, 0.4, 0.7))])


@pytest.mark.parametrize("format", ["csv", "parquet", "npz", "mat", "h5", "tdms"])
@pytest.mark.parametrize("name", ["qwxz", "shot", "Axles"])
@pytest.mark.parametrize("column", [np.repeat([1, 2, 3], LONG), np.concatenate([np.arange(n) for n in LONG])])
def test_three_impacts_that_a_column_numbers_are_an_error_under_any_name(format, name, column, tmp_path):
    assert outcome_of_hit(tmp_path / f"a.{format}", name, column, force=THREE_HITS) == (0, ["wrong_length"])


WEAK_HITS = np.concatenate([HIT[:n] * share for n, share in zip(LONG, (1.0, 0.1, 0.05))])


@pytest.mark.parametrize("name", ["qwxz", "Axles", "State"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_three_impacts_of_which_one_is_much_stronger_are_a_remark(name, sign, tmp_path):
    column = np.repeat([1, 2, 3], LONG)
    assert outcome_of_hit(tmp_path / "a.csv", name, column, force=sign * WEAK_HITS) == (1, ["entry_unknown"])


@pytest.mark.parametrize(
    "after",
    [
        -60.0 * np.exp(-np.maximum(INDEX - 330, 0) / 9000.0) * (INDEX > 330),  # an amplifier swings to the other side
        150.0 * np.exp(-(((INDEX - 800) / 8.0) ** 2)),  # the hammer rebounds
        0.0 * INDEX,
    ],
)
def test_one_impact_and_what_follows_it_are_no_records(after, tmp_path):
    column = np.repeat([1, 2, 3], LONG)
    assert outcome_of_hit(tmp_path / "a.csv", "qwxz", column, force=HIT + after) == (1, [])
    assert outcome_of_hit(tmp_path / "a.csv", "qwxz", column, force=np.rint((HIT + after) / 10.0) * 10.0) == (1, [])


def test_records_of_a_power_of_two_are_told_from_a_counter_that_ends_by_their_impacts(tmp_path):
    force = np.concatenate([HIT[:4096]] * 5 + [HIT[: N_HIT - 5 * 4096]])
    assert outcome_of_hit(tmp_path / "a.csv", "n", INDEX % 4096, force=force) == (0, ["wrong_length"])
    force = np.concatenate([HIT[:8192], HIT[: N_HIT - 8192]])  # a double hit
    assert outcome_of_hit(tmp_path / "a.csv", "n", INDEX % 4096, force=force) == (1, ["entry_unknown"])


def test_several_impacts_in_blocks_of_a_state_or_beside_a_running_time_are_a_remark(tmp_path):
    column = np.repeat([1, 2, 3], LONG)
    assert outcome_of_hit(tmp_path / "a.csv", "Status", column, force=THREE_HITS) == (1, ["entry_unknown"])
    result = outcome_of_hit(tmp_path / "a.csv", "qwxz", column, force=THREE_HITS, with_time=True)
    assert result == (1, ["entry_unknown"])


def test_a_state_that_changes_within_the_impact_is_no_border_of_two(tmp_path):
    column = np.repeat([1, 2], [300, N_HIT - 300])
    assert outcome_of_hit(tmp_path / "a.csv", "qwxz", column) == (1, [])
