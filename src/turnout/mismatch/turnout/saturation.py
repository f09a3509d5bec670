"""Saturated channels: their peaks stay at a limit while trains get louder, or impacts harder.

The limit is found from peaks of hammer tests and from peaks of passages, and both are combined.
"""

from dataclasses import dataclass, replace

import numpy as np

from turnout.receptance import find_impacts

FEWEST = 3  # accepted impacts of a test, at least, to estimate its level and scatter
FLOOR = 0.02  # ln, least scatter of peaks: sampling, ringing mountings, impacts beside the mark
STRUCK = 0.3  # m, half a bay: a sensor this near the impact measures the motion there
SHOWN = 0.9  # least limit as a share of the largest peak of the channel
STEP = 0.25 * FLOOR  # ln, between trial limits


def blow_ceiling(hammer, sensor):
    """(limit [m/s²], gain [nats]) of the channel of a sensor in the tests ``hammer``; (nan, 0.0) without evidence.

    Each side of an amplifier is tested by itself; the limit is the mean of those with a positive gain. Near the impact
    peaks grow with the force, and the larger gain counts. Elsewhere waves of all lengths meet. They may limit the peaks
    of one side as the pulse gets shorter, but not of both: the smaller gain counts.
    """
    tests = [(test.place, _peaks(test, sensor.name)) for test in hammer]
    tests = [(x, peaks) for x, peaks in tests if peaks is not None]
    if not tests:
        return float("nan"), 0.0
    sides = [held([(force, side[k]) for _, (force, side) in tests]) for k in (0, 1)]
    gains = [gain for _, gain in sides]
    struck = not sensor.mounting.startswith("sleeper") and any(abs(x - sensor.place) < STRUCK for x, _ in tests)
    gain = max(gains) if struck else min(gains)
    if gain <= 0.0:
        return float("nan"), 0.0
    return float(np.mean([limit for limit, own in sides if own > 0.0])), gain


def _peaks(test, name):
    """(ln force peaks (n,), ln channel peaks (2, n), upward and downward) of the accepted impacts of a test.

    None where they are fewer than ``MIN_IMPACTS``. Impacts that reach the range stated in the file are not accepted.
    """
    heard = [r for r in test.recordings if any(c.name == name for c in r.channels)]
    blows = [i for i in find_impacts(heard, test.force, name, test.judged) if i.accepted]
    if len(blows) < FEWEST:
        return None
    sides = [[np.max(sign * i.acceleration) for i in blows] for sign in (1.0, -1.0)]
    return np.log([i.peak for i in blows]), np.log(np.maximum(sides, 1e-12))


def held(tests):
    r"""(limit, gain [nats]) of one limit over all ``tests``, pairs (ln forces (n,), ln peaks (n,)).

    .. math:: y = \min(c,\, a_t + b_t x) + e \quad\text{against}\quad y = a_t + b_t x + e,\ b_t \ge 1, \qquad
              g = \tfrac n2 \ln\frac{s_0^2 + f^2}{s_1^2 + f^2} - \tfrac12 \ln n

    with the mean squares s² of the residuals and the least scatter f. The tip of a hammer stiffens under a harder
    impact, which gets shorter: peaks of a linear track grow at least as the force. At least two impacts must reach the
    limit.
    """
    n, top = sum(x.size for x, _ in tests), max(y.max() for _, y in tests)
    free = sum(_line(x, y)[1] for x, y in tests) / n
    best = -np.inf, top
    for c in np.arange(top, top + np.log(SHOWN), -STEP):
        left, reached = np.sum([_capped(x, y, c) for x, y in tests], axis=0)
        if reached >= 2:
            best = max(best, (0.5 * n * np.log((free + FLOOR**2) / (left / n + FLOOR**2)), c))
    return float(np.exp(best[1])), float(best[0] - 0.5 * np.log(n))


def _line(x, y):
    """(slope, residual sum of squares) of a line through peaks that grow at least as the force."""
    x, y = x - x.mean(), y - y.mean()
    slope = max(1.0, float(x @ y) / max(float(x @ x), 1e-12))
    return slope, float(np.sum((y - slope * x) ** 2))


def _capped(x, y, c):
    """(residual sum of squares, impacts at the limit) of the best split of the impacts.

    The peaks of the weaker ones grow up to ``c``, those of the harder ones stay there.
    """
    order = np.argsort(x)
    x, y = x[order], y[order]
    best = float(np.sum((y - c) ** 2)), x.size
    for below in range(1, x.size + 1):
        slope, left = _line(x[:below], y[:below])
        ends = y[:below].mean() + slope * (x - x[:below].mean())
        if ends[below - 1] <= c and np.all(ends[below:] >= c):
            best = min(best, (left + float(np.sum((y[below:] - c) ** 2)), x.size - below))
    return best


FEWEST_PASSAGES, FEWEST_SENSORS = 4, 3  # at least, for a limit from passages
TOP = 0.8  # share of the peak above which a clipped channel stays for long
RINGS = np.pi / 4.0  # limit over peak of a clipped wave, of which a recorder's filter passes the first harmonic
UNLIKE_SIDES = 0.9  # limit of one side of an amplifier over that of the other, at least
LIMIT_SD = 0.1  # relative standard deviation of the limit: both sides of an amplifier differ


