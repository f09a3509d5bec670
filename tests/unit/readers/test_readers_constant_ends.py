"""Rows at the ends of a record that repeat one value beside noise are no samples; digital silence is kept."""

from datetime import datetime

import h5py
import numpy as np
import pyarrow as pa
import pytest
import scipy.io
import soundfile
from nptdms import ChannelObject, TdmsWriter
from pyarrow import parquet

from turnout.readers import read
from turnout.records import RawChannel, RawDescription

CHANNELS = (RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²"))
RNG = np.random.default_rng(1)
N = 1200
RATE = 5000
FORCE, RAIL = (RNG.normal(size=(2, N)) * [[2.0], [0.3]]).round(4)
FORCE[300:310] += 5000.0
RAIL[302:] += 200.0 * np.exp(-np.arange(N - 302) / 40.0) * np.sin(np.arange(N - 302))


def padded(first=0, last=0, values=(0.0, 0.0)):
    return [np.r_[[v] * first, x, [v] * last] for x, v in zip((FORCE, RAIL), values)]


def read_npz(tmp_path, samples, **options):
    np.savez(tmp_path / "a.npz", force=samples[0], rail=samples[1], fs=float(RATE))
    result = read("a.npz", tmp_path, RawDescription(CHANNELS, rate=float(RATE), **options))
    assert all(error.reason == "entry_unknown" for error in result.errors)
    return result.recordings[0].samples, [error.problem.partition(" of ")[0] for error in result.errors]


@pytest.mark.parametrize("values", [(0.0, 0.0), (7.25, 0.5), (FORCE[-2] + 1e-9, 1e-12)])
@pytest.mark.parametrize("n", [32, 300])
def test_rows_that_repeat_one_value_beside_noise_are_left_out(n, values, tmp_path):
    for ends, problems in (
        ({"last": n}, [f"its last {n}"]),
        ({"first": n}, [f"its first {n}"]),
        ({"first": n, "last": n}, [f"its first {n}", f"its last {n}"]),
    ):
        samples, remarks = read_npz(tmp_path, padded(**ends, values=values))
        np.testing.assert_array_equal(samples, [FORCE, RAIL])
        assert remarks == problems


def write(name, tmp_path, force, rail):
    path = tmp_path / name
    if name.endswith("csv"):
        path.write_text("force;rail\n" + "".join(f"{f!r};{r!r}\n" for f, r in zip(force.tolist(), rail.tolist())))
    elif name.endswith("mat"):
        scipy.io.savemat(path, {"force": force, "rail": rail, "fs": float(RATE)})
    elif name.endswith("h5"):
        with h5py.File(path, "w") as file:
            file["force"], file["rail"], file["fs"] = force, rail, float(RATE)
    elif name.endswith("wav"):
        soundfile.write(path, np.c_[force, rail], RATE, subtype="DOUBLE")
    elif name.endswith("tdms"):
        with TdmsWriter(str(path)) as writer:
            writer.write_segment(
                ChannelObject("g", k, x, {"wf_increment": 1.0 / RATE}) for k, x in (("force", force), ("rail", rail))
            )
    else:
        parquet.write_table(pa.table({"force": force, "rail": rail}), path)


@pytest.mark.parametrize("name", ["a.csv", "a.mat", "a.h5", "a.wav", "a.tdms", "a.parquet"])
def test_all_formats_leave_out_such_rows(name, tmp_path):
    write(name, tmp_path, *padded(last=300))
    sources = ("0", "1") if name == "a.wav" else ("force", "rail")
    channels = [RawChannel(c.name, source, c.quantity, c.unit) for c, source in zip(CHANNELS, sources)]
    result = read(name, tmp_path, RawDescription(tuple(channels), rate=float(RATE)))
    np.testing.assert_allclose(result.recordings[0].samples, [FORCE, RAIL], rtol=1e-12)
    assert ["its last 300 of 1500 samples" in error.problem for error in result.errors] == [True]


def test_the_start_is_that_of_the_first_measured_sample_and_a_long_record_has_the_same_samples(tmp_path):
    write("a.h5", tmp_path, *padded(first=100, last=300))
    with h5py.File(tmp_path / "a.h5", "a") as file:
        file.attrs["start_time"] = "2026-05-13T08:30:00"
    description = RawDescription(CHANNELS, rate=float(RATE), kind="passage")
    whole = read("a.h5", tmp_path, description).recordings[0]
    long = read("a.h5", tmp_path, description, max_duration=0.01, max_whole_file_size=0).long_recordings[0]
    assert whole.started_at == long.started_at == datetime(2026, 5, 13, 8, 30, 0, 20000)
    assert whole.n_sample == long.n_sample == N
    np.testing.assert_array_equal(long.read(0, N), [FORCE, RAIL])


def silent_until(x, limit, step):
    return np.where(np.abs(x) < limit, 0.0, np.round(x / step) * step)


RINGING = 100.0 * np.exp(-np.arange(N) / 90.0) * np.sin(2.4 * np.arange(N))
FAST = np.round(1000.0 * np.minimum(1.0, np.exp((300 - np.arange(N)) / 8.0)) * np.sin(2.4 * np.arange(N)))
SLOW = 100.0 * np.sin(0.05 * np.arange(N) + 0.3)


@pytest.mark.parametrize(
    "samples",
    [
        padded(last=31),
        [np.r_[FORCE, np.zeros(300)], np.r_[RAIL, RNG.normal(size=300)]],
        [np.round(FORCE / 20.0) * 20.0, np.round(RAIL / 5.0) * 5.0],
        [np.r_[np.zeros(300), silent_until(x, 5.0 * s, s), np.zeros(300)] for x, s in ((FORCE, 20.0), (RAIL, 2.0))],
        [np.r_[FORCE[300:310], np.zeros(N - 10)], np.round(RINGING)],
        [np.r_[FORCE[300:310], np.zeros(N - 10)], FAST],
        [np.r_[np.zeros(300), FORCE[300:310], np.zeros(N - 10)], np.r_[np.zeros(300), RINGING]],
        [np.r_[FORCE[300:310], np.zeros(N + 290)], np.r_[SLOW, np.zeros(300)]],
        [np.r_[np.zeros(300), x[:280], np.zeros(300), x[280:]] for x in (FORCE, RAIL)],
        [np.r_[x[:100], np.zeros(N)] for x in (FORCE, RAIL)],
    ],
    ids=["few", "one_channel", "coarse", "silence", "decay", "fast", "computed", "slow", "gaps", "short"],
)
def test_samples_that_may_be_measured_are_kept(samples, tmp_path):
    np.testing.assert_array_equal(read_npz(tmp_path, samples)[0], samples)


@pytest.mark.parametrize("order", [1, -1])
def test_a_passage_that_ends_or_begins_in_an_overload_is_kept(order, tmp_path):
    noise = RAIL if order > 0 else RAIL[:301]
    rail = np.r_[noise, np.full(300, RAIL.max() + 1.0)][::order]
    np.savez(tmp_path / "a.npz", rail=rail, fs=float(RATE))
    result = read("a.npz", tmp_path, RawDescription(CHANNELS[1:], rate=float(RATE), kind="passage"))
    np.testing.assert_array_equal(result.recordings[0].signal("rail"), rail)


@pytest.mark.parametrize("name", ["a.csv", "a.mat", "a.h5", "a.tdms", "a.parquet"])
@pytest.mark.parametrize("value", [0.0, RAIL[-2], -0.125])
def test_an_acceleration_that_falls_silent_beside_others_is_reported(name, value, tmp_path):
    for n_first, n_last in ((0, 300), (100, 0), (100, 300)):
        rail = RAIL.copy()
        rail[:n_first], rail[N - n_last :] = value, value
        write(name, tmp_path, FORCE, rail)
        result = read(name, tmp_path, RawDescription(CHANNELS, rate=float(RATE)))
        np.testing.assert_allclose(result.recordings[0].samples, [FORCE, rail], rtol=1e-12)
        ends = [f"its {end} {n} of {N} samples" for end, n in (("first", n_first), ("last", n_last)) if n]
        assert [error.problem.partition(" repeat")[0] for error in result.errors] == ends
        assert all("channel 'rail'" in str(error) for error in result.errors)


def test_a_force_in_the_window_of_an_analyser_is_not_reported(tmp_path):
    force = np.where(np.arange(N) < 340, FORCE, 0.0)
    samples, remarks = read_npz(tmp_path, [force, RAIL])
    np.testing.assert_array_equal(samples, [force, RAIL])
    assert not remarks
