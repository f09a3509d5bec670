"""When the hammer touched the rail: onset, length, peak, impulse, and the noise before."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Contact:
    """The main contact of a blow, in samples of its window and SI units.

    ``onset`` and ``end`` are the first and last sample above the contact level around the peak, ``top`` the
    peak's sample, ``half_width`` the number of samples above half the peak (interpolated).
    """

    onset: int
    end: int
    top: int
    peak: float
    half_width: float
    impulse: float
    noise_force: float
    noise_acceleration: float
    zero_acceleration: float


def measure_contact(cut, level):
    r"""Contact of one cut: the run of samples above ``level`` times the peak that holds the peak.

    The impulse is the integral of the force over the contact by the rectangle rule. Noise levels are standard
    deviations ahead of the first touch; with fewer than 8 samples there, the force's is that of the whole record
    (by its median absolute deviation) and the acceleration's that of the last tenth.
    """
    force = cut.polarity * cut.force
    top = int(np.argmax(force))
    peak = float(force[top])
    onset, end = run_around(force, top, level * peak)
    left, right = crossing(force, top, 0.5 * peak, -1), crossing(force, top, 0.5 * peak, 1)
    quiet = max(0, min(cut.first, onset) - max(2, round(0.2 * (end - onset + 1))))
    if quiet >= 8:
        noise_force = float(np.std(cut.force[:quiet]))
        ahead = cut.acceleration[:quiet]
    else:
        noise_force = cut.force_noise
        ahead = cut.acceleration[-max(8, cut.acceleration.size // 10) :]
    return Contact(
        onset, end, top, cut.polarity * peak, right - left, float(np.sum(cut.force[onset : end + 1])) / cut.rate,
        noise_force, float(np.std(ahead)), float(np.mean(ahead)) if quiet >= 8 else 0.0,
    )  # fmt: skip


def run_around(x, top, level):
    """First and last index of the unbroken run of samples above ``level`` around ``top``.

    >>> run_around(np.array([0.0, 3, 0, 2, 5, 2, 0]), 4, 1.0)
    (3, 5)
    """
    below = np.flatnonzero(x[:top] <= level)
    onset = int(below[-1]) + 1 if below.size else 0
    below = np.flatnonzero(x[top + 1 :] <= level)
    return onset, (top + int(below[0]) if below.size else x.size - 1)


def crossing(x, top, level, step):
    """Where x falls through ``level``, going from ``top`` in direction ``step`` (+1, -1); linear interpolation.

    >>> x = np.array([0.0, 1.0, 4.0, 2.0, 0.0])
    >>> float(crossing(x, 2, 3.0, 1)), float(crossing(x, 2, 2.5, -1))
    (2.5, 1.5)
    """
    first, last = run_around(x, top, level)
    if step > 0:
        return float(last) if last + 1 >= x.size else last + (x[last] - level) / (x[last] - x[last + 1])
    return float(first) if first == 0 else first - (x[first] - level) / (x[first] - x[first - 1])
