"""Channels that left their range: the range itself reached, or one rail code repeated."""

import numpy as np

from turnout.records import Rejection

# A parabola one code deep over m equal samples falls by 9 codes within as many samples again, one more by rounding.
NATURAL_FALL = 12.0
CHANCE = 1e-3


def range_exceeded(x, limit):
    """Largest absolute sample if it reaches a known range, else None.

    >>> range_exceeded(np.array([0.0, -5.0, 3.0]), 5.0), range_exceeded(np.array([1.0]), None)
    (5.0, None)
    """
    size = float(np.max(np.abs(x)))
    return size if limit is not None and size >= 0.999 * limit else None


def rail_code(x, resolution=None, noise=0.0):
    r"""Samples that repeat one extreme code as only a clipped signal does: (number of samples, code), or None.

    A smooth top may repeat its highest code as well, on a quiet converter with few bits. Then it is nearly a
    parabola: m equal samples lie within one step (and the noise) of each other, and over as many samples again on
    either side it falls by less than ``NATURAL_FALL`` times that. A clipped signal arrives with a slope and falls
    faster.
    Noise of several steps seldom repeats a code, m times with the probability

    .. math:: \left(\frac{q}{2\sqrt{\pi}\,\sigma}\right)^{m-1} \quad (q \text{ step},\ \sigma \text{ noise}),

    and where that is below ``CHANCE`` only the step counts. Fewer than three equal samples prove nothing, and
    three only where chance is ten times smaller still.

    Parameters
    ----------
    x : (n_sample,) array of float
        [any unit]
    resolution : float, optional
        One step of the converter; by default the smallest step that occurs.
    noise : float
        Standard deviation of the noise. [the same unit]

    Examples
    --------
    >>> x = np.round(1000 * np.sin(np.pi * np.arange(61) / 60))
    >>> rail_code(x), rail_code(np.minimum(x, 900.0))
    (None, (17, 900.0))
    """
    for y, sign in ((x, 1.0), (-x, -1.0)):
        code = float(y.max())
        equal = np.flatnonzero(y == code)
        if equal.size < 3 or code <= 0.0:
            continue
        runs = [(first, last) for first, last in _runs(equal) if last - first >= 2]
        step = (resolution or _smallest_step(y)) if runs else 0.0
        noisy = noise > step / 4.0
        for first, last in runs:
            m = last - first + 1
            reach = (m + 1) // 2
            chance = (step / (2.0 * np.sqrt(np.pi) * noise)) ** (m - 1) if noisy else 1.0
            if first < reach or last + reach >= y.size or (noisy and m == 3 and chance > CHANCE / 10.0):
                continue
            depth = step if chance < CHANCE else step + 3.0 * noise
            if code - max(y[first - reach], y[last + reach]) > NATURAL_FALL * depth:
                return int(sum(b - a + 1 for a, b in runs)), sign * code
    return None


def overload(cut, contact):
    """Rejection for the first sign of an overload on either channel of a blow, or None.

    A range ends where the recorded samples end, not those with the zero line taken off.
    """
    both = (cut.force, contact.noise_force), (cut.acceleration, contact.noise_acceleration)
    for (x, noise), zero, channel in zip(both, cut.zeros, cut.channels):
        if (size := range_exceeded(x + zero, channel.limit)) is not None:
            detail = f"{channel.name} reaches {size:.4g}, its range ends at {channel.limit:.4g}"
            return Rejection("overload", size, channel.limit, detail)
        if (rail := rail_code(x, channel.resolution, noise)) is not None:
            detail = f"{channel.name} repeats its highest code {rail[1]:.4g} in {rail[0]} samples"
            return Rejection("overload", float(rail[0]), 2.0, detail)
    return None


def _runs(indices):
    parts = np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1)
    return [(int(p[0]), int(p[-1])) for p in parts if p.size]


def _smallest_step(y):
    steps = np.diff(np.unique(y))
    steps = steps[steps > 1e-12 * np.ptp(y)]
    return float(steps.min()) if steps.size else np.inf
