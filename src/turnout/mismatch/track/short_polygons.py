r"""Polygonal wheels whose waves are shorter than those simulated: one wheel loud at one wavelength, wherever it passes.

While a wheel is within ``REACH`` of a sensor the sensor hears that wheel above all. With P the power then and there in
bins of :math:`\lambda = v/f` and B that of the bins around it,

.. math:: z = \ln (P / B) - \mathrm{median}_{wheels} \ln (P / B)

is near 0 for a sound wheel: hum, resonances and corrugation are common to all wheels of a passage and fall out. The
evidence is that of the mean of z over sensors and passages, for a loud wheel over a sound one.
"""

from dataclasses import dataclass, replace

import numpy as np

from turnout import physics
from turnout.mismatch.candidate import Candidate
from turnout.mismatch.track.bands import SHORTEST_WAVE
from turnout.mismatch.track.short_waves import HIGHEST, SHORTEST, TRANSFER, carried_energy

REACH = 1.2  # m; axles of a bogie are 1.8 m apart or more
STEP, NEAR, FAR = 0.04, 0.2, 0.6  # of the logarithm of the wavelength: bins, from where to where others are around
TELL_APART = 0.16  # in the same unit: what 2.4 m of way tell apart at 0.2 m
SPREAD, ONE = 0.5, 0.8  # of z: of wheels, twice that of sound ones in another simulator; of one sensor in one passage
LOUD = 2.5  # of z where a wheel is polygonal, as a prior
WHEELS = 3  # fewer have no median
LEAST = 2e-5  # m


@dataclass(frozen=True)
class Slots:
    """One passage: ``level`` (n_sensor, n_wheel, n_bin) logarithm of the power while a wheel passes a sensor, nan where
    it was not recorded; ``width`` (n_bin,) lines per bin, ``size`` of the transform, ``window`` (n,) of the samples."""

    made: object
    level: np.ndarray
    width: np.ndarray
    size: int
    window: np.ndarray


def short_polygons(case, fit):
    """The likeliest wheel with short waves as a candidate, () where all may be round."""
    mades = sorted(case.fitted(), key=lambda m: m.speed)
    if not mades:
        return ()
    lengths = wavelengths(mades)
    tried = np.flatnonzero((lengths < SHORTEST_WAVE) & (lengths > lengths.min(initial=np.inf) * np.exp(FAR)))
    if not tried.size:
        return ()
    found, n = [], 0
    for train in case.trains:
        seen = [slots_of(m, lengths) for m in mades if case.said(m)["train"] == train]
        if seen and seen[0].level.shape[1] >= WHEELS:
            z, apart = louder(seen, tried, lengths)
            n += z.shape[0]
            w, k = np.unravel_index(int(np.argmax(z)), z.shape)
            if apart and _holds([louder(half, tried, lengths)[0][w, k] for half in (seen[::2], seen[1::2]) if half]):
                found.append((evidence(z[w, k], apart), train, int(w), int(tried[k]), seen))
    if not found:
        return ()
    nats, train, wheel, k, seen = max(found, key=lambda f: f[0])
    scanned = n * max(1.0, float(np.ptp(np.log(lengths[tried]))) / TELL_APART)
    if nats < np.log(scanned):
        return ()
    return (_short_candidate(case, fit, train, wheel, lengths, k, nats, scanned, seen),)


def _holds(levels):
    """Either half of a train's passages shows at least half of what the other does."""
    return min(levels) > 0.5 * max(levels)


def wavelengths(mades):
    """(n,) middles of the bins, longest first; those at both ends are there to be compared with. [m]"""
    shortest = max([SHORTEST * np.exp(-FAR), *(m.speed / (HIGHEST * m.passage.recording.rate) for m in mades)])
    longest = SHORTEST_WAVE * np.exp(FAR)
    return longest * np.exp(-np.arange(0.0, np.log(longest / shortest), STEP))


