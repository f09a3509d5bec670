"""The faults of real life, put into sound recordings: each one a function of a recording and its channel range."""

from dataclasses import replace

import numpy as np


def dead_channel(recording):
    """The accelerometer's cable is off: zeros and half a bit of noise."""
    samples = recording.samples.copy()
    samples[1] = 0.0
    return replace(recording, samples=samples)


def swapped_sign(recording):
    """The hammer's charge amplifier is connected the wrong way round."""
    samples = recording.samples.copy()
    samples[0] = -samples[0]
    return replace(recording, samples=samples)


def overload(recording, share=0.6):
    """Range set too low: everything above ``share`` of the peak acceleration is the rail code."""
    samples = recording.samples.copy()
    limit = share * np.max(np.abs(samples[1]))
    samples[1] = np.clip(samples[1], -limit, limit)
    return replace(recording, samples=samples)


def not_a_number(recording):
    """A logger that lost its converter for a moment."""
    samples = recording.samples.copy()
    samples[1, samples.shape[1] // 3 : samples.shape[1] // 3 + 5] = np.nan
    return replace(recording, samples=samples)


def cut_off(path, share=0.55):
    """A copy that broke off: only the first part of the file's bytes."""
    size = path.stat().st_size
    with open(path, "r+b") as file:
        file.truncate(int(share * size))
