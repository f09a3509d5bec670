r"""Find polygonal wheels in the residual of passages: which wheel of which train, order and amplitude.

Waves longer than ``SHORTEST_WAVE`` are found in the band of the fit. The wave of a wheel is a line at v/λ in every
passage of its train, at an unknown angle. C are its two whitened signals, a quarter wave apart. Their amplitudes have
the standard deviation a, the same in all passages. Each passage gives, with the angle integrated out,

.. math:: \ln \Lambda = \tfrac12 s^T (M + a^{-2})^{-1} s - \tfrac12 \ln |1 + a^2 M|, \quad s = C^T r, \; M = C^T C

M is that of the first wheel: it is the same for all wheels of a train.

Shorter waves are found in the sound level. While a wheel is within ``WHEEL_REACH`` of a sensor, it dominates the
signal. With P the power at that time in bins of :math:`\lambda = v/f` and B that of the bins around it,

.. math:: z = \ln (P / B) - \mathrm{median}_{wheels} \ln (P / B)

is near 0 for a round wheel: hum, resonances and corrugation are common to all wheels of a passage and cancel. The
evidence compares the mean of z over sensors and passages for a polygonal wheel with that for a round one.
"""

from dataclasses import dataclass, replace

import numpy as np

from turnout import physics
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.turnout.candidates.short_corrugation import HIGHEST, SHORTEST, TRANSFER, carried_energy
from turnout.mismatch.turnout.passage_band import SHORTEST_WAVE
from turnout.mismatch.turnout.wave_response import Carrier

WAVELENGTHS = np.geomspace(SHORTEST_WAVE, 1.0, 100)  # m; over 10 m neighbours differ by a third of a period
FINER = np.linspace(0.985, 1.015, 13)  # of the wavelength, for its refinement
AMPLITUDES = np.geomspace(1e-5, 4e-4, 5)  # m, prior sd of cosine and sine
TURNS = 12.0  # distinguishable angles per passage


def polygons(case, fit):
    """The likeliest polygonal wheel as a candidate, () where a round one is likelier."""
    found = [s for train in case.trains for s in of_train(case, fit, train)]
    if not found:
        return ()
    nats, train, wheel, wavelength, _ = max(found, key=lambda f: f[0])
    if nats <= 0.0:
        return ()
    closer = of_train(case, fit, train, wavelength * FINER)
    _, _, _, wavelength, parts = next(f for f in closer if f[2] == wheel)
    return (_candidate(case, train, wheel, wavelength, parts, nats, len(found)),)


def of_train(case, fit, train, wavelengths=WAVELENGTHS):
    """(nats, train, wheel, wavelength, [(recording, cosine, sine)]) of each wheel, 0 first."""
    members = [(o, w) for o, w in zip(case.observations, fit.white) if o.name in case.rollings]
    members = [(o, w) for o, w in members if case.said(case.rollings[o.name])["train"] == train]
    if not members:
        return
    n_wheel = len(case.rollings[members[0][0].name].passage.vehicle.wheels)
    parts = [_slopes(case, fit, o, white, n_wheel, wavelengths) for o, white in members]
    for wheel in range(n_wheel):
        nats = sum(_evidence(slope[wheel], size) for slope, size in parts)  # (n_amplitude, n_wavelength)
        a, k = np.unravel_index(int(np.argmax(nats)), nats.shape)
        prior = np.eye(2) / AMPLITUDES[a] ** 2
        best = [np.linalg.solve(size[k] + prior, slope[wheel][k]) for slope, size in parts]
        together = float(_log_mean(nats))
        yield together, train, wheel, float(wavelengths[k]), [(o.name, *b) for (o, _), b in zip(members, best)]


def _slopes(case, fit, o, white, n_wheel, wavelengths):
    """(n_wheel, n_wavelength, 2) slopes and (n_wavelength, 2, 2) sizes of one passage."""
    made = case.rollings[o.name]
    carrier = Carrier(case, fit.values, made, fit.terms)
    spectra = carrier.spectra(wavelengths, np.ones(carrier.node.size))
    weight = o.effective / fit.scale[o.kind]
    twice = o.whitened(np.asarray(white) * o.sigma) / o.sigma  # the whitening is symmetric: columns need not pass it
    slopes = []
    for wheel in range(n_wheel):
        columns = carrier.shown(spectra, carrier.wheel(wheel))
        slopes.append(weight * (columns.T @ twice).reshape(-1, 2))
        if wheel == 0:
            seen = o.whitened(columns).reshape(o.data.size, -1, 2)
    return np.array(slopes), weight * np.einsum("nki,nkj->kij", seen, seen)


