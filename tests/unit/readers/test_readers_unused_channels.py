"""What a file states about a channel that the layout does not use costs no record; the same of one in use does."""

import json

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE, N = 20_000.0, 2048
COLUMNS = dict(zip(("force", "rail", "oil"), np.random.default_rng(0).normal(size=(3, N))))
SENSORS = (RawChannel("force", "force", "force", "N"), RawChannel("acc", "rail", "acceleration", "m/s²"))
IGNORED = RawChannel("oil", "oil", "ignored")
FORMATS = ["parquet", "h5", "tdms", "npz", "mat"]
# Words of a unit or a scale, of which nothing says whether the samples contain it.
STATEMENTS = [("range", "psi"), ("label", "psi"), ("state", "inverted"), ("conversion", "1 V = 10 g"), ("Mode", "x100")]


def outcome(path, channel, name, value, channels=(*SENSORS, IGNORED), columns=COLUMNS):
    """Number of recordings and errors of a file that states ``name: value`` of one channel."""
    format = path.suffix[1:]
    if format == "parquet":
        arrays = {k: pa.array(x) for k, x in columns.items()}
        fields = [pa.field(k, x.type, metadata={name: value} if k == channel else None) for k, x in arrays.items()]
        pq.write_table(pa.table(list(arrays.values()), schema=pa.schema(fields)), path)
    elif format == "h5":
        with h5py.File(path, "w") as file:
            for k, x in columns.items():
                file[k] = x if x.dtype.kind == "f" else x.astype("S8")
            file[channel].attrs[name] = value
    elif format == "tdms":
        with nptdms.TdmsWriter(str(path)) as writer:
            properties = {k: {name: value} if k == channel else {} for k in columns}
            writer.write_segment([nptdms.ChannelObject("g", k, x, properties[k]) for k, x in columns.items()])
    elif format == "npz":
        np.savez(path, **columns, sensors=np.array(json.dumps({channel: {name: value}})))
    else:
        scipy.io.savemat(path, columns | {"sensors": {channel: {name: value}}})
    result = read(path.name, path.parent, RawDescription(channels, rate=RATE))
    return len(result.recordings), list(result.errors)


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize(("name", "value"), STATEMENTS)
def test_a_statement_about_an_unused_channel_is_a_remark(name, value, format, tmp_path):
    n_recording, errors = outcome(tmp_path / f"a.{format}", "oil", name, value)
    assert n_recording == 1 and [e.reason for e in errors] == ["entry_unknown"]
    assert f"{name}: {value}" in errors[0].problem


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize(("name", "value"), STATEMENTS)
def test_the_same_statement_about_a_channel_in_use_is_an_error(name, value, format, tmp_path):
    n_recording, errors = outcome(tmp_path / f"a.{format}", "rail", name, value)
    assert n_recording == 0 and errors[0].reason in ("unit_unknown", "scale_unknown")


@pytest.mark.parametrize(("name", "value"), STATEMENTS)
def test_the_same_statement_about_no_channel_is_an_error(name, value, tmp_path):
    np.savez(tmp_path / "a.npz", **COLUMNS, **{name: value})
    result = read("a.npz", tmp_path, RawDescription((*SENSORS, IGNORED), rate=RATE))
    assert not result.recordings and result.errors[0].reason in ("unit_unknown", "scale_unknown")


@pytest.mark.parametrize("format", ["parquet", "h5"])
@pytest.mark.parametrize("unit", ["psi", "inHg", "N", "qwx"])
def test_the_unit_of_an_unused_channel_need_not_be_known(unit, format, tmp_path):
    assert outcome(tmp_path / f"a.{format}", "oil", "unit", unit) == (1, [])
    columns = COLUMNS | {"oil": np.repeat("dry", N)}
    assert outcome(tmp_path / f"a.{format}", "oil", "unit", unit, SENSORS, columns)[0] == 1
    n_recording, errors = outcome(tmp_path / f"a.{format}", "rail", "unit", unit)
    assert n_recording == 0 and errors[0].reason == "unit_unknown"
