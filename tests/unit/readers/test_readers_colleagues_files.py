"""Files of loggers and scripts of colleagues; each represents a class of files that was misread or rejected."""

import h5py
import numpy as np
import pytest
import scipy.io

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE = 20000.0
RNG = np.random.default_rng(20261129)
FORCE, RAIL = RNG.normal(size=(2, 3, 400))
BY_NAME = RawDescription(
    (RawChannel("force", "force", "force", unit="N"), RawChannel("rail", "rail", "acceleration", unit="m/s²")),
    rate=RATE,
)
BY_NUMBER = RawDescription(
    (RawChannel("force", 0, "force", unit="N"), RawChannel("rail", 1, "acceleration", unit="m/s²")), rate=RATE
)


def table(tmp_path, head, columns=(FORCE[0], RAIL[0]), end=""):
    rows = "".join(";".join(f"{x:.5f}" for x in row) + f"{end}\n" for row in zip(*columns))
    (tmp_path / "a.csv").write_text(f"{head}\n{rows}")
    return "a.csv"


def outcome(name, tmp_path, layout=BY_NAME):
    """(force, rail) of each record, and the errors."""
    try:
        result = read(name, tmp_path, layout)
    except ReadError as error:
        return [], (error,)
    return [recording.samples for recording in result.recordings], result.errors


def cell(*vectors):
    array = np.empty((1, len(vectors)), dtype=object)
    for k, vector in enumerate(vectors):
        array[0, k] = vector
    return array


# Text


@pytest.mark.parametrize("first", [0, 1])
def test_an_index_column_without_a_name_is_not_read_as_a_channel(first, tmp_path):
    name = table(tmp_path, ";force;rail", (first + np.arange(400), FORCE[0], RAIL[0]))
    records, errors = outcome(name, tmp_path)
    assert len(records) == 1 and errors == ()
    np.testing.assert_allclose(records[0], [FORCE[0], RAIL[0]], atol=1e-5)


def test_another_column_without_a_name_is_read_as_a_channel(tmp_path):
    records, (error,) = outcome(table(tmp_path, ";force;rail", (RNG.integers(0, 99, 400), FORCE[0], RAIL[0])), tmp_path)
    assert records == [] and error.reason == "channel_unknown"


@pytest.mark.parametrize(("step", "is_right"), [("5.0e-05", True), ("4.0e-05", False)])
def test_statements_in_the_line_of_names_are_not_read_as_columns(step, is_right, tmp_path):
    """Oscilloscopes write them; their cells are empty in every row."""
    name = table(tmp_path, f"force;rail;t0 = -1.0e-02;tInc = {step}", end=";;")
    records, errors = outcome(name, tmp_path)
    assert len(records) == is_right and [e.reason for e in errors] == ([] if is_right else ["wrong_rate"])


def test_delays_are_compared_and_not_read_as_a_rate(tmp_path):
    head = "force_t0 [ms];{}\nrail_t0 [ms];2.5\nforce;rail"
    assert outcome(table(tmp_path, head.format("2.5")), tmp_path)[1] == ()
    assert outcome(table(tmp_path, head.format("0")), tmp_path)[1][0].reason == "clock_drift"


@pytest.mark.parametrize("label", ["CH", "Time"])
@pytest.mark.parametrize(
    ("values", "is_right"),
    [
        ("0.23 mV/N;10.2 mV/g", True), ("0.23 mV/N;100 mV/g", False), ("0,23 mV/N;10,2 mV/g", True),
        ("10.2 mV/g;0.23 mV/N", False),
    ],
)  # fmt: skip
def test_a_line_with_a_sensitivity_per_column_is_compared_with_the_layout(values, is_right, label, tmp_path):
    layout = RawDescription(
        (
            RawChannel("force", "a", "force", unit="mV", sensitivity=0.23, sensitivity_unit="mV/N"),
            RawChannel("rail", "b", "acceleration", unit="mV", sensitivity=10.2, sensitivity_unit="mV/g"),
        ),
        rate=RATE,
    )
    columns = (np.arange(400) / RATE, FORCE[0], RAIL[0]) if label == "Time" else (FORCE[0], RAIL[0])
    names = "Time;a;b" if label == "Time" else "a;b"
    records, errors = outcome(table(tmp_path, f"Sensitivity;{values}\n{names}", columns), tmp_path, layout)
    assert len(records) == is_right and [e.reason for e in errors] == ([] if is_right else ["scale_unknown"])


