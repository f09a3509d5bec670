r"""Find corrugation shorter than the simulated waves: a line at one wavelength in the sound level of all trains.

The band in which passages are fitted ends at the shortest free wave of the rail; most corrugation is shorter. Above
that band the signal is roughness with a level that is smooth in the wavelength. With P the mean power of a sensor in
bins of :math:`\lambda = v/f` and B the median of the bins around it,

.. math:: z = \overline{\ln (P / B)}

scatters with the roughness under that sensor, which is the same in all passages, and is large where the rail has waves
of that length. A wave of a wheel shows in its train alone. A hum or a resonance has one frequency: its wavelength
differs between slow and fast passages.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal.windows import tukey

from turnout import physics
from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.turnout import passage_band, passage_model
from turnout.mismatch.turnout.matrix_cache import matrices_of
from turnout.mismatch.turnout.track_parameters import track_with
from turnout.mismatch.turnout.wave_response import carried, wheel_and_contact

SHORTEST, WIDTH = 0.05, 0.05  # m; bin width in ln wavelength, the resolution of 5 m of rail at 0.2 m
LINE = 2  # bins to either side over which a line spreads
AWAY, AROUND = 2, 6  # bins, nearest and farthest of the background
HIGHEST = 0.35  # highest frequency over the sampling rate: above, the anti-alias filter may act
SPREAD = 0.8  # sd of z of one sensor on intact rail: 0.62 and 1.0 in two simulators
LOUD = 2.0  # prior sd of z of corrugation
TRAINS = 2  # least trains, to distinguish the rail from wheels
SPEEDS = 1.25  # least ratio of fastest to slowest passage, to distinguish a wavelength from a frequency
HEARD = 2.0  # m; closer sensors measure the same rail
REACHES = (1.0, 1.8, 3.2, 5.0)  # m, half the length of the stretch
AMPLITUDES = np.geomspace(2e-6, 3e-4, 60)  # m, tested
TRANSFER = 0.15  # relative error of the response at one frequency
STRIDE = 2  # every second node is used
LEAST = 1e-5  # m, smallest reported amplitude: EN 13231-3 allows it on a ground rail for waves up to 0.3 m


@dataclass(frozen=True)
class Loud:
    """Power of one passage in bins of the wavelength.

    ``power`` and its ``background`` (n_recorded, n_bin) are means of the squared spectrum. ``recorded`` (n_sensor,)
    marks the sensors with a signal.
    """

    name: str
    train: str
    speed: float
    power: np.ndarray
    usual: np.ndarray
    alive: np.ndarray

    @property
    def above(self):
        """(n_recorded, n_bin) logarithm of the power over its background."""
        return np.log(self.power / self.usual)


def bins(mades):
    """(n,) wavelengths that every passage covers, longest first [m]."""
    shortest = max([SHORTEST, *(m.speed / (HIGHEST * m.passage.recording.rate) for m in mades)])
    longest = passage_band.SHORTEST_WAVE * np.exp(WIDTH * (AROUND + 1))  # the first bins are background alone
    return longest * np.exp(-np.arange(0.0, np.log(longest / shortest), WIDTH))


def loud_of(case, made, wavelengths):
    """``BandPower`` of a passage."""
    recording = made.passage.recording
    rows = [recording.index(s.name) for s in made.sensors]
    first, last = (round(t * recording.rate) for t in (made.time[0], made.time[-1]))
    samples = recording.samples[rows][:, max(first, 0) : last]
    edge = 2.0 * passage_model.EDGE * recording.rate / samples.shape[1]
    n = 1 << int(np.ceil(np.log2(4 * samples.shape[1])))  # finer lines than bins
    power = np.abs(np.fft.rfft(samples * tukey(samples.shape[1], min(edge, 1.0)), n)) ** 2
    frequency = np.arange(power.shape[1]) * recording.rate / n
    edges = np.searchsorted(frequency, made.speed / wavelengths[:, None] * np.exp([-0.5 * WIDTH, 0.5 * WIDTH]))
    alive = np.any(samples != samples[:, :1], axis=1)
    power = power[alive]
    total = np.column_stack([power[:, a : max(b, a + 1)].mean(axis=1) for a, b in edges])
    level = np.log(total)
    near = np.abs(np.subtract.outer(np.arange(wavelengths.size), np.arange(wavelengths.size)))
    near = (near >= AWAY) & (near <= AROUND)
    usual = np.exp(np.column_stack([np.median(level[:, row], axis=1) for row in near]))
    return Loud(made.name, made.passage.train, made.speed, total, usual, alive)


def groups(passages):
    """Passages of each train, the slower and the faster ones: corrugation must show in all groups."""
    trains = sorted({p.train for p in passages})
    middle = np.sqrt(min(p.speed for p in passages) * max(p.speed for p in passages))
    found = [[p for p in passages if p.train == t] for t in trains]
    return [*found, [p for p in passages if p.speed < middle], [p for p in passages if p.speed >= middle]]


def evidence(passages, apart):
    """(n_bin,) nats for a line that all trains show at all speeds, over roughness alone.

    ``n_sensors`` is the number of sensors on different rail.
    """
    z = np.min([np.mean([p.above.mean(axis=0) for p in group], axis=0) for group in groups(passages)], axis=0)
    z, spread = np.maximum(z, 0.0), SPREAD**2 / apart
    wide = spread + LOUD**2
    return 0.5 * np.log(spread / wide) + 0.5 * z**2 * (1.0 / spread - 1.0 / wide)


def short_waves(case, fit):
    """The likeliest short corrugation as a candidate, () where intact rail is likelier or the data cannot tell."""
    mades = sorted((m for m in case.fitted() if m.passage.train), key=lambda m: m.speed)
    if any(c.family == "rail_corrugation" for c in fit.candidates) or not _telling(mades):
        return ()
    wavelengths = bins(mades)
    if wavelengths.size <= 2 * AROUND:
        return ()
    seen = [loud_of(case, m, wavelengths) for m in mades]
    if not all(len(p.power) for p in seen):
        return ()
    nats = evidence(seen, _apart(case))
    nats[_known(case, wavelengths)] = -np.inf
    k = int(np.argmax(nats))
    if wavelengths[k] >= passage_band.SHORTEST_WAVE or nats[k] < np.log(nats.size) or not _holds(seen, k):
        return ()
    return (_candidate(case, fit, wavelengths, k, float(nats[k]), seen),)


def _telling(mades):
    """Whether trains and speeds differ enough to distinguish the rail from wheels and from frequencies."""
    speeds = [m.speed for m in mades]
    return len({m.passage.train for m in mades}) >= TRAINS and max(speeds) > SPEEDS * min(speeds)


def _apart(case):
    """Effective number of sensors on different rail."""
    places = sorted(s.place for s in case.campaign.sensors)
    return 1.0 + float(np.sum(np.minimum(np.diff(places) / HEARD, 1.0)))


def _known(case, wavelengths):
    """(n_bin,) whether the track's file has corrugation of about that length."""
    parts = [p for m in case.rollings.values() for s in case.zone.turnout.surfaces(m.passage.route) for p in s]
    known = np.array([p.wavelength for p in parts if hasattr(p, "wavelength")])
    return np.any(np.abs(np.log(wavelengths[:, None] / known)) < (LINE + 0.5) * WIDTH, axis=1)


