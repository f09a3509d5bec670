"""Simulated impacts with and without faults, digitised by a 12-bit logger, for the receptance benchmarks."""

import numpy as np
from scipy.signal import fftconvolve

from turnout.records import Channel, Recording
from turnout.signal.filters import FAMILIES, force_pulse

RATE = 20_000.0
N_SAMPLE = 4_000
TRIGGER = 100
CHANNELS = (Channel("hammer", "force"), Channel("rail", "acceleration", mounting="rail head at sleeper"))
# Response with the poles of A7 in the paper: 99.4 Hz, 0.291 and 616.5 Hz, 0.0656.
TIME = np.arange(N_SAMPLE) / RATE
RESPONSE = sum(
    w * np.exp(-z * 2 * np.pi * f * TIME) * np.sin(2 * np.pi * f * TIME + 0.4)
    for f, z, w in ((99.4, 0.291, 1.5), (616.5, 0.0656, 6.0))
)


def digitise(x, rng, top_over_range, noise, bits=12):
    """Quantise ``x``; its largest sample is ``top_over_range`` times the range and is clipped if that exceeds 1.

    ``noise`` is the standard deviation of white noise over the largest sample.
    """
    top = np.max(np.abs(x))
    limit = top / top_over_range
    step = limit / 2 ** (bits - 1)
    return np.clip(np.round((x + noise * top * rng.standard_normal(x.size)) / step) * step, -limit, limit - step)


def identity(x):
    """No fault of the electronics: the signal itself."""
    return x


def simulate_impact(rng, family, contact, second=None, distort=identity, noise=(1e-3, 1e-2), filling=None, peak=None):
    """(2, N_SAMPLE) force [N] and acceleration [m/s²] of one impact. ``second``: (share, delay [s]) of a double
    impact."""
    peak = 8_000.0 * rng.normal(1.0, 0.1) if peak is None else peak
    start = (TRIGGER + rng.uniform()) / RATE
    force = peak * force_pulse(family, TIME - start, contact)
    if second is not None:
        share, delay = second
        width = contact * rng.uniform(0.8, 1.6)
        force = force + share * peak * force_pulse(family, TIME - start - delay, width)
    acceleration = 1e-2 * fftconvolve(force, RESPONSE)[:N_SAMPLE]
    filling = rng.uniform(0.15, 0.95) if filling is None else filling
    return np.stack([
        digitise(distort(force), rng, filling, noise[0]),
        digitise(acceleration, rng, rng.uniform(0.15, 0.95), noise[1]),
    ])  # fmt: skip


def test_of(rng, fault, n_impact=10, tips=(1e-4, 3e-3), noise=(1e-3, 1e-2)):
    """Recordings of one test with one tip. ``fault`` (None or a function of rng and contact) shapes the last impact."""
    family = list(FAMILIES)[rng.integers(len(FAMILIES))]
    contact = np.exp(rng.uniform(*np.log(tips)))
    impacts = [simulate_impact(rng, family, contact * rng.normal(1.0, 0.05), noise=noise) for _ in range(n_impact)]
    if fault is not None:
        impacts[-1] = simulate_impact(rng, family, contact, **({"noise": noise} | fault(rng, contact)))
    return [Recording(samples, RATE, CHANNELS, record=k) for k, samples in enumerate(impacts)]


def second_impact(rng, contact):
    """A second impact of 5 to 30 % of the first, 4 to 50 ms later."""
    return {"second": (rng.uniform(0.05, 0.30), rng.uniform(4e-3, 50e-3))}


CONVERTER_RANGE = (
    11_000.0  # limit of the converter [N], above all accepted impacts: a clipped one is the strongest of its test
)


def hard_clip(rng, contact):
    """Clipping by the converter: its range ends at 50 to 90 % of the peak, and one code is repeated."""
    share = rng.uniform(0.5, 0.9)
    return {"peak": CONVERTER_RANGE / share, "filling": 1.0 / share}


def analog_clip(rng, contact):
    """Clipping by the electronics ahead of a noisy converter: clipped samples need not be equal."""
    noise = np.exp(rng.uniform(*np.log((1e-3, 1e-2))))
    return {
        "peak": CONVERTER_RANGE / rng.uniform(0.5, 0.9),
        "distort": lambda f: np.minimum(f, CONVERTER_RANGE),
        "noise": (noise, 1e-2),
    }


def soft_clip(rng, contact):
    """Saturation c tanh(F / c) that reduces the peak by a quarter to a half."""
    drive = rng.uniform(1.0, 2.0)
    c = CONVERTER_RANGE / np.tanh(drive)
    return {"peak": drive * c, "distort": lambda f: c * np.tanh(f / c)}