def slots_of(made, lengths):
    """``Slots`` of a passage."""
    recording, speed = made.passage.recording, made.speed
    n = round(2.0 * REACH / speed * recording.rate)
    window, size = np.hanning(n), 1 << int(np.ceil(np.log2(8 * n)))
    frequency = np.arange(size // 2 + 1) * recording.rate / size
    edges = np.searchsorted(frequency, speed / lengths[:, None] * np.exp([-0.5 * STEP, 0.5 * STEP]))
    edges[:, 1] = np.maximum(edges[:, 1], edges[:, 0] + 1)
    sign = 1.0 if made.passage.direction == "facing" else -1.0
    first = sign * min(sign * s.place for s in made.sensors)
    behind = made.passage.vehicle.wheel_places
    level = np.full((len(made.sensors), behind.size, lengths.size), np.nan)
    for row, sensor in zip(level, made.sensors):
        samples = recording.samples[recording.index(sensor.name)]
        for slot, back in zip(row, behind):
            k = round((made.reference + (sign * (sensor.place - first) + back) / speed) * recording.rate) - n // 2
            part = samples[max(k, 0) : k + n]
            if part.size == n and np.ptp(part) > 0.0:
                power = np.abs(np.fft.rfft((part - part.mean()) * window, size)) ** 2
                slot[:] = [np.log(power[a:b].mean()) for a, b in edges]
    return Slots(made, level, np.diff(edges, axis=1)[:, 0], size, window)


def _usual(level, k, lengths):
    """(n_sensor, n_wheel) level of bin k as those around it have it, the mean of both sides."""
    away = np.log(lengths[k] / lengths)
    sides = [(away > NEAR) & (away < FAR), (-away > NEAR) & (-away < FAR)]
    return np.mean([np.median(level[..., side], axis=-1) for side in sides], axis=0)


def louder(slots, tried, lengths):
    """(n_wheel, n_tried) mean of z over sensors and passages, and the number of slots of a wheel behind it."""
    above = [np.stack([s.level[..., k] - _usual(s.level, k, lengths) for k in tried], axis=-1) for s in slots]
    heard = [a - np.nanmedian(a, axis=1, keepdims=True) for a in above if not np.isnan(a).all()]
    z = np.concatenate([*heard, np.full((0, *above[0].shape[1:]), np.nan)])
    if not z.size:
        return np.full(above[0].shape[1:], -np.inf), 0
    return np.nan_to_num(np.nanmean(z, axis=0), nan=-np.inf), z.shape[0]


def evidence(z, slots):
    """Nats for a polygonal wheel over a round one, by its mean z over so many slots."""
    spread = SPREAD**2 + ONE**2 / slots
    wide = spread + LOUD**2
    z = max(float(z), 0.0)
    return 0.5 * np.log(spread / wide) + 0.5 * z**2 * (1.0 / spread - 1.0 / wide)


def _short_candidate(case, fit, train, wheel, lengths, k, nats, scanned, seen):
    radius = seen[0].made.passage.vehicle.each("radius")[wheel]
    order = round(2.0 * np.pi * radius / lengths[k])
    sizes = np.concatenate([_amplitudes(case, fit, s, wheel, lengths, k) for s in seen])
    amplitude = float(np.clip(np.median(sizes), 1e-6, 9e-4))
    error = amplitude * float(np.hypot(TRANSFER, np.std(np.log(sizes)) / np.sqrt(sizes.size)))
    parameters = tuple(
        replace(p, prior=(amplitude, error)) for p in physics.OutOfRound.parameters if p.name == "cosine"
    )  # fmt: skip

    def make(p):
        return physics.OutOfRound(wheel, order=order, radius=radius, train=train, **p)

    return Candidate(
        "out_of_round", parameters, make, ((amplitude,),), {"train": train, "axle": wheel + 1}, "wheel", scanned,
        promise=float(nats - np.log(scanned)), aside=float(nats), least=LEAST,
    )  # fmt: skip


def _amplitudes(case, fit, slots, wheel, lengths, k):
    r"""(n,) amplitude of the wheel's wave [m] by each sensor that heard it, from the energy over that around:

    .. math:: \sum_f |Y|^2 = \tfrac{N}{2} f_s \int y^2 h^2 dt, \quad
              \int y^2 h^2 dt = \tfrac12 a^2 |F|^2 \omega^4 \int |G(x)|^2 h(x)^2 dx / v
    """
    made, about = slots.made, np.flatnonzero(np.abs(np.log(lengths / lengths[k])) < NEAR)
    over = np.exp(slots.level[:, wheel, about]) - np.exp(_usual(slots.level, k, lengths)[:, wheel, None])
    energy = 2.0 * np.sum(over * slots.width[about], axis=1) / (slots.size * made.passage.recording.rate)
    node, gain = carried_energy(case, fit, made, lengths[k])
    away = np.array([s.place for s in made.sensors])[:, None] - node
    window = np.where(np.abs(away) < REACH, np.cos(0.5 * np.pi * away / REACH) ** 2, 0.0)
    one = 0.5 / made.speed * np.trapezoid(gain * window**2, node, axis=1)
    heard = np.isfinite(energy) & (energy > 0.0)
    return np.sqrt(energy[heard] / one[heard]) if heard.any() else np.array([1e-6])
