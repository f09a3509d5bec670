"""A matrix of numbers with the time in its first column, while the layout counts the channels without it."""

import numpy as np
import pytest
import scipy.io

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

RATE, N = 20000.0, 3000
T = np.arange(N) / RATE
FORCE, RAIL = np.random.default_rng(2).normal(size=(2, N)).round(4)
TIMES = {
    "seconds": T, "late": T + 17.25, "with a pre-trigger": T - 0.05, "ms": 1e3 * T, "index": np.arange(N),
    "since 1970": T + 1.7786e9,
    "jitter": T + 1e-7 * np.random.default_rng(4).normal(size=N), "single precision": T.astype(np.float32),
    "coarse clock": np.round(T, 3), "days": np.round(739750.4 + T / 86400, 9),
}  # fmt: skip


def write(path, time):
    matrix = np.c_[time, FORCE, RAIL]
    if path.suffix == ".mat":
        scipy.io.savemat(path, {"data": matrix, "fs": RATE})
    elif path.suffix == ".npz":
        np.savez(path, data=matrix, fs=RATE)
    else:
        path.write_text("".join(f"{t:.9f},{f},{a}\n" for t, f, a in matrix))


def outcome(path, first, *ignored):
    sensors = RawChannel("force", first, "force", "N"), RawChannel("rail", first + 1, "acceleration", "m/s²")
    others = tuple(RawChannel(f"other {i}", i, "ignored") for i in ignored)
    try:
        result = read(path.name, path.parent, RawDescription((*sensors, *others), rate=RATE))
    except ReadError as error:
        return [], error
    return [r.samples for r in result.recordings], (*result.errors, None)[0]


@pytest.mark.parametrize("file_name", ["a.csv", "a.mat", "a.npz"])
@pytest.mark.parametrize("kind", TIMES)
def test_a_time_is_never_read_as_a_channel(kind, file_name, tmp_path):
    write(tmp_path / file_name, TIMES[kind])
    recordings, error = outcome(tmp_path / file_name, 0)
    assert recordings == [] and error.reason in ("channel_unknown", "channel_missing")
    recordings, error = outcome(tmp_path / file_name, 0, 2)
    assert recordings == [] and error.reason in ("channel_unknown", "channel_missing")


@pytest.mark.parametrize("file_name", ["a.csv", "a.npz"])
@pytest.mark.parametrize("kind", ["seconds", "index", "jitter", "since 1970"])
def test_the_error_states_which_channel_is_the_time(kind, file_name, tmp_path):
    write(tmp_path / file_name, TIMES[kind])
    _, error = outcome(tmp_path / file_name, 0)
    if error.reason == "channel_unknown":
        assert "its channel 0 rises in equal steps" in error.problem and "Correct 'source' of 'force'" in error.remedy


@pytest.mark.parametrize("kind", ["seconds", "late", "ms", "index"])
def test_a_layout_that_counts_the_time_reads_the_channels(kind, tmp_path):
    write(tmp_path / "a.csv", TIMES[kind])
    recordings, error = outcome(tmp_path / "a.csv", 1)
    np.testing.assert_array_equal(recordings, [[FORCE, RAIL]])
    assert error is None


@pytest.mark.parametrize("kind", ["parabola", "quarter of a sine", "root"])
def test_a_slow_rise_of_a_force_in_coarse_steps_is_no_clock(kind, tmp_path):
    x = np.arange(N) / N
    rise = {"parabola": (0.2 + x) ** 2, "quarter of a sine": np.sin(1.4 * x), "root": 0.25 * np.sqrt(x)}[kind]
    np.savez(tmp_path / "a.npz", force=np.floor(200.0 * rise), rail=RAIL)
    sensors = RawChannel("force", "force", "force", "N"), RawChannel("rail", "rail", "acceleration", "m/s²")
    result = read("a.npz", tmp_path, RawDescription(sensors, rate=RATE))
    assert not result.errors and len(result.recordings[0].samples) == 2
