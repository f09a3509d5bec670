"""Remove spikes from the channels of a recording: single samples that no vibration behind a recorder's filter can have.

A bit error of a converter or a radio link changes one sample. The filter before a converter spreads every vibration,
also that of a broken wheel, over several.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import MAD_TO_SD
from turnout.records import Recording, Rejection
from turnout.signal.converter import converter_step

if TYPE_CHECKING:
    from collections.abc import Container

SPIKE_FACTOR = 8.0  # least height of a spike, in units of the bends before and behind it
SPIKE_REACH = 8  # samples before and behind a spike with which it is compared
MAX_LARGE_BENDS = 2  # on either side: that of the spike itself, and that of another disturbance
NOISE_FACTOR = 5.0  # the same in standard deviations of the noise
LOUD_QUANTILE = 0.99  # of the magnitudes of a channel: smaller spikes change no result


def without_spikes(
    recording: Recording, names: Container[str] | None = None
) -> tuple[Recording, tuple[Rejection, ...]]:
    r"""The recording with straight lines in place of its spikes, and the findings.

    A sample is a spike if both neighbours lie on the same side of it, and its height h over the nearer one is larger
    than 99 % of the magnitudes of its channel. It is also larger than ``NOISE_FACTOR`` standard deviations of the
    quieter half of the channel, and than ``SPIKE_FACTOR`` times the third largest bend b of the 8 samples before it and
    of the 8 behind it, since an impact is followed by the vibration that it causes. The impact of a wheel moves more
    samples than one. So the neighbours of a spike bend by as little with their mean in its place, and exceed the
    vibration, the third largest of these 8 magnitudes about their median, by as little.

    .. math:: h_n = \min(|x_n - x_{n-1}|,\ |x_n - x_{n+1}|), \qquad b_n = |x_n - \tfrac12 (x_{n-1} + x_{n+1})|

    A vibration of a tenth of the sampling rate bends by a fifth of its amplitude, one of a thirtieth by 2 %. A channel
    that is constant or not finite stays as it is.

    Parameters
    ----------
    recording : Recording
        Any recording.
    names : container of str, optional
        Of the channels that are searched, by default all; others stay as they are.

    Returns
    -------
    recording : Recording
        The same object where nothing is cut.
    findings : tuple of Rejection
        One finding "spikes" per channel that has some.
    """
    samples, findings = None, []
    for row, channel in enumerate(recording.channels):
        at = spikes_in(recording.samples[row]) if names is None or channel.name in names else np.zeros(0, dtype=int)
        if not at.size:
            continue
        samples = recording.samples.copy() if samples is None else samples
        valid = np.setdiff1d(np.arange(recording.n_sample), at)
        samples[row, at] = np.interp(at, valid, samples[row, valid])
        first = float(at[0] / recording.rate)
        text = f"{channel.name}: {at.size} sample{'s' * (at.size > 1)} replaced, the first at {first:.3f} s"
        findings.append(Rejection("spikes", float(at.size), 0.0, text, channel.name, time=first))
    return (recording if samples is None else replace(recording, samples=samples)), tuple(findings)


def spikes_in(samples: np.ndarray) -> np.ndarray:
    """Indices of the samples of one channel that are spikes.

    Parameters
    ----------
    samples : (n_sample,) array of float
        Of one channel. [any]

    Returns
    -------
    (n,) array of int
        Ascending.

    Examples
    --------
    >>> y = np.sin(0.3 * np.arange(200.0))
    >>> y[[50, 120]] += 9.0
    >>> spikes_in(y)
    array([ 50, 120])
    """
    none = np.zeros(0, dtype=int)
    if samples.size <= 2 * SPIKE_REACH or not np.isfinite(samples).all() or np.ptp(samples) == 0.0:
        return none
    change = np.diff(samples)
    is_extreme = change[:-1] * change[1:] < 0.0
    heights, bends = np.zeros(samples.size), np.zeros(samples.size)
    heights[1:-1] = np.where(is_extreme, np.minimum(np.abs(change[:-1]), np.abs(change[1:])), 0.0)
    bends[1:-1] = 0.5 * np.abs(np.diff(change))
    magnitudes = np.abs(samples - np.median(samples))
    loud = np.flatnonzero(heights > NOISE_FACTOR * MAD_TO_SD * np.median(magnitudes))
    if loud.size:
        least = max(np.quantile(magnitudes, LOUD_QUANTILE), SPIKE_FACTOR * converter_step(samples))
        loud = loud[heights[loud] > least]
    if not loud.size:
        return none
    sides = np.stack([loud - SPIKE_REACH, loud + 1])
    limits = (
        _usual(_windows(bends, sides)),
        _bends_of_neighbours(samples, loud),
        _excess_of_neighbours(samples, loud),
    )
    return loud[heights[loud] > SPIKE_FACTOR * np.max(limits, axis=0)]


def _windows(samples: np.ndarray, first: np.ndarray) -> np.ndarray:
    """``SPIKE_REACH`` samples from each index on, mirrored at both ends."""
    padded = np.pad(samples, SPIKE_REACH, mode="reflect")
    return padded[SPIKE_REACH + first[..., None] + np.arange(SPIKE_REACH)]


def _usual(sides: np.ndarray) -> np.ndarray:
    """The third largest of the samples on each side, and of both sides the larger one."""
    return np.partition(sides, -MAX_LARGE_BENDS - 1, axis=-1)[..., -MAX_LARGE_BENDS - 1].max(axis=0)


def _excess_of_neighbours(samples: np.ndarray, at: np.ndarray) -> np.ndarray:
    """By how much the larger neighbour of each sample exceeds the vibration before and behind it."""
    sides = _windows(samples, np.stack([at - SPIKE_REACH, at + 1]))
    magnitudes = np.abs(sides - np.median(sides, axis=(0, 2), keepdims=True))
    return np.maximum(magnitudes[0, :, -1], magnitudes[1, :, 0]) - _usual(magnitudes)


def _bends_of_neighbours(samples: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The larger bend of the two neighbours of each sample, with their mean in its place."""
    padded = np.pad(samples, 2, mode="edge")
    before, last, following, after = (padded[2 + at + k] for k in (-2, -1, 1, 2))
    mean = 0.5 * (last + following)
    return np.maximum(np.abs(last - 0.5 * (before + mean)), np.abs(following - 0.5 * (mean + after)))
