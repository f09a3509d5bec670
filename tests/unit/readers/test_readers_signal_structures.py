"""Structures of a signal with one axis each for x and y, as Simcenter Testlab exports them; sparse matrices."""

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))
RATE = 20000.0
N_SAMPLE = 400


def signals() -> dict[str, tuple[np.ndarray, str, float]]:
    """Name -> (samples as stored in the file, their unit, SI value of one unit)."""
    rng = np.random.default_rng(1)
    return {
        "force": (rng.normal(size=N_SAMPLE), "kN", 1e3),
        "rail": (rng.normal(size=N_SAMPLE), "g", 9.80665),
    }


def structure(samples, unit, step=1 / RATE, time_unit="s", start=0.0, count=N_SAMPLE) -> dict:
    return {
        "x_values": {
            "start_value": start,
            "increment": step,
            "number_of_values": float(count),
            "quantity": {"label": time_unit, "quantity_terms": {"length": 0.0, "time": 1.0}},
        },
        "y_values": {"values": samples[:, None], "quantity": {"label": unit, "unit_transformation": {"factor": 1.0}}},
        "function_record": {"name": "Time", "type": "signal", "primary_channel": {"name": "T:+Z"}},
    }


def structures(**changes) -> dict[str, dict]:
    return {name: structure(samples, unit, **changes) for name, (samples, unit, _) in signals().items()}


def assert_right(tmp_path, name="a.mat", n_record=1):
    result = read(name, tmp_path, RawDescription(CHANNELS, rate=RATE))
    assert not result.errors and len(result.recordings) == n_record
    for channel, (samples, _, scale) in signals().items():
        np.testing.assert_allclose(result.recordings[-1].signal(channel), samples * scale)


def only_error(tmp_path, channels=CHANNELS, name="a.mat"):
    (error,) = read(name, tmp_path, RawDescription(channels, rate=RATE)).errors
    return error


@pytest.mark.parametrize("time_unit, per_second", [("s", 1.0), ("ms", 1e3), ("µs", 1e6)])
@pytest.mark.parametrize("start", [0.0, -0.01])
def test_the_step_and_the_units_of_the_axes_are_read(time_unit, per_second, start, tmp_path):
    changes = {"step": per_second / RATE, "time_unit": time_unit, "start": start * per_second}
    scipy.io.savemat(tmp_path / "a.mat", structures(**changes))
    assert_right(tmp_path)


def test_the_columns_of_a_matrix_have_the_names_of_its_function_record(tmp_path):
    samples = np.column_stack([s for s, _, _ in signals().values()])
    labels = np.array([unit for _, unit, _ in signals().values()], dtype=object)
    one = structure(samples[:, 0], labels)
    one["y_values"]["values"] = samples
    one["function_record"]["name"] = np.array(list(signals()), dtype=object)
    scipy.io.savemat(tmp_path / "a.mat", {"Signal": one})
    assert_right(tmp_path)


def test_a_structure_per_record_contains_the_structures_of_its_signals(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {f"run_{k}": structures() for k in range(3)})
    assert_right(tmp_path, n_record=3)


def test_groups_of_hdf5_in_the_same_form_are_read(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, (samples, unit, _) in signals().items():
            file[f"{name}/x_values/increment"] = 1 / RATE
            file[f"{name}/y_values/values"] = samples
            file[f"{name}/y_values/quantity/label"] = unit
    assert_right(tmp_path, "a.h5")


def test_a_group_per_record_contains_a_group_per_channel(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for k in range(3):
            for name, (samples, unit, _) in signals().items():
                file[f"hit_{k}/{name}/data"] = samples
                file[f"hit_{k}/{name}"].attrs["unit"] = unit
    assert_right(tmp_path, "a.h5", n_record=3)


@pytest.mark.parametrize(
    "changes, reason, text",
    [
        ({"step": 1 / 25600}, "wrong_rate", "sampled at 25600 Hz instead of 20000 Hz"),
        ({"step": 0.0}, "wrong_rate", "'x_increment: 0.0'"),
        ({"count": 500}, "truncated", "it has 400 values where number_of_values says 500"),
        ({"time_unit": "Hz"}, "unreadable", "its x axis is in 'Hz', so it is no time signal"),
    ],
)
def test_an_axis_that_contradicts_the_samples_is_an_error(changes, reason, text, tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", structures(**changes))
    try:
        error = only_error(tmp_path)
    except Exception as raised:
        error = raised
    assert error.reason == reason and text in str(error)


def test_signals_with_different_starts_are_an_error(tmp_path):
    variables = structures()
    variables["rail"]["x_values"]["start_value"] = 0.01
    scipy.io.savemat(tmp_path / "a.mat", variables)
    with pytest.raises(Exception, match=r"signal 'rail': it begins at 0.01 and 'force' at 0") as raised:
        read("a.mat", tmp_path, RawDescription(CHANNELS, rate=RATE))
    assert raised.value.reason == "clock_drift"


def test_a_factor_of_the_unit_that_may_not_have_been_applied_is_an_error(tmp_path):
    variables = structures()
    variables["rail"]["y_values"]["quantity"]["unit_transformation"]["factor"] = 9.81
    scipy.io.savemat(tmp_path / "a.mat", variables)
    error = only_error(tmp_path)
    assert "channel 'rail'" in str(error) and "factor = 9.81" in str(error)


def test_a_sparse_matrix_is_an_error_that_states_its_type(tmp_path):
    force, rail = (samples for samples, _, _ in signals().values())
    channels = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
    sparse = scipy.sparse.csc_matrix(force[:, None])
    scipy.io.savemat(tmp_path / "a.mat", {"force": sparse, "rail": rail})
    assert "the channel 'force' is a sparse matrix" in str(error := only_error(tmp_path, channels))
    assert "force = full(force)" in str(error)
    scipy.io.savemat(tmp_path / "b.mat", {"force": sparse, "rail": scipy.sparse.csc_matrix(rail[:, None])})
    with pytest.raises(Exception, match=r"none of its variables is a full array: 'force' \(sparse matrix\), 'rail'"):
        read("b.mat", tmp_path, RawDescription(channels, rate=RATE))
