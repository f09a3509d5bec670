"""Channels that show no more than so much: their peaks stay where trains grow louder, or blows harder."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.track.blow_ceiling import blow_ceiling

FEWEST_PASSAGES, FEWEST_SENSORS = 4, 3
FLOOR = 0.02  # ln; peaks fall between samples, and mountings ring behind a blow
TOP = 0.8  # of the peak; above it a clipped channel spends its time
RINGS = np.pi / 4.0  # what is cut off to a square rings in a recorder's filter, which passes the first of its waves
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
        limit, gain = blow_ceiling(campaign.hammer, sensor)
        seen = rolled.get(sensor.name, Ceiling(limit, 0.0))
        whole = seen.gain + gain - np.log(len(campaign.sensors))
        limit = limit if gain > seen.gain else seen.limit
        if whole > threshold and limit >= RINGS * highest(campaign, sensor.name):
            found[sensor.name] = Ceiling(limit, float(whole))
    return found if len(campaign.sensors) - len(found) > 1 else {}


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
