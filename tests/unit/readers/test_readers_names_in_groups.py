"""Names and units of the channels of a matrix in a group beside it."""

import h5py
import numpy as np
import pytest
import scipy.io

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

NOISE = np.random.default_rng(0).normal(size=(2, 128)).round(4)
CHANNELS = (RawChannel("force", "force", "force"), RawChannel("rail", "rail", "acceleration"))


def write(path, names, units, further=None):
    header = {"SamplingFrequency": 20000.0, "ChannelNames": names, "ChannelUnits": units}
    if path.suffix == ".mat":
        texts = {key: np.array(v, object) if isinstance(v, list) else v for key, v in header.items()}
        scipy.io.savemat(path, {"Data": NOISE.T, "Header": texts, **(further or {})})
        return
    with h5py.File(path, "w") as file:
        file["Data"] = NOISE.T
        for key, value in header.items():
            file[f"Header/{key}"] = value
        for key, value in (further or {}).items():
            file[key + "/names"] = list(value["names"])


@pytest.mark.parametrize("name", ["a.mat", "a.h5"])
def test_a_group_beside_a_matrix_names_its_channels_and_their_units(name, tmp_path):
    write(tmp_path / name, ["rail", "force"], ["m/s2", "kN"])
    result = read(name, tmp_path, RawDescription(CHANNELS, rate=20000.0))
    assert not result.errors
    np.testing.assert_allclose(result.recordings[0].read(0, 128), NOISE[::-1] * [[1000.0], [1.0]], atol=1e-9)


def test_names_of_other_things_are_no_names_of_channels(tmp_path):
    write(tmp_path / "a.mat", ["A5", "A6", "A7"], ["x", "y", "z"])
    channels = tuple(RawChannel(c.name, k, c.quantity, unit=u) for k, (c, u) in enumerate(zip(CHANNELS, ("N", "g"))))
    result = read("a.mat", tmp_path, RawDescription(channels, rate=20000.0))
    np.testing.assert_allclose(result.recordings[0].signal("force"), NOISE[0], atol=1e-9)
