"""Channels that show no more than so much: their peaks stay where trains grow louder, or blows harder."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.track.blow_ceiling import FLOOR, blow_ceiling

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
