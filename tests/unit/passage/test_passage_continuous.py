"""Continuous records are cut into passages: positions, number and memory."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, PATTERNS, RATE, rolling_noise, sensors_for

from turnout.passage.analysis import analyse
from turnout.passage.segmentation import cut_passages
from turnout.readers import read
from turnout.readers.writing import write
from turnout.records import Channel, RawChannel, RawDescription, Recording
from turnout.stages.passage import trains_in


def record(starts, speeds, length, seed=1):
    """(2, n) noise with a train at each start [s]."""
    rng = np.random.default_rng(seed)
    samples = 0.02 * rng.standard_normal((2, int(length * RATE)))
    for start, speed in zip(starts, speeds):
        train = rolling_noise(rng, IC3, speed, (0.0, 4.0), lead=0.0, noise=0.0).samples
        first = int(start * RATE)
        train = train[:, : samples.shape[1] - first]
        samples[:, first : first + train.shape[1]] += train
    return samples


@pytest.mark.parametrize("block", [0.37, 5.0, 90.0])
def test_every_train_is_in_one_piece_with_its_margins_for_any_size_of_blocks(block, settings):
    samples = record((12.0, 31.0, 60.0), (40.0, 20.0, 33.0), 80.0)
    n = int(block * RATE)
    blocks = (samples[:, k : k + n] for k in range(0, samples.shape[1], n))
    pieces = list(cut_passages(blocks, RATE, settings))
    assert len(pieces) == 3 and all(p.is_whole for p in pieces)
    for piece, start, speed in zip(pieces, (12.0, 31.0, 60.0), (40.0, 20.0, 33.0)):
        assert piece.start / RATE == pytest.approx(start - settings.margin, abs=0.15)
        stop = (piece.start + piece.samples.shape[1]) / RATE
        assert stop == pytest.approx(start + (IC3[-1] + 4.0) / speed + settings.margin, abs=0.2)
        assert np.array_equal(
            piece.samples, samples[:, piece.start : piece.start + piece.samples.shape[1]].astype(np.float32)
        )


def test_a_train_that_the_record_cuts_off_is_returned_as_far_as_recorded(settings):
    samples = record((19.0,), (40.0,), 20.0)
    pieces = list(cut_passages([samples], RATE, settings))
    assert len(pieces) == 1
    assert pieces[0].start + pieces[0].samples.shape[1] == samples.shape[1]


def test_a_quiet_record_has_no_passages(settings):
    assert list(cut_passages([0.02 * np.random.default_rng(3).standard_normal((3, 400000))], RATE, settings)) == []


def test_a_passage_longer_than_the_limit_is_cut_and_marked(settings):
    short = replace(settings, longest=10.0)
    rng = np.random.default_rng(4)
    samples = 0.02 * rng.standard_normal((1, int(60 * RATE)))
    samples[:, int(20 * RATE) : int(45 * RATE)] += rng.standard_normal((1, int(25 * RATE)))
    pieces = list(cut_passages(np.array_split(samples, 30, axis=1), RATE, short))
    assert [p.is_whole for p in pieces] == [False, False, True]
    assert all(p.samples.shape[1] <= (short.longest + 2.2) * RATE for p in pieces)


@pytest.mark.parametrize(("before", "lasts"), [(200.0, 150.0), (30.0, 100.0), (4.0, 40.0)])
def test_a_long_train_is_detected_from_its_start_to_its_end(before, lasts, settings):
    """A freight train of 700 m at 17 km/h; another one shortly after a file began."""
    rate, rng = 2000.0, np.random.default_rng(6)
    samples = 0.1 * rng.standard_normal((2, int((before + lasts + 20.0) * rate)))
    samples[:, int(before * rate) : int((before + lasts) * rate)] *= 30.0
    (piece,) = cut_passages([samples], rate, settings)
    stop = (piece.start + piece.samples.shape[1]) / rate
    assert piece.start / rate == pytest.approx(before - settings.margin, abs=0.1)
    assert stop == pytest.approx(before + lasts + settings.margin, abs=0.1)


def test_permanent_noise_becomes_the_quiet_level(settings):
    """A machine beside the track runs until the record ends. One piece of the longest duration is cut, not many."""
    rate, rng = 2000.0, np.random.default_rng(7)
    samples = 0.1 * rng.standard_normal((1, int(600.0 * rate)))
    samples[:, int(60.0 * rate) :] *= 4.0
    pieces = list(cut_passages([samples], rate, settings))
    assert not pieces[0].is_whole
    assert sum(p.samples.shape[1] for p in pieces) < (settings.longest + settings.chunk + 10.0) * rate


def test_memory_does_not_grow_with_the_record(settings):
    """5 s blocks of 4 channels: 3.2 MB each as float64. Ten times the record, the same peak within a block."""
    peaks = []
    for n_block in (4, 40):
        rng = np.random.default_rng(5)
        blocks = (0.02 * rng.standard_normal((4, int(5 * RATE))) for _ in range(n_block))
        tracemalloc.start()
        assert list(cut_passages(blocks, RATE, settings)) == []
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 4e6


def continuous_file(folder, format, starts=(12.0, 28.6, 55.0), length=70.0):
    """A file of one long record: the second train is at the border of two blocks, at 30 s."""
    channels = (Channel("c0", "acceleration", 0.0), Channel("c1", "acceleration", 4.0))
    recording = Recording(record(starts, (40.0, 20.0, 33.0), length), RATE, channels, "passage")
    return write([recording], folder / f"x.{format}", {"uff": "uff58b"}.get(format, format)).name


DESCRIBED = RawDescription(
    (RawChannel("c0", "c0", "acceleration", position=0.0), RawChannel("c1", "c1", "acceleration", position=4.0)),
    kind="passage",
    rate=RATE,
)


@pytest.mark.parametrize("format", ["hdf5", "tdms", "uff", "wav"])
def test_passages_of_a_file_read_in_stretches_are_those_of_the_file_read_whole(format, settings, tmp_path):
    name = continuous_file(tmp_path, format)
    short = replace(settings, longest=20.0, chunk=10.0)
    (whole,) = read(name, tmp_path, DESCRIBED).recordings
    (long,) = read(name, tmp_path, DESCRIBED, short.longest, max_whole_file_size=0).long_recordings
    of_whole, of_long = list(trains_in(whole, short)), list(trains_in(long, short))
    assert [late for _, late, _ in of_whole] == pytest.approx([11.0, 27.6, 54.0], abs=0.15)
    assert of_whole[1][1] < 30.0 < of_whole[1][1] + of_whole[1][0].duration
    assert [(late, key) for _, late, key in of_whole] == [(late, key) for _, late, key in of_long]
    sensors = sensors_for(whole)
    for (one, _, _), (other, _, _) in zip(of_whole, of_long):
        assert np.array_equal(one.samples, other.samples) and one.channels == other.channels
        first, second = (analyse(part, sensors, PATTERNS, settings) for part in (one, other))
        assert first.n_axle == len(IC3) and repr(first) == repr(second)


def test_a_file_is_cut_in_memory_that_does_not_grow_with_it(settings, tmp_path):
    """2 channels of 20 kHz: 3.2 MB in 10 s as float64. 60 s or 240 s of it, the same peak within one such block."""
    short, peaks = replace(settings, longest=20.0), []
    for length in (60.0, 240.0):
        folder = tmp_path / f"{length:g}"
        folder.mkdir()
        name = continuous_file(folder, "hdf5", (12.0,), length)
        tracemalloc.start()
        (long,) = read(name, folder, DESCRIBED, short.longest, max_whole_file_size=0).long_recordings
        assert len(list(trains_in(long, short))) == 1
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 3.2e6
    assert peaks[1] < 240.0 * RATE * 2 * 8 / 2
