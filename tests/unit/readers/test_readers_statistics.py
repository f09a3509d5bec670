"""Statistics of the samples in the metadata: they explain themselves, and contradict numbers that lack a scale."""

import h5py
import nptdms
import numpy as np
import pytest

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
SAMPLES = (np.random.default_rng(7).normal(size=(2, 400)) * [[900.0], [25.0]]).round(3)
NAMES = (("Minimum", "Maximum"), ("min", "max"), ("Max value", "Mean"), ("RMS", "Std"))
FUNCTIONS = {"Minimum": np.min, "min": np.min, "Maximum": np.max, "max": np.max, "Max value": np.max, "Mean": np.mean,
             "RMS": lambda x: np.sqrt(np.mean(x * x)), "Std": np.std}  # fmt: skip


def write_tdms(path, names, scale):
    with nptdms.TdmsWriter(str(path)) as writer:
        properties = [{n: float(FUNCTIONS[n](x)) * scale for n in names} | {"wf_increment": 2e-4} for x in SAMPLES]
        channels = zip(CHANNELS, SAMPLES, properties)
        writer.write_segment([nptdms.ChannelObject("test", c.name, x, p) for c, x, p in channels])


def write_hdf5(path, names, scale):
    with h5py.File(path, "w") as file:
        for channel, x in zip(CHANNELS, SAMPLES):
            file[channel.name] = x
            file[channel.name].attrs.update({name: FUNCTIONS[name](x) * scale for name in names})


def write_csv(path, names, scale):
    lines = [";".join([name, *(f"{FUNCTIONS[name](x) * scale:.4f}" for x in SAMPLES)]) for name in names]
    rows = [f";{f};{a}" for f, a in SAMPLES.T]
    path.write_text("\n".join(["Channel;force;rail", "Unit;N;m/s^2", *lines, *rows, ""]))


FORMATS = {"a.tdms": write_tdms, "a.h5": write_hdf5, "a.csv": write_csv}


@pytest.mark.parametrize("names", NAMES)
@pytest.mark.parametrize("file_name", FORMATS)
def test_a_statistic_of_the_samples_needs_no_remark(file_name, names, tmp_path):
    FORMATS[file_name](tmp_path / file_name, names, 1.0)
    result = read(file_name, tmp_path, RawDescription(CHANNELS, rate=5000.0))
    np.testing.assert_array_equal([r.samples for r in result.recordings], [SAMPLES])
    assert not result.errors


@pytest.mark.parametrize("file_name", FORMATS)
def test_a_statistic_of_other_values_is_reported(file_name, tmp_path):
    FORMATS[file_name](tmp_path / file_name, ("Minimum", "Maximum"), 4.4482216)
    result = read(file_name, tmp_path, RawDescription(CHANNELS, rate=5000.0))
    assert [error.reason for error in result.errors] == ["entry_unknown"]
    assert "Maximum" in str(result.errors[0]) or "Minimum" in str(result.errors[0])
