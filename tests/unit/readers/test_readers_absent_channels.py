"""Files of passages that lack channels of the layout, as where each of two loggers records half of them."""

import numpy as np
import pytest

from turnout.errors import ReadError
from turnout.readers import read
from turnout.records import RawChannel, RawDescription

NAMES = ("OT", "SP", "A7", "A8")
SAMPLES = np.random.default_rng(2).normal(size=(4, 4000))


def channels(sources=NAMES):
    return tuple(RawChannel(n, source, "acceleration", "m/s²") for n, source in zip(NAMES, sources))


def result_of(tmp_path, names, sources=NAMES, kind="passage", **entries):
    np.savez(tmp_path / "a.npz", fs=5000.0, **dict(zip(names, SAMPLES)), **entries)
    return read("a.npz", tmp_path, RawDescription(channels(sources), kind=kind, rate=5000.0))


@pytest.mark.parametrize("names", [("OT", "SP"), ("A7", "A8"), ("A8",)])
def test_the_channels_of_one_of_two_loggers_are_read(names, tmp_path):
    result = result_of(tmp_path, names)
    (recording,), (error,) = result.recordings, result.errors
    assert tuple(c.name for c in recording.channels) == names
    np.testing.assert_allclose(recording.samples, SAMPLES[: len(names)])
    assert error.reason == "channel_missing" and all(repr(n) in str(error) for n in NAMES if n not in names)
    assert ("1 other channel is used" if len(names) == 1 else "2 other channels are used") in str(error)


@pytest.mark.parametrize(
    ("names", "sources", "entries"),
    [
        (("OT", "SP", "A7b"), NAMES, {}),  # one of them may be A7 under another name
        (("0", "1"), (0, 1, 2, 3), {}), (("x", "y"), NAMES, {}),
        (("OT", "SP"), NAMES, {"A7": np.array(["a"] * 4000)}), (("OT", "SP"), NAMES, {"remark": "A7"}),
    ],
)  # fmt: skip
def test_a_channel_that_may_be_there_under_another_name_is_an_error(names, sources, entries, tmp_path):
    with_error = None
    try:
        result = result_of(tmp_path, names, sources, **entries)
        with_error = result.errors[0]
        assert not result.recordings
    except ReadError as error:
        with_error = error
    assert with_error.reason == "channel_missing"


def test_a_hammer_test_needs_all_of_its_channels(tmp_path):
    result = result_of(tmp_path, ("OT", "SP"), kind="hammer")
    assert not result.recordings and result.errors[0].reason == "channel_missing"
