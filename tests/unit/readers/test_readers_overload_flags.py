"""An overload that the logger noted in the file is reported, whatever the samples look like."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

SAMPLES = np.sin(np.arange(400) / 9)


def remarks(tmp_path, name, value, checked=()):
    np.savez(tmp_path / "a.npz", force=SAMPLES, rate=1000.0, **{name: value})
    channel = RawChannel("force", "force", "force", unit="N")
    result = read("a.npz", tmp_path, RawDescription((channel,), rate=1000.0, checked_entries=checked))
    assert len(result.recordings) == 1
    return [error for error in result.errors if "left its range" in str(error)]


@pytest.mark.parametrize("name", ["Overload", "overflow", "ADC_overrange", "Clipped", "uebersteuert", "Übersteuerung"])
@pytest.mark.parametrize("value", [True, 1.0, 3, "yes", np.array([False, True])])
def test_an_overload_that_the_file_states_is_reported(name, value, tmp_path):
    (error,) = remarks(tmp_path, name, value)
    assert error.reason == "entry_unknown" and f"'{name}: " in str(error)
    assert not remarks(tmp_path, name, value, checked=(name,))


@pytest.mark.parametrize(
    ("name", "value"),
    [("Overload", False), ("Overload", 0), ("Overload", "no"), ("overload_level", 10.0), ("clipping_detection", True)],
)
def test_no_overload_is_reported_where_the_file_states_none(name, value, tmp_path):
    assert not remarks(tmp_path, name, value)