@pytest.mark.parametrize("none", ["-", "n/a", ""])
def test_a_line_of_gains_can_have_a_channel_without_a_gain(none, tmp_path):
    """Formerly, the line was read as a list of pairs, and "-: 10" was an entry without a meaning."""
    records, (error,) = outcome(table(tmp_path, f"Gain;{none};10\nforce;rail"), tmp_path)
    assert records == [] and error.reason == "scale_unknown" and "Gain = 10" in error.problem


@pytest.mark.parametrize(
    ("line", "reason"),
    [("Factor ch 2:50", "scale_unknown"), ("Gain 2:10.5", "scale_unknown"), ("fs 1:51200", "wrong_rate")],
)
def test_the_number_of_a_channel_and_a_value_are_not_read_as_a_time_of_day(line, reason, tmp_path):
    """Formerly, a colon between digits was always taken as part of a time."""
    records, (error,) = outcome(table(tmp_path, f"{line}\nforce;rail"), tmp_path)
    assert records == [] and error.reason == reason


def test_a_line_with_a_polarity_per_column_is_checked(tmp_path):
    records, (error,) = outcome(table(tmp_path, "Polarity;normal;inverted\nforce;rail"), tmp_path)
    assert records == [] and error.reason == "scale_unknown" and "'rail'" in error.where
    assert "Polarity = 'inverted'" in error.problem


@pytest.mark.parametrize("head", ["Overrange: rail (3 samples)", "Overload;rail 12 x", "Clipping: 3 samples"])
def test_an_overload_of_a_number_of_samples_is_reported(head, tmp_path):
    _, (error,) = outcome(table(tmp_path, f"{head}\nforce;rail"), tmp_path)
    assert error.reason == "entry_unknown" and "left its range" in error.problem


def test_an_overload_of_zero_samples_is_not_reported(tmp_path):
    assert outcome(table(tmp_path, "Overrange: rail (0 samples)\nforce;rail"), tmp_path)[1] == ()


def test_a_square_wave_is_not_reported_as_a_channel_of_a_lower_rate(tmp_path):
    square = np.tile(np.repeat([0.0, 100.0], 5), 40)
    assert outcome(table(tmp_path, "force;rail", (square, RAIL[0])), tmp_path)[1] == ()
    steps = np.repeat(RNG.normal(size=80), 5)
    assert outcome(table(tmp_path, "force;rail", (steps, RAIL[0])), tmp_path)[1][0].reason == "wrong_rate"


@pytest.mark.parametrize(("unit", "si"), [("kip", 4448.2216152605), ("klbf", 4448.2216152605)])
def test_units_of_american_loggers_are_converted(unit, si, tmp_path):
    channels = RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration")
    layout = RawDescription(channels, rate=RATE)
    records, errors = outcome(table(tmp_path, f"force [{unit}];rail (g's)"), tmp_path, layout)
    assert errors == ()
    np.testing.assert_allclose(records[0], [FORCE[0] * si, RAIL[0] * 9.80665], atol=0.05)


def test_a_file_of_matrix_market_is_identified(tmp_path):
    scipy.io.mmwrite(str(tmp_path / "a.mtx"), np.column_stack([FORCE[0], RAIL[0]]))
    (tmp_path / "a.mtx").rename(tmp_path / "a.txt")
    _, (error,) = outcome("a.txt", tmp_path)
    assert "Matrix Market" in error.problem


# Arrays


@pytest.mark.parametrize("is_transposed", [False, True])
@pytest.mark.parametrize("format", ["npz", "mat", "h5"])
def test_a_matrix_per_channel_has_a_record_in_each_row(format, is_transposed, tmp_path):
    force, rail = (FORCE.T, RAIL.T) if is_transposed else (FORCE, RAIL)
    path = tmp_path / f"a.{format}"
    if format == "npz":
        np.savez(path, force=force, rail=rail, fs=RATE)
    elif format == "mat":
        scipy.io.savemat(path, {"force": force, "rail": rail, "fs": RATE})
    else:
        with h5py.File(path, "w") as file:
            file.attrs["fs"] = RATE
            for name, array, unit in (("force", force, "N"), ("rail", rail, "m/s²")):
                file.create_dataset(name, data=array).attrs["unit"] = unit
    records, errors = outcome(path.name, tmp_path)
    assert errors == ()
    np.testing.assert_array_equal(records, np.stack([FORCE, RAIL], axis=1))


