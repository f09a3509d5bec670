"""Blocks of samples that are in a record twice, as where rows were appended again or a buffer was written twice."""

from itertools import pairwise

import numpy as np

MIN_BLOCK = 128  # samples: noise never repeats so many to the last digit
WINDOW_STEPS = (1, 2, 4, 8)  # samples; doubled four times, a key belongs to 16 samples
KEY_FACTOR = np.uint64(0x9E3779B97F4A7C15)  # odd, without a pattern: it spreads every bit over those above it
ONE_OF = np.uint64(64 - 3)  # shift: one key in eight is compared, the same ones in both copies of a block
MIN_DIFFERENT = 100  # windows of a block: fewer are those of a constant or of a short period
MIN_TURNS = 0.2  # share of samples at which a channel turns: noise turns at 0.67, a tone of 10 samples at 0.2
MAX_LAGS = 4  # distances between equal windows, the most frequent ones, that are examined


def repeated_block(samples: np.ndarray) -> tuple[int, int, int] | None:
    """The longest block of samples that a record holds a second time, equal on all channels to the last bit.

    Parameters
    ----------
    samples : (n_channel, n_sample) array of float
        Samples of the channels.

    Returns
    -------
    tuple of (int, int, int) or None
        First sample of the block, first sample of its copy, number of samples; None without a repeated block. Signals
        without noise may be periodic: they have none.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(size=(2, 1000))
    >>> repeated_block(noise), repeated_block(np.hstack([noise[:, :700], noise[:, 300:]]))
    (None, (300, 700, 400))
    """
    bits = np.ascontiguousarray(samples, dtype=float).view(np.uint64)
    if bits.shape[1] < 2 * MIN_BLOCK:
        return None
    keys = _window_keys(bits)
    chosen = np.flatnonzero(keys >> ONE_OF == 0)
    order = np.argsort(keys[chosen], kind="stable")
    chosen, sorted_keys = chosen[order], keys[chosen][order]
    lags = np.diff(chosen)[sorted_keys[1:] == sorted_keys[:-1]]
    values, counts = np.unique(lags[lags >= MIN_BLOCK], return_counts=True)
    blocks = [_block_at(bits, int(lag)) for lag in values[np.argsort(-counts, kind="stable")][:MAX_LAGS]]
    noisy = [
        (start, copy, n) for start, copy, n in blocks if n >= MIN_BLOCK and is_noisy(samples[:, start : start + n])
    ]
    return max(noisy, key=lambda block: block[2], default=None)


def is_noisy(block: np.ndarray) -> bool:
    """Whether samples hold noise, so that no other measurement equals them.

    Parameters
    ----------
    block : (n_channel, n_sample) array of float
        Samples of the channels.

    Returns
    -------
    bool
        False for a constant, for a tone, for a signal of a short period and for fewer than three samples.
    """
    if block.shape[1] < 3:
        return False
    steps = np.sign(np.diff(block, axis=1))
    if not np.any(np.mean(steps[:, 1:] * steps[:, :-1] < 0, axis=1) > MIN_TURNS):
        return False
    return len(np.unique(_window_keys(np.ascontiguousarray(block, dtype=float).view(np.uint64)))) >= MIN_DIFFERENT


def _window_keys(bits: np.ndarray) -> np.ndarray:
    """One number for each window of 16 samples of all channels; equal windows have equal numbers."""
    keys = np.zeros(bits.shape[1], dtype=np.uint64)
    for channel in bits:
        keys = (keys + (channel ^ channel >> np.uint64(32))) * KEY_FACTOR
    for step in WINDOW_STEPS:
        keys = (keys[:-step] ^ keys[:-step] >> np.uint64(29)) * KEY_FACTOR + keys[step:]
    return (keys ^ keys >> np.uint64(32)) * KEY_FACTOR


def _block_at(bits: np.ndarray, lag: int) -> tuple[int, int, int]:
    """First sample, that of the copy and size of the longest block that is repeated ``lag`` samples later."""
    is_equal = np.all(bits[:, lag:] == bits[:, :-lag], axis=0)
    ends = np.flatnonzero(~np.concatenate(([False], is_equal, [False])))
    start, length = max(((a, b - a - 1) for a, b in pairwise(ends.tolist())), key=lambda run: run[1])
    return start, start + lag, min(length, lag)
