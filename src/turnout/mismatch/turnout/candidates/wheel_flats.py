r"""Find wheels with a flat by their impacts in the sound level of passages, then size them by their signal in the band.

A flat causes an impact at each turn. Below 100 Hz it is hidden by the roughness of the other wheels. Above 250 Hz it is
10 to 30 dB above their noise at the moment of the impact, in all sensors near the wheel. A single impact may have any
cause. A row of impacts one turn apart, each loudest near one wheel, is a flat on that wheel. The datum is the loudest
moment z around each expected impact, one per sensor; with x the distance from impact to sensor

.. math:: \Lambda = \sum \ln \frac{(1-\epsilon) N(z; m, 1 + m/4) + \epsilon U}
          {(1-\epsilon) N(z; 0, 1) + \epsilon U}, \quad m = \max(A - \beta x, 0)

Impacts scatter, on a sleeper or between two. The outlier term limits the evidence of a single impact, whatever its
cause, to :math:`\ln(1/\epsilon U)`.

The length of a flat is common to all passages of the train; the angle at which the wheel arrives is not, so that every
passage has its own phase. The impacts give it to some centimetres; the simulation, with loss of contact, gives the
rest.
"""

from dataclasses import dataclass

import numpy as np

from turnout import physics
from turnout.errors import SimulationError
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.turnout.passage_band import band_limited

LOW, HIGH = 250.0, 900.0  # Hz, band of the level
BIN, ABOUT_STRIKES, AROUND = 0.002, 0.006, 0.12  # s: bin, half width of an impact, half width of its background
RADII = np.arange(-0.05, 0.031, 0.01)  # relative to the file: a wheel is turned down in service
STEP = 0.06  # m, between trial phases
FINE = 0.02  # m, between positions where wheels are compared
COMMON = 2.0  # deviations, least median over the wheels that is no noise
STRENGTHS, DECAYS = (
    (2.0, 4.0, 7.0, 12.0, 20.0),
    (0.3, 0.8, 1.6, 3.0),
)  # A in deviations of the noise, beta in deviations per metre
ODD, WIDE = 0.05, 1.0 / 20.0  # share and density of outliers
UNEVEN = 0.25  # scatter of the impacts, as a share of their expected level
HEARD = 5.0  # m; farther impacts are masked by nearer wheels
TOGETHER = 0.5  # sensors measure the same impact: their data count half


@dataclass(frozen=True)
class Strikes:
    """Evidence [nats] that a wheel (0 first) of a train has a flat.

    ``radius`` is that of the wheel [m], ``phases`` (recording, rolling distance to the first impact [m]).
    """

    nats: float
    train: str
    wheel: int
    radius: float
    phases: tuple


def loudness(samples, rate, start, stop):
    """(time (n,) [s], (n_channel, n)) loudest moment around each time, in robust deviations from the background."""
    fold = max(1, round(BIN * rate))
    power = band_limited(samples, rate, low=LOW, high=min(HIGH, 0.35 * rate)) ** 2
    n = power.shape[1] // fold
    level = np.log(power[:, : n * fold].reshape(-1, n, fold).mean(axis=2) + 1e-12)
    time = (np.arange(n) + 0.5) * fold / rate
    keep = (time > start) & (time < stop)
    time, level = time[keep], level[:, keep]
    half = max(1, round(ABOUT_STRIKES * rate / fold))
    loudest = np.max(_shifted(level, np.arange(-half, half + 1)), axis=0)
    usual = np.median(_shifted(loudest, np.arange(-round(AROUND / BIN), round(AROUND / BIN) + 1, 4)), axis=0)
    above = loudest - usual
    spread = 1.4826 * np.median(np.abs(above - np.median(above, axis=1, keepdims=True)), axis=1, keepdims=True)
    return time, above / np.maximum(spread, 1e-6)


def _shifted(rows, steps):
    """(n_step, n_row, n) copies of rows (n_row, n) shifted by steps, with constant ends."""
    index = np.clip(np.arange(rows.shape[1]) + np.asarray(steps)[:, None], 0, rows.shape[1] - 1)
    return np.moveaxis(rows[:, index], 1, 0)


