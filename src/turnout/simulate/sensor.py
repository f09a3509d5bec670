"""Simulate the measuring system: mounting, gain, anti-alias filter, offset, noise, clipping, converter."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import next_fast_len

from turnout.errors import SimulationError
from turnout.records import Channel
from turnout.simulate.number_checks import check_number
from turnout.simulate.run import Probe

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.simulate.effect import Effect
    from turnout.simulate.track import Track

DERIVATIVE_ORDERS = {"acceleration": 2, "velocity": 1, "displacement": 0}
ALIAS_TAPS = 63


@dataclass(frozen=True)
class Sensor:
    """One channel of the measuring system. SI units; None switches a stage off.

    ``place`` [m]; ``mounting`` as in ``Channel``: one that begins with "sleeper" is on the nearest sleeper,
    all others are on the rail (the vertical model does not distinguish head and web). ``mount_frequency`` [Hz] and
    ``mount_quality`` of the mounting's resonance, ``gain`` relative, ``cutoff`` of the anti-alias filter as a
    share of the rate, ``noise`` rms, ``limit`` where it clips and ``resolution`` of the converter in the
    unit of the quantity, ``delay`` [s].
    """

    name: str
    place: float
    mounting: str = "rail head"
    quantity: str = "acceleration"
    mount_frequency: float | None = None
    mount_quality: float = 10.0
    gain: float = 1.0
    cutoff: float | None = 0.4
    offset: float = 0.0
    noise: float = 0.0
    limit: float | None = None
    resolution: float | None = None
    delay: float = 0.0
    serial: str = ""

    def __post_init__(self) -> None:
        title = f"sensor {self.name!r}:"
        for name in ("place", "gain", "offset", "delay"):
            check_number(f"{title} {name}", getattr(self, name))
        check_number(f"{title} noise", self.noise, least=0.0)
        check_number(f"{title} mount_quality", self.mount_quality, above=0.0)
        for name in ("mount_frequency", "cutoff", "resolution"):
            if (value := getattr(self, name)) is not None:
                check_number(f"{title} {name}", value, least=0.0)
        if self.limit is not None and not (isinstance(self.limit, Real) and self.limit > 0.0):
            raise SimulationError(f"{title} limit must be above 0, or None, got {self.limit!r}.")

    def channel(self) -> Channel:
        """The channel of a recording."""
        return Channel(self.name, self.quantity, self.place, self.mounting, self.serial, self.limit, self.resolution)

    def probe(self, track: Track) -> Probe:
        """Signal that the simulation must record.

        Parameters
        ----------
        track : Track
            The track; a sensor on a sleeper is on its nearest support.

        Returns
        -------
        Probe
            Point and derivative of the signal.

        Raises
        ------
        SimulationError
            For a quantity that the track does not have, and for a position outside the track.
        """
        if self.quantity not in DERIVATIVE_ORDERS:
            raise SimulationError(f"sensor {self.name!r}: cannot record {self.quantity!r} on the track.")
        if not track.start <= self.place <= track.end:
            raise SimulationError(
                f"sensor {self.name!r} at {self.place:.3f} m is outside the track, "
                f"which goes from {track.start:.3f} m to {track.end:.3f} m."
            )
        if self.mounting.startswith("sleeper"):
            return Probe(("sleeper", track.nearest_support(self.place)), DERIVATIVE_ORDERS[self.quantity])
        return Probe(self.place, DERIVATIVE_ORDERS[self.quantity])


def actual_sensor(sensor: Sensor, terms: Sequence[Effect]) -> Sensor:
    """The sensor at its true position according to ``terms``.

    Parameters
    ----------
    sensor : Sensor
        The sensor as described.
    terms : sequence of Effect
        Effects, of which some move sensors.

    Returns
    -------
    Sensor
        The same sensor where no term moves it.
    """
    for term in terms:
        sensor = term.sensor(sensor)
    return sensor


def check_names(sensors: Sequence[Sensor]) -> None:
    """Reject sensors of one recording with the same name: its channels are known by their names.

    Parameters
    ----------
    sensors : sequence of Sensor
        Channels of the recording.

    Raises
    ------
    SimulationError
        With the name that occurs more than once.
    """
    names = [sensor.name for sensor in sensors]
    for name in names:
        if names.count(name) > 1:
            raise SimulationError(f"{names.count(name)} sensors have the name {name!r}.")


def mean_of(signals: np.ndarray, substeps: int) -> np.ndarray:
    """Means over ``substeps`` time steps of signals; a remainder is dropped.

    Parameters
    ----------
    signals : (..., n_step) array of float
        Signals in time steps.
    substeps : int
        Time steps per sample.

    Returns
    -------
    (..., n_sample) array of float
        Means.
    """
    n = signals.shape[-1] // substeps
    return signals[..., : n * substeps].reshape(*signals.shape[:-1], n, substeps).mean(axis=-1)


def record_signal(
    sensor: Sensor,
    signal: np.ndarray,
    rate: float,
    rng: np.random.Generator,
    terms: Sequence[Effect] = (),
    substeps: int = 1,
) -> np.ndarray:
    """Samples that a ``sensor`` records of the true ``signal``.

    The signal is filtered before it is sampled, to prevent aliasing.
    Mounting: :math:`1 / (1 - (f/f_0)^2 + i f / (Q f_0))`. The anti-alias filter has linear phase and its delay
    is removed, as in a sigma-delta converter. Terms of type "channel" act before the gain.

    Parameters
    ----------
    sensor : Sensor
        The channel.
    signal : (n * substeps,) array of float
        True signal in time steps.
    rate : float
        Sampling rate. [Hz]
    rng : Generator
        Source of the noise; not used by a sensor without noise.
    terms : sequence of Effect
        Effects of type "channel".
    substeps : int
        Time steps per sample.

    Returns
    -------
    (n,) array of float
        Samples in the unit of the quantity.
    """
    for term in terms:
        signal = term.channel(signal, rate * substeps, sensor)
    signal = mean_of(_apply_filters(sensor, np.asarray(signal, dtype=float), rate, substeps), substeps)
    signal = sensor.gain * signal + sensor.offset
    if sensor.noise:
        signal = signal + sensor.noise * rng.normal(size=signal.size)
    if sensor.limit is not None:
        signal = np.clip(signal, -sensor.limit, sensor.limit)
    if sensor.resolution:
        signal = sensor.resolution * np.round(signal / sensor.resolution)
    return signal


def _apply_filters(sensor: Sensor, signal: np.ndarray, rate: float, substeps: int) -> np.ndarray:
    """Mounting, delay and anti-alias filter in one transform, padded so that the signal does not wrap around.

    The straight line between the ends of the signal passes unchanged but for the delay; the remainder begins and ends
    at 0. The track moves before the first sample and after the last one, so a filter must not see steps there.
    """
    if not (sensor.mount_frequency or sensor.delay or sensor.cutoff):
        return signal
    sample = np.arange(signal.size) / max(signal.size - 1, 1)
    rise = signal[-1] - signal[0]
    line = signal[0] + rise * sample
    late_line = signal[0] + rise * (sample - sensor.delay * rate * substeps / max(signal.size - 1, 1))
    signal = signal - line
    padded = next_fast_len(signal.size + max(4096, signal.size // 8), real=True)
    frequency = np.fft.rfftfreq(padded, 1.0 / (rate * substeps))
    transfer = np.ones(frequency.size, dtype=complex)
    if sensor.mount_frequency:
        ratio = frequency / sensor.mount_frequency
        transfer /= 1.0 - ratio**2 + 1j * ratio / sensor.mount_quality
    if sensor.delay:
        transfer *= np.exp(-2j * np.pi * frequency * sensor.delay)
    if sensor.cutoff:
        transfer *= _anti_alias(sensor.cutoff, frequency / rate, substeps)
    return late_line + np.fft.irfft(np.fft.rfft(signal, padded) * transfer, padded)[: signal.size]


def _anti_alias(cutoff: float, frequency: np.ndarray, substeps: int) -> np.ndarray:
    """Amplitude of a windowed-sinc low-pass (Hamming) centred on its own delay; both in shares of the rate."""
    reach = ALIAS_TAPS // 2 * substeps
    k = np.arange(-reach, reach + 1) / substeps
    taps = np.sinc(2.0 * cutoff * k) * np.hamming(k.size)
    taps /= taps.sum()
    cosine = np.full(frequency.size, taps[reach])
    for m, tap in zip(k[reach + 1 :], taps[reach + 1 :]):
        cosine += 2.0 * tap * np.cos(2.0 * np.pi * frequency * m)
    return cosine
