"""Sensors that stop hearing the train before it is past: they fell off, or their cable broke."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from turnout.records import Rejection

FAINT = 0.2  # of a sensor's usual level at an axle, in logarithms: below it the axle is not heard
REACH = 0.5  # m around the place of an axle


def fell_silent(heard, names, at_sensor, speed: float) -> list[Rejection]:
    """A finding "sensor_lost" for every sensor that hears the first half of the train and not its last two axles.

    Parameters
    ----------
    heard : Listening
        Levels of the sensors ``names``, in that order.
    names : sequence of str
    at_sensor : mapping
        Channel -> (n_axle,) times of the axles there. [s]
    speed : float
        [m/s]

    Returns
    -------
    list of Rejection
        With the time of the last sound as their value. [s]
    """
    step, found = heard.levels.step, []
    reach = max(int(REACH / speed / step), 1)
    loudest = ndimage.maximum_filter1d(heard.levels.values, 2 * reach + 1, axis=1)
    for name, level, row in zip(names, heard.levels.values, loudest):
        times = np.asarray(at_sensor.get(name, ()))
        inside = times[(times > 0) & (times < len(row) * step)]
        if inside.size < 4:
            continue
        at_axles = row[(inside / step).astype(int)]
        usual = np.median(at_axles[: inside.size // 2])
        silent = at_axles < FAINT * usual
        if usual <= 0 or not silent[-2:].all() or silent[: inside.size // 2].mean() > 0.25:
            continue
        first_silent = int(np.flatnonzero(~silent)[-1]) + 1
        stop = int(inside[first_silent] / step)
        until = (np.flatnonzero(level[:stop] >= FAINT * usual)[-1] + 1) * step
        text = f"{name}: hears nothing from {until:.2f} s on, {inside.size - first_silent} axles before the last"
        found.append(Rejection("sensor_lost", float(until), None, text))
    return found
