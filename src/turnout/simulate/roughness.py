"""Generate random roughness of rail and wheel with the spectrum of ISO 3095."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.simulate.wheel_path import Sampled

if TYPE_CHECKING:
    from collections.abc import Sequence

# Limit curve of ISO 3095:2013 in one-third octave bands from 2 m down to 3.15 mm [dB re 1 µm], the class "well
# maintained and very smooth" of Directive (EU) 2015/996; between the bands the level is linear in the logarithm.
SHORTEST_WAVE, LONGEST_WAVE = 0.02, 3.0  # m: the contact patch, about 15 mm, bridges shorter waves
STEP = 0.005  # m between two values of a dip
FADE_LENGTH = 3.0  # m over which roughness fades in and out
WAVELENGTH = 2.0 * 10.0 ** (-0.1 * np.arange(29))
LONG_WAVE_LEVELS = (
    17.1,
    17.1,
    17.1,
    17.1,
    17.1,
    17.1,
    17.1,
    17.1,
    15.0,
    13.0,
    11.0,
    9.0,
    7.0,
    4.9,
    2.9,
    0.9,
    -1.1,
    -3.2,
)
SHORT_WAVE_LEVELS = (-5.0, -5.6, -6.2, -6.8, -7.4, -8.0, -8.6, -9.2, -9.8, -10.4, -11.0)
LIMIT_LEVELS = np.array([*LONG_WAVE_LEVELS, *SHORT_WAVE_LEVELS])


def level(wavelength: float | np.ndarray, offset: float = 0.0) -> np.ndarray:
    """One-third octave roughness level, ``offset`` above the limit curve.

    Constant above 2 m and below 3.15 mm, where the standard has no values.

    Parameters
    ----------
    wavelength : float or (...) array
        Above 0. [m]
    offset : float
        Level above the limit curve. [dB]

    Returns
    -------
    (...) array
        Level. [dB re 1 µm]

    References
    ----------
    ISO 3095:2013, limit curve.

    Examples
    --------
    >>> [round(float(level(w)), 1) for w in (1.0, 0.4, 0.1, 0.01)], round(float(level(0.1, offset=6.0)), 1)
    ([17.1, 17.1, 4.9, -8.0], 10.9)
    """
    return np.interp(np.log(wavelength), np.log(WAVELENGTH[::-1]), LIMIT_LEVELS[::-1]) + offset


def roughness(
    start: float,
    end: float,
    seed: int | Sequence[int],
    offset: float = 0.0,
) -> Sampled:
    """A realisation of roughness between two positions, as a path.

    The variance of a one-third octave band is :math:`10^{L/10}` µm²; it is spread evenly over the band.

    Parameters
    ----------
    start, end : float
        Positions [m]; the roughness fades in and out over ``FADE_LENGTH``.
    seed : int or sequence of int
        Seed of numpy's default generator: the same seed gives the same rail.
    offset : float
        Level above the limit curve. [dB]

    Returns
    -------
    Sampled
        Dip every ``STEP`` [m].

    References
    ----------
    ISO 3095:2013, limit curve of acoustic rail roughness, as carried by the rail tables of the noise model
    NoiseModelling; synthesis by random phases, Wiener-Khinchin.
    """
    rng = np.random.default_rng(seed)
    n = int(np.ceil((end - start) / STEP)) + 1
    frequency = np.fft.rfftfreq(n, STEP)
    inside = (frequency >= 1.0 / LONGEST_WAVE) & (frequency <= 1.0 / SHORTEST_WAVE)
    density = np.zeros(frequency.size)
    width = (2.0 ** (1 / 6) - 2.0 ** (-1 / 6)) * frequency[inside]
    density[inside] = 1e-12 * 10.0 ** (level(1.0 / frequency[inside], offset) / 10.0) / width
    noise = rng.normal(size=frequency.size) + 1j * rng.normal(size=frequency.size)
    spectrum = noise * np.sqrt(density * n / (4.0 * STEP))
    dip = np.fft.irfft(spectrum, n)
    distance = STEP * np.arange(n)
    edge = np.clip(np.minimum(distance, distance[-1] - distance) / FADE_LENGTH, 0.0, 1.0)
    return Sampled(start, STEP, dip * edge * edge * (3.0 - 2.0 * edge))
