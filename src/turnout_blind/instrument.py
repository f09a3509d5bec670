"""The measurement chain: mounting, coupling, anti-alias filter, decimation, drift, noise, range and 16 bits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import signal

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike

BITS = 16
Fault = Callable[[np.ndarray, float], np.ndarray]  # signal and rate [Hz] -> what a faulty channel records


@dataclass(frozen=True)
class MeasurementChain:
    """One channel. ``gain`` is relative; ``mount`` [Hz] is the mounting resonance and ``quality`` its quality factor.

    ``coupling`` [Hz] is the corner of the amplifier. ``noise`` (rms), ``drift`` (random walk after one second) and
    ``full_scale`` are in the unit of the quantity.
    """

    name: str
    full_scale: float
    gain: float = 1.0
    mount: float = 3500.0
    quality: float = 18.0
    coupling: float = 0.5
    noise: float = 0.03
    drift: float = 0.01

    @property
    def step(self) -> float:
        """Resolution of the converter."""
        return 2.0 * self.full_scale / 2**BITS


def mounting_response(samples: np.ndarray, rate: float, frequency: float, quality: float) -> np.ndarray:
    """Output of a seismic sensor with that resonance: a second-order low-pass with gain 1 at low frequency.

    Parameters
    ----------
    samples : (n,) array of float
        True signal.
    rate : float
        Sampling rate. [Hz]
    frequency : float
        Resonance. [Hz]
    quality : float
        Quality factor.

    Returns
    -------
    (n,) array of float
        Output of the sensor.
    """
    omega = 2.0 * np.pi * frequency
    b, a = signal.bilinear([omega**2], [1.0, omega / quality, omega**2], rate)
    return signal.lfilter(b, a, samples)


def amplify(chain: MeasurementChain, samples: ArrayLike, rate: float, faults: Iterable[Fault] = ()) -> np.ndarray:
    """Output of the amplifier.

    The mounting comes before the faults, so that a saturated channel never exceeds its limit.

    Parameters
    ----------
    chain : MeasurementChain
        The channel.
    samples : (n,) array of float
        True signal.
    rate : float
        Sampling rate. [Hz]
    faults : iterable of callable
        Functions (signal, rate) -> signal.

    Returns
    -------
    (n,) array of float
        Signal.
    """
    x = np.asarray(samples, dtype=float)
    if chain.mount:
        x = mounting_response(x, rate, chain.mount, chain.quality)
    for fault in faults:
        x = fault(x, rate)
    return x


def digitise(
    chain: MeasurementChain,
    samples: ArrayLike,
    rate: float,
    decimation: int,
    rng: np.random.Generator,
    faults: Iterable[Fault] = (),
) -> np.ndarray:
    """Values that a channel records of a true signal.

    Parameters
    ----------
    chain : MeasurementChain
        The channel.
    samples : (n,) array of float
        True signal.
    rate : float
        Sampling rate. [Hz]
    decimation : int
        Samples of the signal per recorded value.
    rng : Generator
        Source of the random numbers.
    faults : iterable of callable
        Functions (signal, rate) -> signal.

    Returns
    -------
    (n // decimation,) array of float
        Recorded values.
    """
    x = amplify(chain, samples, rate, faults)
    if chain.coupling:
        x = signal.sosfilt(signal.butter(1, chain.coupling, "high", fs=rate, output="sos"), x)
    x = signal.sosfilt(signal.butter(6, 0.4 * rate / decimation, fs=rate, output="sos"), x)[::decimation]
    drift = np.cumsum(rng.normal(size=x.size)) * chain.drift / np.sqrt(rate / decimation)
    x = chain.gain * x + drift + chain.noise * rng.normal(size=x.size)
    return chain.step * np.clip(np.round(x / chain.step), -(2 ** (BITS - 1)), 2 ** (BITS - 1) - 1)
