"""Electrical pulses: what all sensors of a turnout show at one moment did not come along the rail.

The fastest wave in a rail takes 0.4 ms from one sensor to the next two metres on, a wheel 100 times as long.
"""

from dataclasses import replace

import numpy as np
from scipy import ndimage

from turnout.records import Recording, Rejection

TIMES = 8.0  # a pulse is so many times what a thousandth of a channel's samples exceed
SAME, APART = 2e-4, 2.0  # s within which, and m over which, it is heard everywhere
AROUND, LONGEST = 3e-3, 1e-2  # s: a filter's ringing on both sides of a pulse, and the longest that is one


def without_pulses(recording: Recording, sensors) -> tuple[Recording, tuple[Rejection, ...]]:
    """The recording with straight lines in place of its electrical pulses, and what was found.

    ``sensors`` are PassageSensors; nothing is cut where those that live are less than 2 m apart. A channel that is
    dead or not finite is left as it is and has no say.
    """
    places = {s.name: s.position for s in sensors}
    rows = [i for i, c in enumerate(recording.channels) if c.name in places and _lives(recording.samples[i])]
    if len(rows) < 2 or np.ptp([places[recording.channels[i].name] for i in rows]) < APART:
        return recording, ()
    near = 2 * max(round(SAME * recording.rate), 1) + 1
    shared = np.ones(recording.n_sample, dtype=bool)
    for i in rows:
        size = np.abs(recording.samples[i] - np.median(recording.samples[i]))
        shared &= ndimage.maximum_filter1d(size, near) > TIMES * np.quantile(size, 0.999)
        if not shared.any():
            return recording, ()
    cut, n = _regions(shared, recording.rate)
    if not n:
        return recording, ()
    samples, at, kept = recording.samples.copy(), np.flatnonzero(cut), np.flatnonzero(~cut)
    for i in rows:
        samples[i, at] = np.interp(at, kept, samples[i, kept])
    text = f"all channels: {n} electrical pulse{'s' * (n > 1)} cut out, the first at {at[0] / recording.rate:.3f} s"
    return replace(recording, samples=samples), (Rejection("interference", float(n), 0.0, text),)


def _lives(samples) -> bool:
    return bool(np.isfinite(samples).all()) and np.ptp(samples) > 0.0


def _regions(shared, rate):
    """((n_sample,) bool to cut, number of pulses): pulses with their ringing, none that lasts too long."""
    label, _n = ndimage.label(ndimage.maximum_filter1d(shared, 2 * round(AROUND * rate) + 1))
    runs = ndimage.find_objects(label)
    short = [run for (run,) in runs if run.stop - run.start <= (LONGEST + 2 * AROUND) * rate]
    cut = np.zeros(shared.size, dtype=bool)
    for run in short:
        cut[run] = True
    return cut, len(short)
