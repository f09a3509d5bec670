"""Hammer tests as observations: receptances of accepted impacts, their errors and their cells in frequency."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from turnout.mismatch.engine.case import Observation
from turnout.receptance import find_impacts

LINES = np.unique(np.round(np.geomspace(35.0, 900.0, 44) / 2.0) * 2.0)  # [Hz]
# 1/s: records are weighted by exp(-DECAY_RATE t), so that ringing at their end is not truncated. Models are evaluated
# at the corresponding complex frequencies, which is exact. After 0.15 s a weight of 5 % remains.
SETTLING = 20.0
SHIFTED = LINES - 1j * SETTLING / (2.0 * np.pi)  # [Hz]
DELAY = 8e-6  # s, standard deviation of the delay of a pair: 2 degrees at 700 Hz
FEWEST = 2  # accepted impacts of a channel, at least
SMOOTH = 0.3  # octaves, correlation length of model errors
FARTHER = 1.5  # m, distance that doubles the error variance, by errors of wave speed and decay
LINE_SHARE = 0.4  # share of the tolerance that is independent from line to line


@dataclass(frozen=True)
class Pair:
    """One response channel of one hammer test.

    ``frequency`` (n,) are the lines with a measured receptance, ``size`` (n,) its magnitude.
    """

    name: str
    test: object
    channel: str
    sensor: object
    frequency: np.ndarray
    size: np.ndarray
    conditions: dict

    @property
    def seat(self):
        """Identity of the sensor: a channel may have been moved during the test, or from the rail to a sleeper."""
        return self.channel, self.sensor.place, self.sensor.mounting

    @cached_property
    def lines(self):
        """(n,) index of its lines in ``LINES``."""
        return np.searchsorted(LINES, self.frequency)


def pairs_of(test, sensors, tolerance):
    """(FrfPair, Observation) of every response channel of a test; channels without accepted impacts are left out.

    The observation is Re and Im of the receptance over its own magnitude, so that all lines have equal weight. Its
    sigma combines the scatter between impacts and ``tolerance``.
    """
    found = []
    for sensor in sensors:
        if not any(c.name == sensor.name for r in test.recordings for c in r.channels):
            continue
        impacts = find_impacts(test.recordings, test.force, sensor.name, test.judged)
        used = [i for i in impacts if i.accepted]
        if len(used) < FEWEST:
            continue
        h, spread = _receptance(used)
        good = np.isfinite(spread) & (spread < 0.3 * np.abs(h)) & (LINES < 0.9 * np.median([i.band_edge for i in used]))
        if good.sum() < 8:
            continue
        name = f"{test.name}:{sensor.name}"
        pair = Pair(name, test, sensor.name, sensor, LINES[good], np.abs(h[good]), dict(test.conditions))
        found.append((pair, observed(pair, h[good], spread[good], tolerance)))
    return found


@lru_cache(maxsize=4)
def _kernel(n, rate):
    """(n_line, n) Fourier kernel at ``SHIFTED_LINES``."""
    return np.exp(-2j * np.pi * SHIFTED[:, None] * np.arange(n) / rate)


def _receptance(impacts):
    """H1 estimate over the accepted impacts and its standard error from their scatter, both (n_line,)."""
    force, response = [], []
    for i in impacts:
        kernel = _kernel(i.force.size, i.rate)
        force.append(kernel @ i.force)
        response.append(kernel @ i.acceleration)
    force, response = np.array(force), np.array(response)
    power = np.sum(np.abs(force) ** 2, axis=0)
    h = np.sum(response * force.conj(), axis=0) / power
    left = np.sum(np.abs(response - h * force) ** 2, axis=0) / max(len(impacts) - 1, 1)
    omega2 = (2.0 * np.pi * SHIFTED) ** 2
    return -h / omega2, np.sqrt(left / power) / np.abs(omega2)


def sized(pair, size):
    """The pair with another magnitude ``size`` of its receptance."""
    return replace(pair, size=size)


def observed(pair, h, spread, tolerance):
    """Observation of a receptance (n,) with standard error ``spread`` (n,)."""
    sigma = np.sqrt((spread / pair.size) ** 2 / 2.0 + (LINE_SHARE * tolerance * _around(pair)) ** 2)
    data = np.concatenate([h.real, h.imag]) / np.tile(pair.size, 2)
    octave = np.floor(np.log2(pair.frequency / 31.25)).astype(int)
    bands = np.unique(octave)
    cells = np.tile(np.searchsorted(bands, octave), 2)
    said = {"sensor": pair.channel, "place": f"{pair.test.place:.1f}", "condition": pair.test.visit}
    labels = {frame: np.array([level] * bands.size, dtype=object) for frame, level in said.items()}
    labels["frequency"] = np.array([f"{31.25 * 2.0**b:.0f} Hz" for b in bands], dtype=object)
    condition = f"blows at {pair.test.place:.1f} m {pair.test.visit}".strip()
    return Observation(
        pair.name, condition, data, np.tile(sigma, 2), 0.7, "hammer", dict(pair.conditions), cells, labels,
        tolerated(pair, h, tolerance), 2,
    )  # fmt: skip


def _around(pair):
    """(n,) rms magnitude over a third of an octave about each line, over the magnitude of the line; at least 1.

    Model errors fill the antiresonances.
    """
    near = np.abs(np.log2(pair.frequency[:, None] / pair.frequency)) < 0.34
    return np.maximum(np.sqrt(near @ pair.size**2 / near.sum(axis=1)) / pair.size, 1.0)


def tolerated(pair, h, tolerance):
    r"""(2n, m) modes of errors of a receptance that no effect explains.

    Gain, tilt over frequency and delay of the pair come from hammer, calibration and mounting. The model has an error
    that is smooth over :math:`\ell = 0.3` octaves: :math:`\epsilon h` with complex normal ε of covariance :math:`\tau^2
    (1 + d^2 / d_0^2) \exp(-\Delta^2 / 2 \ell^2)`, Δ in octaves, d the distance from impact to sensor.
    """
    octave = np.log2(pair.frequency)
    place = getattr(pair.sensor, "place", pair.test.place)
    size = tolerance * np.hypot(1.0, (place - pair.test.place) / FARTHER)
    kernel = np.exp(-0.5 * ((octave[:, None] - octave) / SMOOTH) ** 2)
    power, turn = np.linalg.eigh(kernel)
    keep = power > 1e-3
    smooth = size * turn[:, keep] * np.sqrt(power[keep])
    chain = np.column_stack([np.full(octave.size, tolerance), tolerance * (octave - np.log2(200.0)) / 2.0])
    unit = (h / np.abs(h) * _around(pair))[:, None]
    late = (-2j * np.pi * pair.frequency * DELAY * h / np.abs(h))[:, None]
    columns = np.column_stack([unit * smooth, 1j * unit * smooth, (h / np.abs(h))[:, None] * chain, late])
    return np.concatenate([columns.real, columns.imag])


def shown(terms, conditions):
    """Those of ``terms`` that act in receptances of the track, as they are under ``conditions``."""
    return tuple(t.under(conditions) for t in terms if t.kind in ("matrix", "port"))


def channel_factor(terms, sensor, frequency):
    """(n,) complex factor by which linear channel terms change a spectrum."""
    factor = np.ones(frequency.size, dtype=complex)
    for term in terms:
        if hasattr(term, "transfer") and term.channel_name == sensor.name:
            factor = factor * term.transfer(frequency)
    return factor


def split(value):
    """Re and Im one after the other, along the first axis."""
    return np.concatenate([value.real, value.imag])


def scaled(pair, h, chain=None):
    """A receptance on ``LINES`` at the lines of a pair, over its measured magnitude; complex (n,) or (n, k).

    ``channel_response`` (n_line,) multiplies it.
    """
    size = 1.0 / pair.size if chain is None else chain[pair.lines] / pair.size
    return h[pair.lines] * (size if h.ndim == 1 else size[:, None])
