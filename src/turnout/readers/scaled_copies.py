"""Channels with the same noise but for a factor and an offset: one signal in other units or with another zero."""

from collections.abc import Iterator, Sequence

import numpy as np

from turnout.readers.repeated_blocks import MIN_BLOCK, is_noisy

N_COMPARED = 4096  # samples at the beginning
N_PARTS = 16  # of a signal
MIN_CHANGING_SHARE = 0.25  # of the samples of each part differ from the one before


def scaled_copies(columns: Sequence[np.ndarray]) -> Iterator[tuple[int, int, float]]:
    r"""Pairs of signals of which one is the other times a factor, but for the rounding and an offset.

    They rise and fall at the same samples, or at all of them the other way round. The noise of two sensors agrees in
    this by chance at one of two samples.

    Parameters
    ----------
    columns : sequence of (n_sample,) array
        Samples of each signal.

    Yields
    ------
    tuple of (int, int, float)
        The earlier and the later signal, and the factor from the former to the latter. Signals without noise, and
        shorter ones than 128 samples, are no copies.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(size=(2, 1000))
    >>> [(i, j, round(c, 3)) for i, j, c in scaled_copies([noise[0], noise[1], np.round(9.81 * noise[0], 2)])]
    [(0, 2, 9.81)]
    """
    n = min((len(column) for column in columns), default=0)
    n = min(n, N_COMPARED)
    if len(columns) < 2 or n <= MIN_BLOCK:
        return
    heads = np.array([column[:n] for column in columns], dtype=float)
    signs = np.sign(np.diff(heads, axis=1)).astype(np.float32)
    difference = signs @ signs.T  # samples at which both turn alike, less those at which they differ
    n_both = np.abs(signs) @ np.abs(signs).T
    are_alike = np.triu((np.abs(difference) == n_both) & (n_both >= MIN_BLOCK), k=1)
    for i, j in np.argwhere(are_alike).tolist():
        if all(is_noisy(heads[k][None]) and _is_never_silent(signs[k]) for k in (i, j)):
            x, y = heads[i] - heads[i].mean(), heads[j] - heads[j].mean()
            yield i, j, float(x @ y / (x @ x))


def _is_never_silent(signs: np.ndarray) -> bool:
    """Whether a signal has noise in its quiet parts, too: computed impacts, and coarse ones, have one shape."""
    return all(np.mean(signs_of_part != 0.0) >= MIN_CHANGING_SHARE for signs_of_part in np.array_split(signs, N_PARTS))