def likelihood(seen, expected):
    """Log likelihood ratio of ``deviations`` for an impact of ``expected`` deviations against none. [nats]"""
    noise, blow = (_normal(seen - m, 1.0 + UNEVEN * m) for m in (0.0, expected))
    return np.log((1.0 - ODD) * blow + ODD * WIDE) - np.log((1.0 - ODD) * noise + ODD * WIDE)


def _normal(off, spread):
    return np.exp(-0.5 * (off / spread) ** 2) / (np.sqrt(2.0 * np.pi) * spread)


def heard(made):
    """(time, band level) of the sensors of an ``AlignedPassage``, without the level that all wheels share."""
    recording = made.passage.recording
    rows = [recording.index(s.name) for s in made.sensors]
    time, loud = loudness(recording.samples[rows], recording.rate, made.time[0], made.time[-1])
    return time, loud - _common(made, time, loud)


def _common(made, time, loud):
    """(n_sensor, n) level that all wheels have at a position, for the position of any wheel at these times.

    It is the median over the wheels, 0 where that is noise. Where all of them cause impacts, at a nose or a joint, the
    cause is in the rail. Of an even number of wheels it is the lower median, so that a flat of one of two wheels stays.
    One wheel alone gives no such level.
    """
    behind = made.passage.vehicle.wheel_places[:, None]
    if len(behind) < 2:
        return np.zeros_like(loud)
    way = np.arange(-HEARD, np.ptp([s.place for s in made.sensors]) + HEARD, FINE)  # from the first sensor
    passed = made.reference + (way + behind) / made.speed
    each = np.array(
        [np.sort([np.interp(t, time, row) for t in passed], axis=0)[(len(behind) - 1) // 2] for row in loud]
    )
    usual = np.where(each > COMMON, each, 0.0)
    rolled = (time - made.reference) * made.speed - behind
    return np.array([np.max(np.interp(rolled, way, row, 0.0, 0.0), axis=0) for row in usual])


def of_wheel(mades, loud, wheel):
    """(nats, radius, phases) of the flat on one wheel that explains the band levels of one train best."""
    radius, found = mades[0].passage.vehicle.each("radius")[wheel], []
    for share in 1.0 + RADII:
        turn = 2.0 * np.pi * radius * share
        ratios = [_ratios(m, *heard_, wheel, turn) for m, heard_ in zip(mades, loud)]
        total = sum(_mean(r, axis=0) for r in ratios)  # (n_strength * n_decay,)
        found.append((total, share, ratios))
    all_ = np.array([total for total, *_ in found])
    nats, best = _mean(all_.ravel(), axis=0), np.unravel_index(int(np.argmax(all_)), all_.shape)
    _, share, ratios = found[best[0]]
    phases = tuple((m.name, float(STEP * np.argmax(r[:, best[1]]))) for m, r in zip(mades, ratios))
    return float(nats), float(share * radius), phases


def _mean(ratio, axis):
    """Logarithm of the mean of likelihoods, which integrates out the parameter of this axis."""
    top = np.max(ratio, axis=axis)
    return top + np.log(np.mean(np.exp(ratio - np.expand_dims(top, axis)), axis=axis))


def _ratios(made, time, loud, wheel, turn):
    """(n_phase, n_strength * n_decay) log ratios of one passage."""
    phases = np.arange(0.0, turn, STEP)
    sign = 1.0 if made.passage.direction == "facing" else -1.0
    sensors = np.array([s.place for s in made.sensors])
    first = sign * np.min(sign * sensors)
    reach = np.arange(np.floor((sensors.min() - HEARD) / turn) - 1, np.ceil((sensors.max() + HEARD) / turn) + 1)
    place = phases[:, None] + turn * reach  # (n_phase, n_impact)
    when = made.reference + (sign * (place - first) + made.passage.vehicle.wheel_places[wheel]) / made.speed
    way = np.abs(place[..., None] - sensors)
    known = ((when > time[0]) & (when < time[-1]))[..., None] & (way < HEARD)
    seen = np.stack([np.interp(when, time, row) for row in loud], axis=-1)
    found = []
    for strength in STRENGTHS:
        for decay in DECAYS:
            ratio = likelihood(seen, np.maximum(strength - decay * way, 0.0))
            found.append(TOGETHER * np.sum(np.where(known, ratio, 0.0), axis=(1, 2)))
    return np.array(found).T


def strikes(case):
    """``FlatEvidence`` of every wheel of every train of a case, the likeliest first."""
    found = []
    for train in case.trains:
        names = [o.name for o in case.observations if o.name in case.rollings]
        mades = [m for m in (case.rollings[n] for n in names) if case.said(m)["train"] == train]
        if not mades:
            continue
        loud = [heard(m) for m in mades]
        for wheel in range(len(mades[0].passage.vehicle.wheels)):
            nats, radius, phases = of_wheel(mades, loud, wheel)
            found.append(Strikes(nats, train, wheel, radius, phases))
    return sorted(found, key=lambda s: -s.nats)


NAMED, CLOSE = 2, 3.0  # wheels proposed; nats by which the second may lie behind the first
LEAST = 3.0  # nats of the impacts, less the logarithm of the number of wheels, at least
ABOUT, APART = np.arange(-0.24, 0.25, 0.06), 0.15  # m, trial phases about that of the impacts; their resolution
NEAR = (-0.03, 0.0, 0.03)  # m, about the best of them
MIDDLING, LENGTHS = 0.05, (0.025, 0.035, 0.045, 0.055, 0.07, 0.09)  # m, first and trial lengths


def flats(case, fit):
    """Candidates of the wheels that most likely have a flat."""
    found, known = strikes(case), {c.where.get("train") for c in fit.candidates if "axle" in c.where}
    loud = [s for s in found if s.nats > LEAST + np.log(len(found)) and s.train not in known]
    loud = [s for s in loud if s.nats > loud[0].nats - CLOSE]
    return tuple(_candidate(case, fit, s, len(found)) for s in loud[:NAMED])


def _candidate(case, fit, struck, wheels):
    length, phases, gain = _sized(case, fit, struck)

    def make(p):
        return physics.WheelFlat(struck.wheel, radius=struck.radius, train=struck.train, phases=phases, **p)

    where = {"train": struck.train, "axle": struck.wheel + 1}
    scanned = wheels * (1.0 + np.ptp(ABOUT) / APART) ** len(phases)
    return Candidate(
        "wheel_flat", physics.WheelFlat.parameters, make, ((length,),), where, "wheel", scanned,
        promise=float(gain + struck.nats - np.log(scanned)), aside=struck.nats, sounding=True,
    )  # fmt: skip


def _sized(case, fit, struck):
    """(length [m], phases, nats) at which the simulated flat explains most of the band, with loss of contact."""
    phases = _turned(case, fit, struck, struck.phases, ABOUT, MIDDLING)
    length, gain = _longest(case, fit, struck, phases)
    if gain > 0.0:  # else a flat of no length explains anything
        phases = _turned(case, fit, struck, phases, NEAR, length)
        length, gain = _longest(case, fit, struck, phases)
    return length, phases, max(gain, 0.0)


def _turned(case, fit, struck, phases, about, length):
    """The phases shifted to where a flat of this length explains most."""
    found = []
    for name, phase in phases:
        tried = [(_gain(case, fit, struck, name, phase + more, length), float(phase + more)) for more in about]
        found.append((name, max(tried)[1]))
    return tuple(found)


def _longest(case, fit, struck, phases):
    """(length, nats) of the length that explains most at these phases."""
    sizes = [(sum(_gain(case, fit, struck, *at, length) for at in phases), length) for length in LENGTHS]
    gain, length = max(sizes)
    return length, gain


def _gain(case, fit, struck, name, phase, length):
    """Nats that a flat explains in one passage, all else as fitted."""
    k = next(i for i, o in enumerate(case.observations) if o.name == name)
    o = case.observations[k]
    term = physics.WheelFlat(struck.wheel, length, struck.radius, phase, struck.train)
    try:
        (predicted,) = case.predict(fit.values, (*fit.terms, term), [o])
    except SimulationError:
        return -np.inf
    before, after = (float(np.sum(o.whitened(o.data - p) ** 2)) for p in (fit.predictions[k], predicted))
    return 0.5 * o.effective / fit.scale[o.kind] * (before - after)
