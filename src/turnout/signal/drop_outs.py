"""Find drop-outs of a channel: stretches that repeat one value while the channel moves before and behind them.

A radio link or a full buffer loses a block of samples. The logger then writes zeros, or holds the last value.
"""

from __future__ import annotations

import numpy as np

from turnout.signal.converter import converter_step

MIN_RUN = 20  # equal samples in a row that count as a drop-out
MIN_STEPS = 4.0  # standard deviation of the samples on either side, in steps of the converter
RUN_FACTOR = 5.0  # least length of a drop-out, in units of the longest run before it and of that behind it


def drop_outs(samples: np.ndarray) -> np.ndarray:
    """First and last index + 1 of each drop-out of a channel.

    A drop-out is a run of ``MIN_RUN`` equal samples or more. As many samples before it, and as many behind it, have no
    run longer than 1 / ``RUN_FACTOR`` of it: a quiet channel repeats its values everywhere. Both also vary by
    ``MIN_STEPS`` steps of the converter or more, since a coarse channel stays at one step by chance. The run begins
    with a change of so many steps, or its value is so far from the median of the channel: a vibration that a coarse
    converter no longer resolves ends gradually, at the median. Runs at the top or bottom of the channel are
    clipped, and those at the ends of a recording are a sensor that starts late or is lost.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Of one channel. [any]

    Returns
    -------
    (n, 2) array of int
        Ascending.

    Examples
    --------
    >>> y = np.sin(0.3 * np.arange(400.0))
    >>> y[100:160] = 0.0
    >>> drop_outs(y)
    array([[100, 160]])
    """
    if samples.size <= MIN_RUN or not np.isfinite(samples).all():
        return np.zeros((0, 2), dtype=int)
    starts = np.append(0, np.flatnonzero(np.diff(samples)) + 1)
    stops = np.append(starts[1:], samples.size)
    lengths, (low, high) = stops - starts, (samples.min(), samples.max())
    least = MIN_STEPS * converter_step(samples)
    is_candidate = (lengths >= MIN_RUN) & (samples[starts] > low) & (samples[starts] < high)
    first_changes = np.abs(samples[starts] - samples[starts - 1])  # of no use in the first run, which is no candidate
    is_candidate &= np.maximum(first_changes, np.abs(samples[starts] - np.median(samples))) >= least
    stretches = []
    for k in np.flatnonzero(is_candidate):
        start, stop, length = starts[k], stops[k], lengths[k]
        if start < length or samples.size - stop < length:
            continue
        windows = samples[start - length : start], samples[stop : stop + length]
        if max(map(_longest_run, windows)) * RUN_FACTOR <= length and min(map(np.std, windows)) >= least:
            stretches.append((start, stop))
    return np.array(stretches, dtype=int).reshape(-1, 2)


def _longest_run(samples: np.ndarray) -> int:
    """Length of the longest run of equal samples."""
    edges = np.flatnonzero(np.diff(samples)) + 1
    return int(np.max(np.diff(np.concatenate([[0], edges, [samples.size]]))))
