"""Samples of a channel of a lower rate that are repeated up to the rate of the file are an error."""

import numpy as np
import pytest

from turnout.readers import read
from turnout.readers.source import BLOCK_SIZE
from turnout.records import RawChannel, RawDescription

RNG = np.random.default_rng(20261128)
CHANNELS = (
    RawChannel("force", "force", "force", "N"),
    RawChannel("rail", "rail", "acceleration", "m/s²"),
    RawChannel("air", "air", "temperature", "°C"),
)


def reasons(tmp_path, rail, n=6000, kind="passage", **options):
    air = np.repeat(RNG.normal(size=n // 100 + 1), 100)[:n] + 12.0
    np.savez(tmp_path / "a.npz", force=RNG.normal(size=n), rail=rail, air=air, rate=1000.0)
    result = read("a.npz", tmp_path, RawDescription(CHANNELS, rate=1000.0, kind=kind), **options)
    names = [[c.name for c in r.channels] for r in (*result.recordings, *result.long_recordings)]
    return names, [(error.reason, error.where.rpartition(" ")[2]) for error in result.errors]


@pytest.mark.parametrize("hold", [2, 3, 4, 10])
@pytest.mark.parametrize("lag", [0, 1])
def test_a_channel_with_repeated_samples_is_left_out_of_a_passage(tmp_path, hold, lag):
    rail = np.repeat(RNG.normal(size=6000 // hold + 2), hold)[lag : 6000 + lag]
    assert reasons(tmp_path, rail) == ([["force", "air"]], [("wrong_rate", "'rail'")])
    assert reasons(tmp_path, rail, kind="hammer") == ([], [("wrong_rate", "'rail'")])


def test_a_force_with_repeated_samples_is_an_error_of_the_record(tmp_path):
    force = np.repeat(RNG.normal(size=3000), 2)
    np.savez(tmp_path / "a.npz", force=force, rail=RNG.normal(size=6000), rate=1000.0)
    result = read("a.npz", tmp_path, RawDescription(CHANNELS[:2], rate=1000.0, kind="hammer"))
    assert not result.recordings and [error.reason for error in result.errors] == ["wrong_rate"]


def test_repeated_samples_are_found_in_a_record_that_is_read_in_parts(tmp_path):
    n = BLOCK_SIZE + 5000
    rail = np.repeat(RNG.normal(size=n // 4 + 1), 4)[:n]
    assert reasons(tmp_path, rail, n, max_duration=1.0, max_whole_file_size=0)[1] == [("wrong_rate", "'rail'")]


def test_coarse_numbers_and_a_quiet_channel_are_not_reported_as_repeated_samples(tmp_path):
    x = RNG.normal(size=6000)
    x[:4500] = np.repeat(x[:1500], 3)  # then at the rate of the file
    quiet = np.zeros(6000)
    quiet[1000:1040:2] = 1.0
    few = np.zeros(6000)
    few[1000:1040] = np.repeat(np.tile([1.0, 0.0], 10), 2)
    late = np.repeat(x[:3000], 2)
    late[4300:4302] = late[4301:4303].copy()  # one change at an odd number of samples
    for rail in (few, late, x, np.round(x), np.round(np.sin(np.arange(6000) / 50.0) * 3.0), quiet):
        assert reasons(tmp_path, rail) == ([["force", "rail", "air"]], [])
