"""Remove electrical pulses from the channels of a passage: they appear at all sensors at one moment.

The fastest wave in a rail takes 0.4 ms over the two metres between neighbouring sensors, and a wheel takes 100 times as
long.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from turnout.records import Recording, Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.passage.result import PassageSensor


PULSE_FACTOR = 8.0  # least height of a pulse, in units of the 99.9 % quantile of the channel
MAX_PULSE_DELAY, MIN_SENSOR_SPAN = 2e-4, 2.0  # s: largest delay between sensors; m: least span of the sensors
PULSE_MARGIN, MAX_PULSE_DURATION = 3e-3, 1e-2  # s: filter ringing on both sides of a pulse; longest pulse


def without_pulses(recording: Recording, sensors: Sequence[PassageSensor]) -> tuple[Recording, tuple[Rejection, ...]]:
    """The recording with straight lines in place of its electrical pulses, and the findings.

    ``sensors`` are PassageSensors. Nothing is cut where the live ones are less than 2 m from each other. A channel
    that is constant or not finite stays as it is and is not asked.

    Parameters
    ----------
    recording : Recording
        Recording of the passage.
    sensors : sequence of PassageSensor
        What the channels are.

    Returns
    -------
    recording : Recording
        The same object where nothing is cut.
    findings : tuple of Rejection
        One finding "interference", or none.
    """
    positions = {s.name: s.position for s in sensors}
    rows = [i for i, c in enumerate(recording.channels) if c.name in positions and _is_live(recording.samples[i])]
    if len(rows) < 2 or np.ptp([positions[recording.channels[i].name] for i in rows]) < MIN_SENSOR_SPAN:
        return recording, ()
    window = 2 * max(round(MAX_PULSE_DELAY * recording.rate), 1) + 1
    is_pulse = np.ones(recording.n_sample, dtype=bool)
    for i in rows:
        magnitude = np.abs(recording.samples[i] - np.median(recording.samples[i]))
        is_pulse &= ndimage.maximum_filter1d(magnitude, window) > PULSE_FACTOR * np.quantile(magnitude, 0.999)
        if not is_pulse.any():
            return recording, ()
    cut, n = _pulse_regions(is_pulse, recording.rate)
    if not n:
        return recording, ()
    samples, in_pulse, valid = recording.samples.copy(), np.flatnonzero(cut), np.flatnonzero(~cut)
    for i in rows:
        samples[i, in_pulse] = np.interp(in_pulse, valid, samples[i, valid])
    first = float(in_pulse[0] / recording.rate)
    text = f"all channels: {n} electrical pulse{'s' * (n > 1)} cut out, the first at {first:.3f} s"
    return replace(recording, samples=samples), (Rejection("interference", float(n), 0.0, text, time=first),)


def _is_live(samples: np.ndarray) -> bool:
    return bool(np.isfinite(samples).all()) and np.ptp(samples) > 0.0


def _pulse_regions(is_pulse: np.ndarray, rate: float) -> tuple[np.ndarray, int]:
    """((n_sample,) bool to cut, number of pulses): pulses with their ringing; longer events are not pulses."""
    label, _n = ndimage.label(ndimage.maximum_filter1d(is_pulse, 2 * round(PULSE_MARGIN * rate) + 1))
    runs = ndimage.find_objects(label)
    short = [run for (run,) in runs if run.stop - run.start <= (MAX_PULSE_DURATION + 2 * PULSE_MARGIN) * rate]
    cut = np.zeros(is_pulse.size, dtype=bool)
    for run in short:
        cut[run] = True
    return cut, len(short)
