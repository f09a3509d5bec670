"""The measurement chain: mounting, coupling, anti-alias filter, decimation, drift, noise, range and 16 bits."""

from dataclasses import dataclass

import numpy as np
from scipy import signal

BITS = 16


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
    def step(self):
        """Resolution of the converter."""
        return 2.0 * self.full_scale / 2**BITS


def mounting_response(samples, rate, frequency, quality):
    """Output of a seismic sensor with that resonance: a second-order low-pass with gain 1 at low frequency."""
    omega = 2.0 * np.pi * frequency
    b, a = signal.bilinear([omega**2], [1.0, omega / quality, omega**2], rate)
    return signal.lfilter(b, a, samples)


def amplify(chain, samples, rate, faults=()):
    """Output of the amplifier for the true ``samples`` at ``rate`` [Hz].

    The mounting comes before the ``faults``, so that a saturated channel never exceeds its limit. ``faults`` are
    functions (signal, rate) -> signal.
    """
    x = np.asarray(samples, dtype=float)
    if chain.mount:
        x = mounting_response(x, rate, chain.mount, chain.quality)
    for fault in faults:
        x = fault(x, rate)
    return x


def digitise(chain, samples, rate, decimation, rng, faults=()):
    """(n // decimation,) recorded values of the true ``samples`` at ``rate`` [Hz], with ``faults``."""
    x = amplify(chain, samples, rate, faults)
    if chain.coupling:
        x = signal.sosfilt(signal.butter(1, chain.coupling, "high", fs=rate, output="sos"), x)
    x = signal.sosfilt(signal.butter(6, 0.4 * rate / decimation, fs=rate, output="sos"), x)[::decimation]
    drift = np.cumsum(rng.normal(size=x.size)) * chain.drift / np.sqrt(rate / decimation)
    x = chain.gain * x + drift + chain.noise * rng.normal(size=x.size)
    return chain.step * np.clip(np.round(x / chain.step), -(2 ** (BITS - 1)), 2 ** (BITS - 1) - 1)
