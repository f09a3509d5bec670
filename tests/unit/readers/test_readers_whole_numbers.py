"""Whole numbers that a layout reads as newtons, with a sensitivity or a range: the file may contain codes."""

import h5py
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

SAMPLES = np.round(3000 * np.sin(np.arange(400) / 9))


def remarks(tmp_path, type, name, value, checked=(), **keys):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["rate"] = 1000.0
        file["force"] = SAMPLES.astype(type)
        file["force"].attrs.update({"unit": "N", name: value})
    channel = RawChannel("force", "force", "force", **{"unit": "N"} | keys)
    result = read("a.h5", tmp_path, RawDescription((channel,), rate=1000.0, checked_entries=checked))
    assert len(result.recordings) == 1
    return result.errors


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("sensitivity", 0.5),
        ("Sensitivity", "2.3 mV/N"),
        ("range", "10 V"),
        ("adc_range", 10.0),
        ("full_scale", 22000.0),
    ],
)
@pytest.mark.parametrize("type", ["i2", "i4"])
def test_an_entry_that_may_convert_whole_numbers_is_reported(type, name, value, tmp_path):
    errors = [e for e in remarks(tmp_path, type, name, value) if "whole numbers" in str(e)]
    (error,) = errors
    assert error.reason == "entry_unknown"
    assert f"channel 'force': its samples are whole numbers, and '{name}: {value}' may convert them to N" in str(error)
    assert not [e for e in remarks(tmp_path, type, name, value, checked=(name,)) if "whole numbers" in str(e)]


@pytest.mark.parametrize(
    ("type", "name", "value", "keys"),
    [
        ("f4", "sensitivity", 0.5, {}),  # floating-point numbers are converted
        ("i2", "sensitivity", 1.0, {}),
        ("i2", "frequency_range", "10 Hz", {}),
        ("i2", "temperature_range", "60 °C", {}),
        ("i2", "sensitivity", 0.5, {"unit": "N!"}),
        ("i2", "sensitivity", 0.5, {"unit": "0.5 N!"}),
    ],
)
def test_an_entry_that_does_not_convert_the_samples_is_not_reported(type, name, value, keys, tmp_path):
    assert not [e for e in remarks(tmp_path, type, name, value, **keys) if "whole numbers" in str(e)]