def _holds(seen, k):
    """Whether the line repeats: passages in order of speed are split into two halves.

    Either half must show at least half the level of the other.
    """
    levels = [np.mean([p.above[:, k].mean() for p in half]) for half in (seen[::2], seen[1::2])]
    return min(levels) > 0.5 * max(levels)


def _candidate(case, fit, wavelengths, k, nats, seen):
    about = _about(k)
    over = np.mean([(p.power[:, about] / p.usual[:, about]).mean(axis=0) - 1.0 for p in seen], axis=0)
    weight = np.maximum(over, 0.0)
    length = float(np.exp(weight @ np.log(wavelengths[about]) / weight.sum()))
    middle, reach, amplitude, error = _sized(case, fit, length, about, seen)
    a, b = middle - reach, middle + reach
    priors = {"sine": (amplitude, error), "wavelength": (length, 0.5 * WIDTH * length)}
    parameters = tuple(replace(p, prior=priors[p.name]) for p in physics.RailCorrugation.parameters if p.name in priors)
    where = {"wavelength": round(length, 3), "place": round(float(middle), 2)}
    return Candidate(
        "rail_corrugation", parameters, lambda p: physics.RailCorrugation(a, b, **p), ((amplitude, length),), where,
        "wavelength", int(np.count_nonzero(wavelengths < passage_band.SHORTEST_WAVE)),
        promise=nats - float(np.log(wavelengths.size)), aside=nats, least=LEAST,
    )  # fmt: skip


