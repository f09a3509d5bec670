"""Hammer tests as observations: receptances of accepted impacts, their errors and their cells in frequency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.observation import Observation
from turnout.mismatch.turnout.campaign import HammerInput
from turnout.mismatch.turnout.priors import RECEPTANCE
from turnout.physics.transfer import TransferTerm
from turnout.simulate.sensor import Sensor

if TYPE_CHECKING:
    from turnout.physics.term import PhysicsTerm
    from turnout.records import Impact

LINES = np.geomspace(RECEPTANCE.lowest_line, RECEPTANCE.highest_line, RECEPTANCE.n_lines)  # [Hz]
LINES = np.unique(np.round(LINES / RECEPTANCE.line_step) * RECEPTANCE.line_step)
SHIFTED_LINES = LINES - 1j * RECEPTANCE.decay_rate / (2.0 * np.pi)  # [Hz]


@dataclass(frozen=True)
class FrfPair:
    """One response channel of one hammer test.

    ``frequency`` (n,) are the lines with a measured receptance, ``size`` (n,) its magnitude.
    """

    name: str
    test: HammerInput
    channel: str
    sensor: Sensor
    frequency: np.ndarray
    size: np.ndarray
    conditions: dict[str, Any]

    @property
    def seat(self) -> tuple[str, float, str]:
        """Identity of the sensor: a channel may have been moved during the test, or from the rail to a sleeper."""
        return self.channel, self.sensor.place, self.sensor.mounting

    @cached_property
    def conditions_key(self) -> tuple:
        """``conditions`` as something to look up."""
        return tuple(sorted(self.conditions.items()))

    @cached_property
    def lines(self) -> np.ndarray:
        """(n,) index of its lines in ``LINES``."""
        return np.searchsorted(LINES, self.frequency)

    @cached_property
    def typical_impact(self) -> Impact:
        """Accepted impact with the median peak force."""
        accepted = sorted(self.test.accepted_impacts(self.channel), key=lambda i: i.peak)
        return accepted[len(accepted) // 2]


def pairs_of_test(
    test: HammerInput, sensors: Sequence[Sensor], tolerance: float, highest: float = RECEPTANCE.highest_line
) -> list[tuple[FrfPair, Observation]]:
    """Every response channel of a test with its observation; channels without accepted impacts are left out.

    The observation is Re and Im of the receptance over its own magnitude, so that all lines have equal weight. Its
    sigma combines the scatter between impacts and ``tolerance``.

    Parameters
    ----------
    test : HammerInput
        The hammer test.
    sensors : sequence of Sensor
        The sensors.
    tolerance : float
        Relative error of a receptance by hammer, calibration and mounting. [-]
    highest : float
        Highest frequency that is used. [Hz]

    Returns
    -------
    list of (FrfPair, Observation)
        In the order of the sensors.
    """
    pairs = []
    for sensor in sensors:
        accepted = test.accepted_impacts(sensor.name)
        if len(accepted) < RECEPTANCE.min_impacts:
            continue
        h, spread = _receptance_and_error(accepted)
        usable = (
            np.isfinite(spread)
            & (spread < RECEPTANCE.max_relative_error * np.abs(h))
            & (LINES <= highest)
            & (LINES < RECEPTANCE.max_band_share * np.median([i.band_edge for i in accepted]))
        )
        if usable.sum() < RECEPTANCE.min_lines:
            continue
        name = f"{test.name}:{sensor.name}"
        pair = FrfPair(name, test, sensor.name, sensor, LINES[usable], np.abs(h[usable]), dict(test.conditions))
        pairs.append((pair, observation_of(pair, h[usable], spread[usable], tolerance)))
    return pairs


@lru_cache(maxsize=4)
def _transform_kernel(n: int, rate: float) -> np.ndarray:
    """(n_line, n) Fourier kernel at ``SHIFTED_LINES``."""
    return np.exp(-2j * np.pi * SHIFTED_LINES[:, None] * np.arange(n) / rate)


def _receptance_and_error(impacts: Sequence[Impact]) -> tuple[np.ndarray, np.ndarray]:
    """H1 estimate over the accepted impacts and its standard error from their scatter, both (n_line,)."""
    kernels = [_transform_kernel(i.force.size, i.rate) for i in impacts]
    force = np.array([kernel @ i.force for kernel, i in zip(kernels, impacts)])
    response = np.array([kernel @ i.acceleration for kernel, i in zip(kernels, impacts)])
    power = np.sum(np.abs(force) ** 2, axis=0)
    h = np.sum(response * force.conj(), axis=0) / power
    residual = np.sum(np.abs(response - h * force) ** 2, axis=0) / max(len(impacts) - 1, 1)
    omega2 = (2.0 * np.pi * SHIFTED_LINES) ** 2
    return -h / omega2, np.sqrt(residual / power) / np.abs(omega2)


def with_magnitude(pair: FrfPair, size: np.ndarray) -> FrfPair:
    """The pair with another magnitude ``size`` of its receptance.

    Parameters
    ----------
    pair : FrfPair
        Response channel of a hammer test.
    size : (n,) array of float
        Magnitude on the lines of the pair. [m/N]

    Returns
    -------
    FrfPair
    """
    return replace(pair, size=size)


def observation_of(pair: FrfPair, h: np.ndarray, spread: np.ndarray, tolerance: float) -> Observation:
    """Observation of a receptance (n,) with standard error ``spread`` (n,).

    Parameters
    ----------
    pair : FrfPair
        Response channel of a hammer test.
    h : (n,) array of complex
        Receptance on the lines of the pair. [m/N]
    spread : (n,) array of float
        Standard error. [m/N]
    tolerance : float
        Relative error of a receptance by hammer, calibration and mounting. [-]

    Returns
    -------
    Observation
        Re and Im over the magnitude of the pair.
    """
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
    condition = f"impacts at {pair.test.place:.1f} m {pair.test.visit}".strip()
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


def _local_magnitude_ratio(pair: FrfPair) -> np.ndarray:
    """(n,) rms magnitude over a third of an octave about each line, over the magnitude of the line; at least 1.

    Model errors fill the antiresonances.
    """
    return np.maximum(local_rms(pair.frequency, pair.size) / pair.size, 1.0)


def error_modes(pair: FrfPair, h: np.ndarray, tolerance: float) -> np.ndarray:
    r"""Modes of errors of a receptance that no effect explains.

    Gain, tilt over frequency and delay of the pair come from hammer, calibration and mounting. The model has an error
    that is smooth over :math:`\ell = 0.3` octaves: :math:`\epsilon h` with complex normal ε of covariance :math:`\tau^2
    (1 + d^2 / d_0^2) \exp(-\Delta^2 / 2 \ell^2)`, Δ in octaves, d the distance from impact to sensor.

    Parameters
    ----------
    pair : FrfPair
        Response channel of a hammer test.
    h : (n,) array of complex
        Receptance on the lines of the pair. [m/N]
    tolerance : float
        Relative error of a receptance by hammer, calibration and mounting. [-]

    Returns
    -------
    (2n, m) array of float
        In units of the observation.
    """
    octave = np.log2(pair.frequency)
    position = getattr(pair.sensor, "place", pair.test.place)
    smooth = tolerance * np.hypot(1.0, (position - pair.test.place) / RECEPTANCE.doubling_distance)
    smooth = smooth * smooth_functions(pair.frequency)
    calibration = np.column_stack([np.full(octave.size, tolerance), tolerance * (octave - np.log2(200.0)) / 2.0])
    unit = (h / np.abs(h) * _local_magnitude_ratio(pair))[:, None]
    delay = (-2j * np.pi * pair.frequency * RECEPTANCE.delay_sd * h / np.abs(h))[:, None]
    columns = np.column_stack([unit * smooth, 1j * unit * smooth, (h / np.abs(h))[:, None] * calibration, delay])
    return np.concatenate([columns.real, columns.imag])


def smooth_functions(frequency: np.ndarray) -> np.ndarray:
    """Functions of frequency whose random sum has variance 1 and is smooth over ``RECEPTANCE.smoothing_octaves``.

    Parameters
    ----------
    frequency : (n,) array of float
        [Hz]

    Returns
    -------
    (n, m) array of float
    """
    octave = np.log2(frequency)
    kernel = np.exp(-0.5 * ((octave[:, None] - octave) / RECEPTANCE.smoothing_octaves) ** 2)
    power, vectors = np.linalg.eigh(kernel)
    keep = power > 1e-3
    return np.asarray(vectors[:, keep] * np.sqrt(power[keep]))


def local_rms(frequency: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Root mean square over a third of an octave about each line.

    Parameters
    ----------
    frequency : (n,) array of float
        [Hz]
    size : (n,) array of float
        Magnitudes.

    Returns
    -------
    (n,) array of float
        In the unit of ``size``.
    """
    near = np.abs(np.log2(frequency[:, None] / frequency)) < RECEPTANCE.magnitude_octaves
    return np.asarray(np.sqrt(near @ size**2 / near.sum(axis=1)))