def _evidence(slope, size):
    """(n_amplitude, n_wavelength) nats of one passage."""
    found = []
    for a in AMPLITUDES:
        inside = size + np.eye(2) / a**2
        along = np.einsum("ki,ki->k", slope, np.linalg.solve(inside, slope[..., None])[..., 0])
        found.append(0.5 * along - 0.5 * np.linalg.slogdet(a**2 * inside)[1])
    return np.array(found)


def _log_mean(nats):
    top = nats.max()
    return top + np.log(np.mean(np.exp(nats - top)))


def _candidate(case, train, wheel, wavelength, parts, nats, scanned):
    passage = next(case.rollings[name].passage for name, *_ in parts)
    order = max(1, round(2.0 * np.pi * passage.vehicle.each("radius")[wheel] / wavelength))
    radius = order * wavelength / (2.0 * np.pi)
    middle = np.mean([s.place for s in case.campaign.sensors])  # a wave a little longer then fits there at least
    phases = [(name, np.arctan2(s, c) * radius / order) for name, c, s in parts]
    phases = tuple((name, float(x + wavelength * np.round((middle - x) / wavelength))) for name, x in phases)
    amplitude = float(np.clip(np.median([np.hypot(c, s) for _, c, s in parts]), 0.0, 9e-4))

    def make(p):
        return physics.OutOfRound(wheel, order=order, radius=radius, train=train, phases=phases, **p)

    return Candidate(
        "out_of_round", physics.OutOfRound.parameters, make, ((amplitude, 0.0, 0.0),),
        {"train": train, "axle": wheel + 1}, "wheel", scanned * TURNS ** len(phases), least=2e-5,
        promise=float(nats - np.log(scanned)),
    )  # fmt: skip


REACH = 1.2  # m from wheel to sensor; axles of a bogie are at least 1.8 m apart
STEP, NEAR, FAR = 0.04, 0.2, 0.6  # of ln wavelength: bin width, nearest and farthest bins of the background
TELL_APART = 0.16  # of ln wavelength: resolution of 2.4 m of rail at 0.2 m
SPREAD, ONE = 0.5, 0.8  # sd of z: between wheels (twice that in another simulator), of one spectrum
LOUD = 2.5  # prior sd of z of a polygonal wheel
WHEELS = 3  # least wheels of a train, for a median
LEAST = 2e-5  # m, smallest reported amplitude


@dataclass(frozen=True)
class Slots:
    """Spectra of one passage while each wheel passes each sensor.

    ``level`` (n_sensor, n_wheel, n_bin) is the logarithm of the power, nan where it was not recorded; ``width``
    (n_bin,) lines per bin, ``size`` of the transform, ``window`` (n,) of the samples.
    """

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
    """Whether either half of a train's passages shows at least half the level of the other."""
    return min(levels) > 0.5 * max(levels)


def wavelengths(mades):
    """(n,) centres of the bins, longest first; those at both ends serve as background. [m]"""
    shortest = max([SHORTEST * np.exp(-FAR), *(m.speed / (HIGHEST * m.passage.recording.rate) for m in mades)])
    longest = SHORTEST_WAVE * np.exp(FAR)
    return longest * np.exp(-np.arange(0.0, np.log(longest / shortest), STEP))


def slots_of(made, lengths):
    """``WheelSpectra`` of a passage."""
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
    """(n_sensor, n_wheel) background level of bin k from the bins around it, mean of both sides."""
    away = np.log(lengths[k] / lengths)
    sides = [(away > NEAR) & (away < FAR), (-away > NEAR) & (-away < FAR)]
    return np.mean([np.median(level[..., side], axis=-1) for side in sides], axis=0)


def louder(slots, tried, lengths):
    """(n_wheel, n_tried) mean of z over sensors and passages, and the number of spectra per wheel."""
    above = [np.stack([s.level[..., k] - _usual(s.level, k, lengths) for k in tried], axis=-1) for s in slots]
    heard = [a - np.nanmedian(a, axis=1, keepdims=True) for a in above if not np.isnan(a).all()]
    z = np.concatenate([*heard, np.full((0, *above[0].shape[1:]), np.nan)])
    if not z.size:
        return np.full(above[0].shape[1:], -np.inf), 0
    return np.nan_to_num(np.nanmean(z, axis=0), nan=-np.inf), z.shape[0]


def evidence(z, slots):
    """Nats for a polygonal wheel over a round one, from its mean z over so many spectra."""
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
    r"""(n,) amplitude of the wheel's wave [m] from each sensor, by its energy over the background:

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