def _about(k):
    """Bins over which a line spreads: a stretch of 3 m is some 10 % wide at 0.3 m."""
    return slice(max(k - LINE, 0), k + LINE + 1)


def _sized(case, fit, length, about, seen):
    """(middle, half the stretch, amplitude, its standard error) [m] of waves of this length.

    These explain the power of each sensor in each passage best.
    """
    places = [s.place for s in case.campaign.sensors]
    middles = np.arange(min(places), max(places) + 0.1, 0.5)
    shapes = [(m, r) for m in middles for r in REACHES]
    found = np.zeros((len(shapes), AMPLITUDES.size))
    for p in seen:
        unit = _unit_energy(case, fit, case.rollings[p.name], length, shapes)  # (n_shape, n_sensor)
        expected = AMPLITUDES[:, None, None] ** 2 * unit[:, p.alive] + p.usual[:, about].sum(axis=1)
        found += np.sum((np.log(p.power[:, about].sum(axis=1)) - np.log(expected)) ** 2, axis=2).T
    n = sum(len(p.power) for p in seen)
    best, size = np.unravel_index(int(np.argmin(found)), found.shape)
    spread = found[best, size] / n
    posterior = np.exp(-0.5 * (found - found[best, size]) / max(spread, SPREAD**2))
    posterior = posterior.sum(axis=0) / posterior.sum()
    mean = float(posterior @ np.log(AMPLITUDES))
    error = float(np.sqrt(posterior @ (np.log(AMPLITUDES) - mean) ** 2 + TRANSFER**2))
    return *shapes[best], float(np.exp(mean)), error * float(np.exp(mean))


def _unit_energy(case, fit, made, length, shapes):
    r"""(n_shape, n_sensor) power, as in ``BandPower``, of waves one metre high.

    The force of the wheel at v/λ is carried to the sensor from the position of the wheel:

    .. math:: \int y^2 dt = \tfrac12 \sum_w |F|^2 \int |G(x)|^2 e(x)^2 \, dx / v, \quad
              F = 1 / (A_{wheel} + A_{contact} + A_{rail})
    """
    node, gain = carried_energy(case, fit, made, length)
    inside = np.array([np.abs(node - m) <= r for m, r in shapes])
    energy = 0.5 * len(made.passage.vehicle.wheels) / made.speed * np.trapezoid(inside[:, None] * gain, node, axis=2)
    return energy * made.passage.recording.rate**2 / (2.0 * WIDTH * made.speed / length)  # Parseval, half at f < 0


def carried_energy(case, fit, made, length):
    """Nodes (n,) [m], and squared acceleration (n_sensor, n) [1/s^4] at each sensor for one wheel at the node.

    The wheel rolls over a wave of this length, one metre high.
    """
    track = track_with(case.track(made.passage.route), case.zone, fit.values)
    matrices, frequency = matrices_of(track), np.array([made.speed / length])
    near = np.flatnonzero((matrices.node >= case.waves.start) & (matrices.node <= case.waves.end))[::STRIDE]
    h, met = carried(matrices, frequency, near, [s.probe(track).place for s in made.sensors])
    force = 1.0 / np.abs(wheel_and_contact(made.passage.vehicle, frequency)[:, None] + met)[0]
    return matrices.node[near], ((2.0 * np.pi * frequency) ** 2 * force * np.abs(h[0])) ** 2
