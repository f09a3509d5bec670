"""Channels that show no more than so much: their peaks stay where trains grow louder, or blows harder.

Channels that show no more than so much under the hammer: harder blows, the same peak.
"""

from dataclasses import dataclass, replace

import numpy as np

from turnout.receptance import find_impacts

FEWEST = 3  # blows of a test, so that its own level and the scatter about it are known
FLOOR = 0.02  # ln; peaks fall between samples, mountings ring and blows fall beside the mark
STRUCK = 0.3  # m, half a bay: so near the blow a channel shows what the rail does there
SHOWN = 0.9  # of the largest peak: no limit lies below what a channel has shown
STEP = 0.25 * FLOOR  # between limits that are tried


def blow_ceiling(hammer, sensor):
    """(limit [m/s²], gain [nats]) of a sensor's channel in the tests ``hammer``; (nan, 0.0) where blows show none.

    Each side of an amplifier for itself; the limit is the mean of those that hold. Where the rail is struck its peaks
    grow with the force: the plainer side speaks. Beside it waves of all lengths meet, which may hold one side while the
    pulse grows shorter, but not both: the lesser side speaks.
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
    """(ln peak of the force (n,), ln peaks of the channel (2, n), upward and downward) of a test's sound blows, none of
    which reaches the range that its file states; None where there are too few."""
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

    with the mean squares s² of the residuals and the least scatter f. The tip of a hammer stiffens under a harder blow,
    which is shorter then: peaks of a linear track grow at least as the force. At least two blows must reach the limit.
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
    """(slope, squares left) of a line through peaks that grow at least as the force."""
    x, y = x - x.mean(), y - y.mean()
    slope = max(1.0, float(x @ y) / max(float(x @ x), 1e-12))
    return slope, float(np.sum((y - slope * x) ** 2))


def _capped(x, y, c):
    """(squares left, blows that reach it) of the best of: the weaker blows grow up to ``c``, the harder ones hold."""
    order = np.argsort(x)
    x, y = x[order], y[order]
    best = float(np.sum((y - c) ** 2)), x.size
    for below in range(1, x.size + 1):
        slope, left = _line(x[:below], y[:below])
        ends = y[:below].mean() + slope * (x - x[:below].mean())
        if ends[below - 1] <= c and np.all(ends[below:] >= c):
            best = min(best, (left + float(np.sum((y[below:] - c) ** 2)), x.size - below))
    return best


FEWEST_PASSAGES, FEWEST_SENSORS = 4, 3
TOP = 0.8  # of the peak; above it a clipped channel spends its time
RINGS = np.pi / 4.0  # what is cut off to a square rings in a recorder's filter, which passes the first of its waves
UNLIKE_SIDES = 0.9  # one side of an amplifier, of the other that saturates later
LIMIT_SD = 0.1  # of the limit; the two sides of an amplifier seldom saturate alike


@dataclass(frozen=True)
class Ceiling:
    """A channel's ``limit`` [m/s²] and what speaks for it, ``gain`` [nats]."""

    limit: float
    gain: float


def ceilings(campaign, threshold):
    """Ceiling of every sensor, by name, whose passages and blows show one beyond ``threshold`` [nats].

    Reserved recordings count as well: whether a channel may be used is no prediction, and holds for them too.
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
    """The plainer of two ceilings, with what speaks for both where they are of one limit."""
    plainer = max(rolled, struck, key=lambda c: c.gain)
    if rolled is struck or min(rolled.gain, struck.gain) <= 0.0:
        return plainer
    one = abs(np.log(rolled.limit / struck.limit)) < 2.0 * LIMIT_SD
    return replace(plainer, gain=rolled.gain + struck.gain) if one else plainer


def _rolled(campaign):
    """Ceiling of every sensor, by name, that passages speak for."""
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
    """A channel reaches the range that its file states: that it goes no higher is known."""
    limits = [np.inf if c.limit is None else 0.999 * c.limit for c in recording.channels]
    return bool(np.any(np.max(np.abs(recording.samples), axis=1) >= limits))


def saturation(peaks, others):
    r"""Gain [nats] of a ceiling over peaks that follow ``others``; both (n,) logarithms of peaks, one per passage.

    .. math:: y_k = \min(c,\, a + x_k) + e_k \quad\text{against}\quad y_k = a + x_k + e_k, \qquad
              g = \tfrac n2 \ln\frac{s_0^2 + f^2}{s_1^2 + f^2} - \tfrac12 \ln n

    with the mean squares s² of the residuals and the least scatter f. At least two passages must reach the ceiling.
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
    """Median of what lies near the peak, of the passage that spends most of its time there [m/s²]; None where that is
    none of the loudest: a channel that is cut off dwells at its limit, one that hears a flat or a nose bangs once."""
    crowded = max(sizes, key=lambda x: (np.mean(x > TOP * x.max()), x.max()))
    if crowded.max() < TOP * max(x.max() for x in sizes):
        return None
    return float(np.median(crowded[crowded > TOP * crowded.max()]))


def within_range(campaign, found):
    """The campaign without the sensors that have a ceiling: what these show is no response of the track."""
    return replace(campaign, sensors=tuple(s for s in campaign.sensors if s.name not in found))


def highest(campaign, name):
    """Largest value that a channel shows in any passage, reserved or not, at its full rate; 0 where none has it. [m/s²]

    What a channel has shown it can show: it is cut off nowhere below.
    """
    recordings = [p.recording for p in campaign.passages]
    seen = [r.samples[r.index(name)] for r in recordings if name in {c.name for c in r.channels}]
    return max((float(np.max(np.abs(x))) for x in seen), default=0.0)