@pytest.mark.parametrize("names", [("before", "after"), ("hammer_A7", "hammer_B3"), ("acc_rail", "acc_sleeper")])
def test_two_matrices_without_names_of_channels_are_an_error(names, tmp_path):
    """Formerly, one name of a sensor was enough: the channels of two tests of two channels were exchanged."""
    np.savez(tmp_path / "a.npz", **dict(zip(names, (FORCE[:2], RAIL[:2]))), fs=RATE)
    _, (error,) = outcome("a.npz", tmp_path, BY_NUMBER)
    assert "several arrays could be the samples" in error.problem


def test_matrices_with_the_same_unit_are_an_error(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["fs"] = RATE
        for name, array in (("before", FORCE), ("after", RAIL)):
            file.create_dataset(name, data=array[:2]).attrs["unit"] = "V"
    _, (error,) = outcome("a.h5", tmp_path, BY_NUMBER)
    assert "several arrays could be the samples" in error.problem


@pytest.mark.parametrize("layout", [BY_NAME, BY_NUMBER])
def test_a_cell_of_a_sensor_with_vectors_of_different_lengths_is_an_error(layout, tmp_path):
    """Formerly, the short vector was left out, and two impacts of the force were read as force and response."""
    scipy.io.savemat(tmp_path / "a.mat", {"force": cell(FORCE[0], FORCE[1], FORCE[2][:30]), "fs": RATE})
    records, (error,) = outcome("a.mat", tmp_path, layout)
    assert records == [] and "cell with vectors of 400, 400, 30 samples" in error.problem


@pytest.mark.parametrize("layout", [BY_NAME, BY_NUMBER])
@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_short_vector_in_the_cell_of_a_sensor_costs_its_record_alone(lost, layout, tmp_path):
    force = [vector[:30] if k == lost else vector for k, vector in enumerate(FORCE[:3])]
    scipy.io.savemat(tmp_path / "a.mat", {"force": cell(*force), "rail": cell(*RAIL[:3]), "fs": RATE})
    records, (error,) = outcome("a.mat", tmp_path, layout)
    np.testing.assert_allclose(records, [(FORCE[k], RAIL[k]) for k in range(3) if k != lost], atol=1e-12)
    assert error.reason in ("truncated", "channel_missing") and error.where == f"record {lost + 1} of 3"


def test_a_list_of_names_is_used_under_every_notation_of_its_name(tmp_path):
    """Formerly, "ChannelNames" was not used, so that a layout by numbers could exchange two channels."""
    for name in ("ChannelNames", "channel names", "SignalNames", "ColumnNames"):
        np.savez(tmp_path / "a.npz", x=np.stack([RAIL[0], FORCE[0]]), fs=RATE, **{name: np.array(["rail", "force"])})
        records, errors = outcome("a.npz", tmp_path)
        assert errors == (), name
        np.testing.assert_array_equal(records[0], [FORCE[0], RAIL[0]])


def with_groups(tmp_path, names):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k, name in enumerate(names):
            group = file.create_group(name)
            group.attrs["fs"] = RATE
            group.create_dataset("force", data=FORCE[k])
            group.create_dataset("rail", data=RAIL[k])
    return outcome("a.h5", tmp_path)


@pytest.mark.parametrize(
    "names",
    [("ambient", "hammer test"), ("calibration", "measurement"), ("noise floor", "impacts"), ("background 1", "A7")],
)
def test_noise_and_calibrations_are_not_read_as_records_of_a_test(names, tmp_path):
    records, (error,) = with_groups(tmp_path, names)
    assert records == [] and all(repr(name) in error.problem for name in names) and "file of their own" in error.remedy


@pytest.mark.parametrize(
    "names",
    [("impact 1", "impact 2"), ("left", "right"), ("run A", "run B"), ("noise 1", "noise 2"), ("3fa85f64", "9eb1f0aa")],
)
def test_groups_with_other_names_are_records(names, tmp_path):
    records, errors = with_groups(tmp_path, names)
    assert len(records) == 2 and errors == ()
