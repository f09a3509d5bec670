"""Columns of words beside the samples: alarms and digital inputs of loggers, states, marks at single samples."""

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
N = 400
FORCE, RAIL = np.random.default_rng(5).normal(size=(2, N)).round(4)


def outcome(tmp_path, words, head="force [N];rail [m/s²];State", order=(0, 1, 2), mark=".", kind="passage", n=N):
    cells = [[f"{x:.4f}" for x in FORCE], [f"{x:.4f}" for x in RAIL], words]
    rows = [";".join(cells[i][k] for i in order) for k in range(n)]
    rows = [row.replace(".", ",") for row in rows] if mark == "," else rows
    names = [head.split(";")[i] for i in order]
    (tmp_path / "a.csv").write_text("\n".join([";".join(names), *rows, ""]), "utf-8")
    try:
        result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=5000.0, kind=kind))
    except ReadError as error:
        return [], (error,)
    return [recording.samples for recording in result.recordings], result.errors


WORDS = {
    "alarms": ["LLLL"] * N, "states": ["OK"] * N, "directions": ["N", "S"] * (N // 2),
    "digital input": ["Low"] * 150 + ["High"] * 250, "a mark": [""] * 200 + ["*"] + [""] * 199,
    "an event": [""] * 40 + ["Event 1"] + [""] * 359,
}  # fmt: skip


@pytest.mark.parametrize("mark", [".", ","])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (0, 2, 1)])
@pytest.mark.parametrize("kind", WORDS)
def test_a_column_of_words_is_no_channel(kind, order, mark, tmp_path):
    recordings, errors = outcome(tmp_path, WORDS[kind], order=order, mark=mark)
    np.testing.assert_array_equal(recordings, [[FORCE, RAIL]])
    assert not errors


@pytest.mark.parametrize(
    "word",
    [
        "OVR", "Over", "CLIP", "Overload", "Overflow CH1", "OL", "saturated", "saturation", "Überlast", "SÄTTIGUNG",
        "Dépassement", "overbelastet", "mætning",
    ],
)  # fmt: skip
def test_an_overload_in_a_column_of_words_is_reported(word, tmp_path):
    _, errors = outcome(tmp_path, ["OK"] * 200 + [word] * 3 + ["OK"] * (N - 203), kind="hammer")
    assert any("overload" in str(error).lower() or word in str(error) for error in errors)


def test_an_overload_behind_many_other_words_is_reported(tmp_path):
    words = ["OK"] * 100 + [f"Event {k}" for k in range(12)] + ["OVR"] + ["OK"] * (N - 113)
    _, errors = outcome(tmp_path, words)
    assert any("OVR" in str(error) for error in errors)


@pytest.mark.parametrize("first", ["OK", ""])
@pytest.mark.parametrize("word", ["invalid", "Error", "ungültig", "FEHLER", "erreur", "fejl", "ugyldig"])
def test_a_word_that_says_that_samples_are_invalid_is_an_error(word, first, tmp_path):
    recordings, errors = outcome(tmp_path, [first] * 200 + [word] * 3 + [first] * (N - 203))
    assert recordings == [] and repr(word) in str(errors[0]) and "State" in str(errors[0])


@pytest.mark.parametrize(
    "words", [["TRUE"] * N, ["off", "ON"] * (N // 2), ["Overload"] * N, ["invalid"] * N, ["0x0F"] * N]
)
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_flags_are_to_be_exported_as_numbers(words, order, tmp_path):
    recordings, errors = outcome(tmp_path, words, order=order)
    assert recordings == [] and repr(words[-1]) in str(errors[0])


def test_words_that_change_in_blocks_may_number_records(tmp_path):
    _, errors = outcome(tmp_path, ["first"] * 200 + ["second"] * 200, kind="hammer")
    assert [error.reason for error in errors] in (["entry_unknown"], ["wrong_length"])


@pytest.mark.parametrize(
    ("usual", "other"),
    [("gut", "Sensorbruch"), ("kunnossa", "anturivika"), ("v poradku", "rozpojeno"), ("in range", "open")],
)
@pytest.mark.parametrize("rows", [slice(150, 195), slice(0, 60), slice(0, N, 7), slice(399, 400)])
def test_words_that_change_in_a_hammer_test_are_a_remark_in_any_language(usual, other, rows, tmp_path):
    words = np.full(N, usual, dtype=object)
    words[rows] = other
    recordings, errors = outcome(tmp_path, words.tolist(), kind="hammer")
    np.testing.assert_array_equal(recordings, [[FORCE, RAIL]])
    n_other = len(range(N)[rows])
    assert [error.reason for error in errors] == ["entry_unknown"]
    assert f"{n_other} of {N} rows" in str(errors[0]) and repr(other) in str(errors[0])


@pytest.mark.parametrize("words", [["gut"] * N, ["Sensor 4711"] * N])
def test_words_that_never_change_are_no_remark(words, tmp_path):
    recordings, errors = outcome(tmp_path, words, kind="hammer")
    np.testing.assert_array_equal(recordings, [[FORCE, RAIL]])
    assert not errors


def test_words_that_the_layout_declares_checked_are_no_remark(tmp_path):
    outcome(tmp_path, ["gut"] * 399 + ["Start"], kind="hammer")
    description = RawDescription(CHANNELS, rate=5000.0, kind="hammer", checked_entries=("State",))
    assert not read("a.csv", tmp_path, description).errors


def test_a_word_in_a_column_of_numbers_is_an_error(tmp_path):
    cells = [f"{x:.4f}" for x in RAIL]
    cells[200] = "OVER"
    recordings, errors = outcome(tmp_path, cells)
    assert recordings == [] and "'OVER' is no number" in str(errors[0])


def test_a_few_rows_with_words_are_a_table_of_the_head(tmp_path):
    lines = [f"CH{k};{k}.5;mV" for k in range(1, 12)]
    rows = [f"{f};{a}" for f, a in zip(FORCE, RAIL)]
    (tmp_path / "a.csv").write_text("\n".join([*lines, "force [N];rail [m/s²]", *rows, ""]), "utf-8")
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=5000.0, kind="passage"))
    np.testing.assert_array_equal([r.samples for r in result.recordings], [[FORCE, RAIL]])


