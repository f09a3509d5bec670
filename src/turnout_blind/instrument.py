"""The instrument chain: mounting, coupling, anti-alias filter, decimation, drift, noise, range and 16 bits."""

from dataclasses import dataclass

import numpy as np
from scipy import signal

BITS = 16


@dataclass(frozen=True)
class Chain:
    """One channel. ``gain`` relative, ``mount`` [Hz] and its ``quality``, ``coupling`` corner [Hz] of the amplifier,
    ``noise`` rms and ``drift`` (random walk after one second) in the unit of the quantity, ``full_scale`` too."""

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
        """One step of the converter."""
        return 2.0 * self.full_scale / 2**BITS


def mounting(samples, rate, frequency, quality):
    """What a seismic sensor of that resonance shows: second-order low-pass with gain 1 at low frequency."""
    omega = 2.0 * np.pi * frequency
    b, a = signal.bilinear([omega**2], [1.0, omega / quality, omega**2], rate)
    return signal.lfilter(b, a, samples)


def amplified(chain, samples, rate, faults=()):
    """What the amplifier gives of the true ``samples`` at ``rate`` [Hz]: the mounting rings before it, so that what
    saturates shows no more than its limit. ``faults`` are functions (signal, rate) -> signal."""
    x = np.asarray(samples, dtype=float)
    if chain.mount:
        x = mounting(x, rate, chain.mount, chain.quality)
    for fault in faults:
        x = fault(x, rate)
    return x


def digitised(chain, samples, rate, down, rng, faults=()):
    """(n // down,) numbers that the logger keeps of the true ``samples`` at ``rate`` [Hz], through ``faults``."""
    x = amplified(chain, samples, rate, faults)
    if chain.coupling:
        x = signal.sosfilt(signal.butter(1, chain.coupling, "high", fs=rate, output="sos"), x)
    x = signal.sosfilt(signal.butter(6, 0.4 * rate / down, fs=rate, output="sos"), x)[::down]
    walk = np.cumsum(rng.normal(size=x.size)) * chain.drift / np.sqrt(rate / down)
    x = chain.gain * x + walk + chain.noise * rng.normal(size=x.size)
    return chain.step * np.clip(np.round(x / chain.step), -(2 ** (BITS - 1)), 2 ** (BITS - 1) - 1)
