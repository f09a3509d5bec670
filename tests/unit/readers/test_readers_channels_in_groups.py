"""Files whose cells or groups contain one channel of all records, so that numbers in a layout could mean impacts."""

import h5py
import numpy as np
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RNG = np.random.default_rng(20261128)
FORCE = [RNG.normal(size=n) for n in (400, 400, 300)]
RAIL = [RNG.normal(size=n) for n in (400, 400, 300)]


def layout(force, rail):
    channels = (RawChannel("force", force, "force", "N"), RawChannel("rail", rail, "acceleration", "m/s²"))
    return RawDescription(channels, rate=5000.0)


def cell(vectors):
    array = np.empty(len(vectors), dtype=object)
    array[:] = vectors
    return array


@pytest.mark.parametrize("sources", [("force", "rail"), (0, 1)])
@pytest.mark.parametrize("is_nested", [False, True])
def test_a_cell_for_each_channel_has_a_vector_for_each_record(tmp_path, sources, is_nested):
    cells = {"force": cell(FORCE), "rail": cell(RAIL)}
    variables = {"test": cells, "fs": 5000.0} if is_nested else {**cells, "fs": 5000.0}
    scipy.io.savemat(tmp_path / "a.mat", variables)
    result = read("a.mat", tmp_path, layout(*sources))
    assert not result.errors
    for recording, force, rail in zip(result.recordings, FORCE, RAIL, strict=True):
        np.testing.assert_array_equal(recording.samples, [force, rail])


def test_a_record_that_one_cell_lacks_is_the_only_record_that_is_lost(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"force": cell(FORCE), "rail": cell(RAIL[:2]), "fs": 5000.0})
    for sources in (("force", "rail"), (0, 1)):
        result = read("a.mat", tmp_path, layout(*sources))
        assert len(result.recordings) == 2
        assert [error.reason for error in result.errors] == ["channel_missing"]


def test_a_single_cell_with_a_short_vector_is_one_record(tmp_path):
    scipy.io.savemat(tmp_path / "a.mat", {"impact": cell([FORCE[0], RAIL[0], np.arange(2.0, 22.0)]), "fs": 5000.0})
    (recording,) = read("a.mat", tmp_path, layout(0, 1)).recordings
    np.testing.assert_array_equal(recording.samples, [FORCE[0], RAIL[0]])


def test_cells_with_vectors_of_different_lengths_are_records(tmp_path):
    """Formerly, the forces of two records were read as force and response of one."""
    records = {"north": (FORCE[0], RAIL[0]), "south": (FORCE[2], RAIL[2])}
    cells = {name: cell([*channels, np.arange(2.0, 22.0)]) for name, channels in records.items()}
    scipy.io.savemat(tmp_path / "a.mat", {**cells, "fs": 5000.0})
    recordings = read("a.mat", tmp_path, layout(0, 1)).recordings
    for recording, channels in zip(recordings, records.values(), strict=True):
        np.testing.assert_array_equal(recording.samples, channels)


def test_cells_whose_names_differ_only_in_numbers_are_records(tmp_path):
    cells = {f"run{k}": cell([force, rail, np.arange(2.0, 22.0)]) for k, (force, rail) in enumerate(zip(FORCE, RAIL))}
    scipy.io.savemat(tmp_path / "a.mat", {**cells, "fs": 5000.0})
    recordings = read("a.mat", tmp_path, layout(0, 1)).recordings
    for recording, force, rail in zip(recordings, FORCE, RAIL, strict=True):
        np.testing.assert_array_equal(recording.samples, [force, rail])


def write_groups(path, groups):
    if path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file.attrs["fs"] = 5000.0
            for group, channels in groups.items():
                for name, samples in channels.items():
                    file[f"{group}/{name}"] = samples
    elif path.suffix == ".mat":
        scipy.io.savemat(path, {**groups, "fs": 5000.0})
    else:
        with TdmsWriter(str(path)) as writer:
            step = {"wf_increment": 1 / 5000.0}
            writer.write_segment([ChannelObject(g, n, x, step) for g, c in groups.items() for n, x in c.items()])
    return path.name


@pytest.mark.parametrize("name", ["a.h5", "a.mat", "a.tdms"])
@pytest.mark.parametrize("inner", ["impact_{}", "run{}", "trial_{}"])
@pytest.mark.parametrize("outer", [("force", "rail"), ("Hammer", "Schwelle"), ("kraft", "beschleunigung")])
def test_a_group_per_channel_is_an_error(tmp_path, name, inner, outer):
    groups = {g: {inner.format(k): x for k, x in enumerate(v[:2])} for g, v in zip(outer, (FORCE, RAIL))}
    with pytest.raises(ReadError) as caught:
        read(write_groups(tmp_path / name, groups), tmp_path, layout(0, 1))
    assert caught.value.reason == "channel_missing" and "named as channels" in str(caught.value)


@pytest.mark.parametrize("name", ["a.h5", "a.mat", "a.tdms"])
@pytest.mark.parametrize("outer", [("hammer1", "hammer2"), ("left", "right"), ("hammer_left", "hammer_right")])
@pytest.mark.parametrize("inner", [("force", "rail"), ("ch0", "ch1")])
def test_a_group_per_record_is_read(tmp_path, name, outer, inner):
    groups = {g: dict(zip(inner, pair)) for g, *pair in zip(outer, FORCE, RAIL)}
    result = read(write_groups(tmp_path / name, groups), tmp_path, layout(*inner))
    assert not result.errors
    for recording, force, rail in zip(result.recordings, FORCE, RAIL):
        np.testing.assert_array_equal(recording.samples, [force, rail])
