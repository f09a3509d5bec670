"""Hammer tests as observations: receptances of accepted impacts, their errors and their cells in frequency."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from turnout.hammer_test import find_impacts
from turnout.mismatch.engine.case import Observation
from turnout.mismatch.turnout.priors import RECEPTANCE

LINES = np.geomspace(RECEPTANCE.lowest_line, RECEPTANCE.highest_line, RECEPTANCE.n_lines)  # [Hz]
LINES = np.unique(np.round(LINES / RECEPTANCE.line_step) * RECEPTANCE.line_step)
SHIFTED_LINES = LINES - 1j * RECEPTANCE.decay_rate / (2.0 * np.pi)  # [Hz]


@dataclass(frozen=True)
class FrfPair:
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


def pairs_of_test(test, sensors, tolerance):
    """(FrfPair, Observation) of every response channel of a test; channels without accepted impacts are left out.

    The observation is Re and Im of the receptance over its own magnitude, so that all lines have equal weight. Its
    sigma combines the scatter between impacts and ``tolerance``.
    """
    pairs = []
    for sensor in sensors:
        if not any(c.name == sensor.name for r in test.recordings for c in r.channels):
            continue
        impacts = find_impacts(test.recordings, test.force, sensor.name, test.impact_settings)
        accepted = [i for i in impacts if i.accepted]
        if len(accepted) < RECEPTANCE.min_impacts:
            continue
        h, spread = _receptance_and_error(accepted)
        usable = (
            np.isfinite(spread)
            & (spread < RECEPTANCE.max_relative_error * np.abs(h))
            & (LINES < RECEPTANCE.max_band_share * np.median([i.band_edge for i in accepted]))
        )
        if usable.sum() < RECEPTANCE.min_lines:
            continue
        name = f"{test.name}:{sensor.name}"
        pair = FrfPair(name, test, sensor.name, sensor, LINES[usable], np.abs(h[usable]), dict(test.conditions))
        pairs.append((pair, observation_of(pair, h[usable], spread[usable], tolerance)))
    return pairs


@lru_cache(maxsize=4)
def _transform_kernel(n, rate):
    """(n_line, n) Fourier kernel at ``SHIFTED_LINES``."""
    return np.exp(-2j * np.pi * SHIFTED_LINES[:, None] * np.arange(n) / rate)


def _receptance_and_error(impacts):
    """H1 estimate over the accepted impacts and its standard error from their scatter, both (n_line,)."""
    force, response = [], []
    for i in impacts:
        kernel = _transform_kernel(i.force.size, i.rate)
        force.append(kernel @ i.force)
        response.append(kernel @ i.acceleration)
    force, response = np.array(force), np.array(response)
    power = np.sum(np.abs(force) ** 2, axis=0)
    h = np.sum(response * force.conj(), axis=0) / power
    residual = np.sum(np.abs(response - h * force) ** 2, axis=0) / max(len(impacts) - 1, 1)
    omega2 = (2.0 * np.pi * SHIFTED_LINES) ** 2
    return -h / omega2, np.sqrt(residual / power) / np.abs(omega2)


def with_magnitude(pair, size):
    """The pair with another magnitude ``size`` of its receptance."""
    return replace(pair, size=size)


def observation_of(pair, h, spread, tolerance):
    """Observation of a receptance (n,) with standard error ``spread`` (n,)."""
    sigma = np.sqrt(
        (spread / pair.size) ** 2 / 2.0 + (RECEPTANCE.line_share * tolerance * _local_magnitude_ratio(pair)) ** 2
    )
    data = np.concatenate([h.real, h.imag]) / np.tile(pair.size, 2)
    octave = np.floor(np.log2(pair.frequency / RECEPTANCE.lowest_band)).astype(int)
    bands = np.unique(octave)
    cells = np.tile(np.searchsorted(bands, octave), 2)
    frame_levels = {"sensor": pair.channel, "place": f"{pair.test.place:.1f}", "condition": pair.test.visit}
    labels = {frame: np.array([level] * bands.size, dtype=object) for frame, level in frame_levels.items()}
    labels["frequency"] = np.array([f"{RECEPTANCE.lowest_band * 2.0**b:.0f} Hz" for b in bands], dtype=object)
    condition = f"blows at {pair.test.place:.1f} m {pair.test.visit}".strip()
    return Observation(
        pair.name,
        condition,
        data,
        np.tile(sigma, 2),
        RECEPTANCE.effective_share,
        "hammer",
        dict(pair.conditions),
        cells,
        labels,
        error_modes(pair, h, tolerance),
        rows=2,
    )


def _local_magnitude_ratio(pair):
    """(n,) rms magnitude over a third of an octave about each line, over the magnitude of the line; at least 1.

    Model errors fill the antiresonances.
    """
    near = np.abs(np.log2(pair.frequency[:, None] / pair.frequency)) < RECEPTANCE.magnitude_octaves
    return np.maximum(np.sqrt(near @ pair.size**2 / near.sum(axis=1)) / pair.size, 1.0)


def error_modes(pair, h, tolerance):
    r"""(2n, m) modes of errors of a receptance that no effect explains.

    Gain, tilt over frequency and delay of the pair come from hammer, calibration and mounting. The model has an error
    that is smooth over :math:`\ell = 0.3` octaves: :math:`\epsilon h` with complex normal ε of covariance :math:`\tau^2
    (1 + d^2 / d_0^2) \exp(-\Delta^2 / 2 \ell^2)`, Δ in octaves, d the distance from impact to sensor.
    """
    octave = np.log2(pair.frequency)
    position = getattr(pair.sensor, "place", pair.test.place)
    size = tolerance * np.hypot(1.0, (position - pair.test.place) / RECEPTANCE.doubling_distance)
    kernel = np.exp(-0.5 * ((octave[:, None] - octave) / RECEPTANCE.smoothing_octaves) ** 2)
    power, vectors = np.linalg.eigh(kernel)
    keep = power > 1e-3
    smooth = size * vectors[:, keep] * np.sqrt(power[keep])
    calibration = np.column_stack([np.full(octave.size, tolerance), tolerance * (octave - np.log2(200.0)) / 2.0])
    unit = (h / np.abs(h) * _local_magnitude_ratio(pair))[:, None]
    delay = (-2j * np.pi * pair.frequency * RECEPTANCE.delay_sd * h / np.abs(h))[:, None]
    columns = np.column_stack([unit * smooth, 1j * unit * smooth, (h / np.abs(h))[:, None] * calibration, delay])
    return np.concatenate([columns.real, columns.imag])


def track_terms(terms, conditions):
    """Those of ``terms`` that act in receptances of the track, as they are under ``conditions``."""
    return tuple(t.under_conditions(conditions) for t in terms if t.effect_type in ("matrix", "port"))


def channel_factor(terms, sensor, frequency):
    """(n,) complex factor by which linear channel terms change a spectrum."""
    factor = np.ones(frequency.size, dtype=complex)
    for term in terms:
        if hasattr(term, "transfer") and term.channel_name == sensor.name:
            factor = factor * term.transfer(frequency)
    return factor


def split_complex(value):
    """Re and Im one after the other, along the first axis."""
    return np.concatenate([value.real, value.imag])


def scale_lines(pair, h, channel_response=None):
    """A receptance on ``LINES`` at the lines of a pair, over its measured magnitude; complex (n,) or (n, k).

    ``channel_response`` (n_line,) multiplies it.
    """
    size = 1.0 / pair.size if channel_response is None else channel_response[pair.lines] / pair.size
    return h[pair.lines] * (size if h.ndim == 1 else size[:, None])
