"""A hammer that touches the rail twice: further contacts in the force of one blow."""

from typing import NamedTuple

import numpy as np
from scipy.signal import find_peaks

from turnout.receptance.contact import run_around
from turnout.receptance.cut import MAD_TO_SD

# Within this of the main contact a filter's or the hammer's own ringing looks like a small second contact, and behind a
# pulse of a few samples like a large one; no hammer comes back so soon.
CLOSE = 1e-3
CLOSE_PROMINENCE = 0.1
CLOSE_SAMPLES = 6.0
NOISE_FACTOR = 6.0
# A further contact lasts as long as it exceeds this share of its own height.
OWN_LEVEL = 0.1


def smoothed_force(force, half_width):
    """Force behind a Hann kernel as long as the main pulse's half width, at least three samples; sum kept.

    As wide as the tip's own pulse, it takes off noise without lowering a second pulse more than the first.

    >>> smoothed_force(np.array([0.0, 0.0, 4.0, 0.0, 0.0]), 2.0)
    array([0., 1., 2., 1., 0.])
    """
    n = max(3, 2 * round(half_width / 2) + 1)
    kernel = np.hanning(n + 2)[1:-1]
    return np.convolve(force, kernel / kernel.sum(), mode="same")


class FurtherContact(NamedTuple):
    """First, last and highest sample, and the height over that of the main contact."""

    onset: int
    end: int
    top: int
    share: float


def further_contacts(cut, contact, settings):
    """Contacts besides the main one: list of FurtherContact in order of time, and the level they exceed.

    A contact is a local maximum of the smoothed force above ``double_hit_level`` of its peak and above six standard
    deviations of its noise, with a prominence of ``double_hit_prominence``. The noise is the median absolute deviation
    outside the main contact, so that hum or a drifting zero raise the limit instead of raising alarms.
    """
    force = smoothed_force(cut.polarity * cut.force, contact.half_width)
    near = max(2, round(CLOSE * cut.rate))
    top = max(0, contact.top - near) + int(np.argmax(force[max(0, contact.top - near) : contact.top + near + 1]))
    force /= force[top]
    lower, upper = max(0, contact.onset - near), min(force.size, contact.end + near + 1)
    outside = np.concatenate([force[:lower], force[upper:]])
    noise = NOISE_FACTOR * MAD_TO_SD * float(np.median(np.abs(outside))) if outside.size else 0.0
    level = max(settings.double_hit_level, noise)
    tops, shape = find_peaks(force, height=level, prominence=max(settings.double_hit_prominence, noise))
    found = []
    for k, prominence in zip(tops, shape["prominences"]):
        close = lower <= k < upper
        stands_out = prominence >= max(CLOSE_PROMINENCE, noise) and contact.half_width >= CLOSE_SAMPLES
        if k != top and (not close or stands_out):
            onset, end = run_around(force, k, max(OWN_LEVEL * force[k], noise / 2))
            found.append(FurtherContact(onset, end, int(k), float(force[k])))
    return found, level
