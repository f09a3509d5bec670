"""Continuous records cut into passages: where, how many, and with how much memory."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.passage_truth import IC3, RATE, rolling

from turnout.passage.continuous import cut_passages


def record(starts, speeds, length, seed=1):
    """(2, n) noise with a train at each start [s]."""
    rng = np.random.default_rng(seed)
    samples = 0.02 * rng.standard_normal((2, int(length * RATE)))
    for start, speed in zip(starts, speeds):
        train = rolling(rng, IC3, speed, (0.0, 4.0), lead=0.0, noise=0.0).samples
        first = int(start * RATE)
        train = train[:, : samples.shape[1] - first]
        samples[:, first : first + train.shape[1]] += train
    return samples


@pytest.mark.parametrize("block", [0.37, 5.0, 90.0])
def test_every_train_is_in_one_piece_with_its_margins_whatever_the_blocks(block, settings):
    samples = record((12.0, 31.0, 60.0), (40.0, 20.0, 33.0), 80.0)
    n = int(block * RATE)
    blocks = (samples[:, k : k + n] for k in range(0, samples.shape[1], n))
    pieces = list(cut_passages(blocks, RATE, settings))
    assert len(pieces) == 3 and all(p.whole for p in pieces)
    for piece, start, speed in zip(pieces, (12.0, 31.0, 60.0), (40.0, 20.0, 33.0)):
        assert piece.start / RATE == pytest.approx(start - settings.margin, abs=0.15)
        stop = (piece.start + piece.samples.shape[1]) / RATE
        assert stop == pytest.approx(start + (IC3[-1] + 4.0) / speed + settings.margin, abs=0.2)
        assert np.array_equal(
            piece.samples, samples[:, piece.start : piece.start + piece.samples.shape[1]].astype(np.float32)
        )


def test_a_train_that_the_record_cuts_off_is_handed_over_as_far_as_it_goes(settings):
    samples = record((19.0,), (40.0,), 20.0)
    pieces = list(cut_passages([samples], RATE, settings))
    assert len(pieces) == 1
    assert pieces[0].start + pieces[0].samples.shape[1] == samples.shape[1]


def test_a_quiet_record_has_no_passages(settings):
    assert list(cut_passages([0.02 * np.random.default_rng(3).standard_normal((3, 400000))], RATE, settings)) == []


def test_what_is_longer_than_may_be_kept_is_cut_and_says_so(settings):
    short = replace(settings, longest=10.0)
    rng = np.random.default_rng(4)
    samples = 0.02 * rng.standard_normal((1, int(60 * RATE)))
    samples[:, int(20 * RATE) : int(45 * RATE)] += rng.standard_normal((1, int(25 * RATE)))
    pieces = list(cut_passages(np.array_split(samples, 30, axis=1), RATE, short))
    assert [p.whole for p in pieces] == [False, False, True]
    assert all(p.samples.shape[1] <= (short.longest + 2.2) * RATE for p in pieces)


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