@dataclass(frozen=True)
class Ceiling:
    """The ``limit`` of a channel [m/s²] and its evidence, ``gain`` [nats]."""

    limit: float
    gain: float


def ceilings(campaign, threshold):
    """SaturationLimit of every sensor, by name, with evidence beyond ``threshold`` [nats] from passages and impacts.

    Reserved recordings count as well: whether a channel is usable is no prediction, and applies to them, too.
    """
    rolled, found = _rolled(campaign), {}
    for sensor in campaign.sensors:
        struck = Ceiling(*blow_ceiling(campaign.hammer, sensor))
        known = _together(rolled.get(sensor.name, struck), struck)
        known = replace(known, gain=known.gain - float(np.log(len(campaign.sensors))))
        if known.gain > threshold and known.limit >= UNLIKE_SIDES * RINGS * highest(campaign, sensor.name):
            found[sensor.name] = known
    return found if len(found) < len(campaign.sensors) else {}


def _together(rolled, struck):
    """The limit with more evidence; the sum of both gains where they agree on the limit."""
    plainer = max(rolled, struck, key=lambda c: c.gain)
    if rolled is struck or min(rolled.gain, struck.gain) <= 0.0:
        return plainer
    one = abs(np.log(rolled.limit / struck.limit)) < 2.0 * LIMIT_SD
    return replace(plainer, gain=rolled.gain + struck.gain) if one else plainer


def _rolled(campaign):
    """SaturationLimit of every sensor, by name, for which passages give evidence."""
    names = [s.name for s in campaign.sensors]
    recordings = [p.recording for p in campaign.passages]
    recordings = [r for r in recordings if set(names) <= {c.name for c in r.channels} and not _at_its_range(r)]
    if len(recordings) < FEWEST_PASSAGES or len(names) < FEWEST_SENSORS:
        return {}
    sizes = [np.abs(r.samples[[r.index(n) for n in names]]) for r in recordings]
    peaks, found = np.log([np.maximum(np.max(x, axis=1), 1e-12) for x in sizes]), {}
    for k, name in enumerate(names):
        gain = saturation(peaks[:, k], np.delete(peaks, k, axis=1).mean(axis=1))
        if gain > 0.0 and (limit := _limit([x[k] for x in sizes])):
            found[name] = Ceiling(limit, gain)
    return found


def _at_its_range(recording):
    """Whether a channel reaches the range stated in its file, beyond which it is known to be clipped."""
    limits = [np.inf if c.limit is None else 0.999 * c.limit for c in recording.channels]
    return bool(np.any(np.max(np.abs(recording.samples), axis=1) >= limits))


def saturation(peaks, others):
    r"""Gain [nats] of a limit over peaks that follow ``reference``; both (n,) logarithms of peaks, one per passage.

    .. math:: y_k = \min(c,\, a + x_k) + e_k \quad\text{against}\quad y_k = a + x_k + e_k, \qquad
              g = \tfrac n2 \ln\frac{s_0^2 + f^2}{s_1^2 + f^2} - \tfrac12 \ln n

    with the mean squares s² of the residuals and the least scatter f. At least two passages must reach the limit.
    """
    order = np.argsort(others)
    y, x = np.asarray(peaks)[order], np.asarray(others)[order]
    n, follows = y.size, y - x
    free, capped = np.sum((follows - follows.mean()) ** 2), [np.sum((y - y.mean()) ** 2)]
    for below in range(1, n - 1):
        a, c = follows[:below].mean(), y[below:].mean()
        if a + x[below] >= c:
            capped.append(np.sum((y[below:] - c) ** 2) + np.sum((follows[:below] - a) ** 2))
    return float(0.5 * n * np.log((free / n + FLOOR**2) / (min(capped) / n + FLOOR**2)) - 0.5 * np.log(n))


def _limit(sizes):
    """Median of the samples near the peak, in the passage that spends most of its time there [m/s²].

    None where that passage is not among the loudest. A clipped channel stays at its limit; a flat or a nose gives
    single peaks.
    """
    crowded = max(sizes, key=lambda x: (np.mean(x > TOP * x.max()), x.max()))
    if crowded.max() < TOP * max(x.max() for x in sizes):
        return None
    return float(np.median(crowded[crowded > TOP * crowded.max()]))


def within_range(campaign, found):
    """The campaign without the ``saturated`` sensors, whose signals are no response of the track."""
    return replace(campaign, sensors=tuple(s for s in campaign.sensors if s.name not in found))


def highest(campaign, name):
    """Largest value of a channel in any passage at its full rate, reserved ones included; 0 where none has it. [m/s²]

    The channel cannot be clipped below that value.
    """
    recordings = [p.recording for p in campaign.passages]
    seen = [r.samples[r.index(name)] for r in recordings if name in {c.name for c in r.channels}]
    return max((float(np.max(np.abs(x))) for x in seen), default=0.0)
