"""A usual code for a missing sample is one in packed numbers, too: unpacked, it looks like a measured value."""

import h5py
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

DESCRIPTION = RawDescription(channels=(RawChannel("force", "force", "force", unit="N"),), rate=1000.0)
SMOOTH = np.round(1000 * np.sin(np.arange(400) / 9))


def outcome(numbers, factor, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.attrs["sampling_rate"] = 1000.0
        file["force"] = numbers
        file["force"].attrs.update({"unit": "N", "scale_factor": factor})
    return read("a.h5", tmp_path, DESCRIPTION)


@pytest.mark.parametrize("factor", [0.125, 1.0, -0.5])
@pytest.mark.parametrize(
    ("code", "type"), [(-32768, "i2"), (-32768, "i4"), (32767, "i2"), (-9999, "i2"), (-9999, "f4"), (-(2**31), "i4")]
)
def test_a_code_in_packed_numbers_is_reported(code, type, factor, tmp_path):
    numbers = SMOOTH.copy()
    numbers[100:150] = code
    result = outcome(numbers.astype(type), factor, tmp_path)
    if code == 32767:  # no code by itself: the highest number of a converter is clipping
        assert len(result.recordings) == 1
    else:
        assert not result.recordings and [e.reason for e in result.errors] == ["not_finite"]


def test_packed_numbers_without_a_code_are_read(tmp_path):
    (recording,) = outcome(SMOOTH.astype("i2"), 0.125, tmp_path).recordings
    np.testing.assert_allclose(recording.signal("force"), SMOOTH * 0.125)
