"""Samples that a file contains twice were measured once: blocks of a record, and channels of simultaneous records."""

from dataclasses import replace
from datetime import datetime, timedelta

import h5py
import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from turnout.readers import read, read_unconverted
from turnout.readers.interpret import errors_without_layout
from turnout.readers.repeated_blocks import repeated_block
from turnout.records import RawChannel, RawDescription

RATE = 2000.0
NOON = datetime(2026, 5, 13, 12)
FORCE = RawChannel("force", "force", "force", "N")
RAIL = RawChannel("rail", "rail", "acceleration", "m/s²")
HAMMER = RawDescription((FORCE, RAIL), rate=RATE)
TRAIN = RawDescription((RAIL,), kind="passage", rate=RATE)


def noise(n, seed=1, n_channel=2):
    return np.round(np.random.default_rng(seed).normal(size=(n_channel, n)) * 100.0, 2)


def with_copy(samples, start, at, n):
    return np.hstack([samples[:, :at], samples[:, start : start + n], samples[:, at:]])


def write_samples(path, samples):
    """Write force and rail in the format of the extension; return the name."""
    if path.suffix == ".csv":
        np.savetxt(path, samples.T, fmt="%.2f", delimiter=";", header="force [N];rail [m/s²]", comments="")
    elif path.suffix == ".npz":
        np.savez(path, force=samples[0], rail=samples[1], fs=RATE)
    elif path.suffix == ".tdms":
        with TdmsWriter(str(path)) as writer:
            step = {"wf_increment": 1 / RATE}
            writer.write_segment([ChannelObject("g", n, x, step) for n, x in zip(("force", "rail"), samples)])
    return path.name


@pytest.mark.parametrize("name", ["a.csv", "a.npz", "a.tdms"])
@pytest.mark.parametrize("start, at, n", [(0, 4000, 4000), (0, 4000, 1000), (700, 2100, 128), (1000, 1300, 300)])
@pytest.mark.parametrize("description", [HAMMER, RawDescription((FORCE, RAIL), "passage", rate=RATE)])
def test_a_repeated_block_of_samples_is_an_error_of_the_record(tmp_path, name, start, at, n, description):
    result = read(write_samples(tmp_path / name, with_copy(noise(4000), start, at, n)), tmp_path, description)
    (error,) = result.errors
    assert not result.recordings and error.reason == "duplicate"
    assert f"its samples {at} to {at + n - 1} repeat the samples {start} to {start + n - 1}" in str(error)
    source, _, raw = read_unconverted(name, tmp_path)
    assert [e.reason for e in errors_without_layout(raw, source)] == ["duplicate"]


def test_every_block_from_128_samples_on_is_found():
    for seed in range(100):
        generator = np.random.default_rng(seed)
        start = generator.integers(0, 2800)
        at = generator.integers(start + 128, 3000)
        block = repeated_block(with_copy(np.round(noise(3000, seed), -1), start, at, 128))
        assert block is not None and block[1] - block[0] == at - start and block[2] >= 128


def test_noise_tones_pulses_and_silence_are_not_reported_as_repeated_blocks():
    t = np.arange(20000) / RATE
    pulses = np.zeros((2, 20000))
    pulses[:, 1000::2000] = 5.0
    tones = [np.round(np.sin(2.0 * np.pi * f * t), 4)[None] for f in (0.5, 5.0, 20.0, 50.0, 400.0)]
    steps = np.round(np.random.default_rng(1).normal(size=(1, 20000)) * 0.5)
    for samples in (*tones, pulses, steps, np.zeros((2, 20000)), noise(20000)):
        assert repeated_block(samples) is None


def with_groups(path, groups, starts=()):
    with h5py.File(path, "w") as file:
        file.attrs["fs"] = RATE
        for k, (group, channels) in enumerate(groups.items()):
            for name, samples in channels.items():
                file[f"{group}/{name}"] = samples
            if starts:
                file[group].attrs["start_time"] = starts[k].isoformat()
    return path.name


@pytest.mark.parametrize("names", [("left", "right"), ("links", "rechts"), ("rail_1", "rail_2"), ("A7", "A8")])
def test_simultaneous_records_with_the_same_force_are_an_error(tmp_path, names):
    force, *rails = noise(2000, n_channel=3)
    groups = {name: {"force": force, "rail": rail} for name, rail in zip(names, rails)}
    result = read(with_groups(tmp_path / "a.h5", groups), tmp_path, HAMMER)
    assert not result.recordings and [e.reason for e in result.errors] == ["duplicate"] * 2
    assert "record 1: its channel 'force' has the same samples as in record 2" in str(result.errors[0])
    source, _, raw = read_unconverted("a.h5", tmp_path)
    assert [e.reason for e in errors_without_layout(raw, source)] == ["duplicate"] * 2


def test_other_records_of_the_file_are_kept(tmp_path):
    force, *rails = noise(2000, n_channel=3)
    groups = {f"hit_{k}": dict(zip(("force", "rail"), noise(2000, 5 + k))) for k in (1, 2)}
    groups |= {f"hit_{3 + k}": {"force": force, "rail": rail} for k, rail in enumerate(rails)}
    result = read(with_groups(tmp_path / "a.h5", groups), tmp_path, HAMMER)
    assert [r.record for r in result.recordings] == [0, 1] and len(result.errors) == 2


def test_a_record_that_repeats_another_is_used_once(tmp_path):
    """The hammer test rejects the impact and states the earlier one."""
    samples = dict(zip(("force", "rail"), noise(2000)))
    path = with_groups(tmp_path / "a.h5", {"hit_1": samples, "hit_2": samples}, (NOON, NOON + timedelta(seconds=60)))
    assert not read(path, tmp_path, HAMMER).errors
    train = RawDescription((replace(FORCE, quantity="ignored"), RAIL), kind="passage", rate=RATE)
    result = read(path, tmp_path, train)
    (error,) = result.errors
    assert [r.record for r in result.recordings] == [0] and error.reason == "duplicate"
    assert "record 2: its samples are those of record 1" in str(error)
    source, _, raw = read_unconverted("a.h5", tmp_path)
    assert [str(e) for e in errors_without_layout(raw, source)] == [str(error)]


PULSE = np.zeros(2000)
PULSE[100:110] = 1000.0 * np.hanning(10)


@pytest.mark.parametrize("force", [PULSE, *(np.cos(np.arange(2000) / x) for x in (2.0, 3.0, 7.0, 50.0))])
def test_equal_pulses_or_tones_without_noise_are_accepted(tmp_path, force):
    groups = {f"hit_{k}": {"force": force, "rail": noise(2000, k)[0]} for k in (1, 2)}
    assert not read(with_groups(tmp_path / "a.h5", groups), tmp_path, HAMMER).errors


@pytest.mark.parametrize(
    "starts, n_record",
    [
        ((), 0),
        ((NOON, NOON), 0),
        ((NOON, NOON + timedelta(seconds=0.3)), 0),
        ((NOON, NOON + timedelta(seconds=0.9)), 2),
    ],
)
def test_records_of_trains_must_not_overlap_by_their_starts(tmp_path, starts, n_record):
    groups = {name: {"rail": noise(2000, k)[0]} for k, name in enumerate(("left", "right"))}
    result = read(with_groups(tmp_path / "a.h5", groups, starts), tmp_path, TRAIN)
    assert len(result.recordings) == n_record
    assert [e.reason for e in result.errors] == ["wrong_time"] * (2 - n_record)