def test_the_units_are_those_above_the_numbers(tmp_path):
    head = '"Vendor","Logger"\n"CH1","force","DC","10V"\n"Number","force","rail","Alarm1","AlarmOut"\n'
    units = '"NO.","N","m/s2","A1234567890","A1234"\n'
    rows = "".join(f"{k},{f:+.4f},{a:+.4f},LLLLLLLLLL,LLLL\n" for k, (f, a) in enumerate(zip(FORCE, RAIL), 1))
    (tmp_path / "a.csv").write_text(head + units + rows)
    result = read("a.csv", tmp_path, RawDescription(CHANNELS, rate=5000.0))
    np.testing.assert_array_equal([r.samples for r in result.recordings], [[FORCE, RAIL]])
    assert not result.errors


def test_words_between_blanks(tmp_path):
    rows = "".join(f"{f:.4f}  {a:.4f} ok\n" for f, a in zip(FORCE, RAIL))
    (tmp_path / "a.txt").write_text("force [N]  rail [m/s2]  st\n" + rows)
    result = read("a.txt", tmp_path, RawDescription(CHANNELS, rate=5000.0))
    np.testing.assert_array_equal([r.samples for r in result.recordings], [[FORCE, RAIL]])
    assert not result.errors


def test_a_remark_on_words_quotes_the_rarest(tmp_path):
    words = [f"step {k % 6}" for k in range(N)]
    words[390] = "Sensorbruch"
    _, (error,) = outcome(tmp_path, words, kind="hammer")
    assert "('Sensorbruch', " in str(error)


def write_table(tmp_path, extension, words):
    path = tmp_path / f"a.{extension}"
    if extension == "parquet":
        pq.write_table(pa.table({"force": FORCE, "rail": RAIL, "State": words}), path)
    elif extension == "npz":
        np.savez(path, force=FORCE, rail=RAIL, State=np.array(words))
    else:
        with h5py.File(path, "w") as file:
            file["force"], file["rail"], file["State"] = FORCE, RAIL, np.array([w.encode() for w in words])
    return read(path.name, tmp_path, RawDescription(IN_UNITS, rate=5000.0, kind="hammer"))


IN_UNITS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))


@pytest.mark.parametrize("extension", ["parquet", "npz", "h5"])
@pytest.mark.parametrize("word", ["OVR", "overload", "Überlast"])
def test_an_overload_beside_the_samples_is_reported_in_any_format(word, extension, tmp_path):
    result = write_table(tmp_path, extension, ["gut"] * 200 + [word] + ["gut"] * (N - 201))
    assert [error.reason for error in result.errors] == ["entry_unknown"] and word in str(result.errors[0])
    assert not write_table(tmp_path, extension, ["gut"] * N).errors


@pytest.mark.parametrize("extension", ["parquet", "npz", "h5"])
def test_a_word_that_says_that_samples_are_invalid_is_an_error_in_any_format(extension, tmp_path):
    with pytest.raises(ReadError, match="'invalid' in row 201"):
        write_table(tmp_path, extension, ["gut"] * 200 + ["invalid"] + ["gut"] * (N - 201))


@pytest.mark.parametrize(("extension", "empty"), [("parquet", None), ("parquet", ""), ("npz", ""), ("h5", "")])
def test_a_column_of_words_may_begin_with_empty_cells(extension, empty, tmp_path):
    """A logger may mark nothing but what is wrong. Before, the kind of a column was that of its first cell."""
    with pytest.raises(ReadError, match="'invalid' in row 201"):
        write_table(tmp_path, extension, [empty] * 200 + ["invalid"] + [empty] * (N - 201))
    (error,) = write_table(tmp_path, extension, [empty] * 200 + ["OVR"] + [empty] * (N - 201)).errors
    assert "OVR" in str(error)


@pytest.mark.parametrize("extension", ["parquet", "npz", "h5", "csv"])
@pytest.mark.parametrize("words", [["inverted"] * N, ["raw"] * N, ["inverted"] * 300 + ["off line"] * 100])
def test_words_beside_the_samples_may_state_what_was_done_to_them(words, extension, tmp_path):
    if extension == "csv":
        recordings, errors = outcome(tmp_path, words, kind="hammer")
        assert not recordings and errors[0].reason == "scale_unknown"
    else:  # a column that is no channel: a remark
        assert "entry_unknown" in [error.reason for error in write_table(tmp_path, extension, words).errors]