def track_terms(terms: Sequence[PhysicsTerm], conditions: Mapping[str, Any]) -> tuple[PhysicsTerm, ...]:
    """Those of ``terms`` that act in receptances of the track, as they are under ``conditions``.

    Parameters
    ----------
    terms : sequence of PhysicsTerm
        The effects.
    conditions : mapping
        Conditions of a recording.

    Returns
    -------
    tuple of PhysicsTerm
    """
    return tuple(t.under_conditions(conditions) for t in terms if t.effect_type in ("matrix", "port"))


def channel_factor(
    terms: Sequence[PhysicsTerm], sensor: Sensor, frequency: np.ndarray, recording_type: str
) -> np.ndarray:
    """Complex factor by which linear channel terms change a spectrum.

    Parameters
    ----------
    terms : sequence of PhysicsTerm
        The effects.
    sensor : Sensor
        The sensor.
    frequency : (n,) array
        Lines, complex for decaying signals. [Hz]
    recording_type : str
        "hammer" or "passage".

    Returns
    -------
    (n,) array of complex
    """
    factor = np.ones(frequency.size, dtype=complex)
    for term in terms:
        if isinstance(term, TransferTerm) and term.channel_name == sensor.name:
            factor = factor * (term.transfer(frequency) if recording_type in term.recording_types else 1.0)
    return factor


def split_complex(value: np.ndarray) -> np.ndarray:
    """Re and Im one after the other, along the first axis.

    Parameters
    ----------
    value : (n, ...) array of complex
        Any values.

    Returns
    -------
    (2n, ...) array of float
    """
    return np.concatenate([value.real, value.imag])


def scale_lines(pair: FrfPair, h: np.ndarray, channel_response: np.ndarray | None = None) -> np.ndarray:
    """A receptance on ``LINES`` at the lines of a pair, over its measured magnitude; complex (n,) or (n, k).

    ``channel_response`` (n_line,) multiplies it.

    Parameters
    ----------
    pair : FrfPair
        Response channel of a hammer test.
    h : (n_line,) or (n_line, k) array of complex
        Values on ``LINES``. [m/N]
    channel_response : (n_line,) array of complex or None
        Factor of the channel.

    Returns
    -------
    (n,) or (n, k) array of complex
        On the lines of the pair.
    """
    size = 1.0 / pair.size if channel_response is None else channel_response[pair.lines] / pair.size
    return h[pair.lines] * (size if h.ndim == 1 else size[:, None])
