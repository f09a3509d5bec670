"""Random roughness as a sum of waves: of a rail along its length, and of a wheel round its tread."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike

MIN_WAVELENGTH, MAX_WAVELENGTH = 0.02, 3.0  # wavelengths [m]
N_TREAD_POINTS = 8192  # points round a wheel, a third of a millimetre apart
CONTACT_HALF_LENGTH = 0.006  # half length of the contact patch [m], which filters short waves
LEVEL_SLOPE = 18.0  # level per decade of wavelength [dB], as in measured spectra of ground rail in service


def level(wavelength: float, at_10_cm: float) -> float:
    """Third-octave level at a wavelength.

    Parameters
    ----------
    wavelength : float
        Wavelength. [m]
    at_10_cm : float
        Level at 10 cm. [dB re 1 µm]

    Returns
    -------
    float
        Level. [dB re 1 µm]

    Examples
    --------
    >>> level(0.1, 2.0), level(1.0, 2.0)
    (2.0, 20.0)
    """
    return float(at_10_cm + LEVEL_SLOPE * np.log10(wavelength / 0.1))


def patch_share(wavelength: ArrayLike) -> np.ndarray:
    """Share of the variance that moves a wheel: exp(-(2 pi a / wavelength)^2), approximating Remington's filter.

    Parameters
    ----------
    wavelength : float or (...) array of float
        Wavelength. [m]

    Returns
    -------
    (...) array of float
        Share, 0 to 1.
    """
    return np.exp(-((2.0 * np.pi * CONTACT_HALF_LENGTH / np.asarray(wavelength)) ** 2))


def rail_roughness(rng: np.random.Generator, at_10_cm: float, waves: int = 420) -> Callable[[np.ndarray], np.ndarray]:
    """Roughness of a rail: cosines of random phase.

    Wavelengths are uniform in the logarithm. The cosines of each third octave share the variance of its level.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    at_10_cm : float
        Level at 10 cm. [dB re 1 µm]
    waves : int
        Number of cosines.

    Returns
    -------
    callable
        Positions [m] -> dips [m].
    """
    edges = np.geomspace(MIN_WAVELENGTH, MAX_WAVELENGTH, waves + 1)
    length = np.exp(rng.uniform(np.log(edges[:-1]), np.log(edges[1:])))
    share = np.log2(edges[1:] / edges[:-1]) * 3.0
    variance = 1e-12 * 10.0 ** ((at_10_cm + LEVEL_SLOPE * np.log10(length / 0.1)) / 10.0) * share * patch_share(length)
    phase = rng.uniform(0.0, 2.0 * np.pi, waves)
    amplitude, wavenumber = np.sqrt(2.0 * variance), 2.0 * np.pi / length

    cache = {}

    def dips(x: np.ndarray) -> np.ndarray:
        key = (x[0], x[-1], x.size)
        if key not in cache:
            cache[key] = np.sum(amplitude[:, None] * np.cos(np.outer(wavenumber, x) + phase[:, None]), axis=0)
        return cache[key]

    return dips


def wheel_roughness(
    rng: np.random.Generator, at_10_cm: float, radius: float, orders: int = 130
) -> Callable[[np.ndarray, float], np.ndarray]:
    """Roughness of a wheel: harmonics of the circumference.

    The first three are as in turned wheels (10 to 30 µm), the others follow the roughness level.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    at_10_cm : float
        Level at 10 cm. [dB re 1 µm]
    radius : float
        Radius of the wheel. [m]
    orders : int
        Number of harmonics.

    Returns
    -------
    callable
        Positions [m] and phase [rad] -> dips [m].
    """
    order = np.arange(1, orders + 1)
    length = 2.0 * np.pi * radius / order
    width = np.log2((order + 0.5) / (order - 0.5)) * 3.0
    variance = 1e-12 * 10.0 ** ((at_10_cm + LEVEL_SLOPE * np.log10(length / 0.1)) / 10.0) * width * patch_share(length)
    amplitude = np.sqrt(2.0 * variance) * rng.rayleigh(0.8, orders)
    amplitude[:3] = rng.uniform(1e-5, 3e-5, 3)
    phases = rng.uniform(0.0, 2.0 * np.pi, orders)

    angle = np.linspace(0.0, 2.0 * np.pi, N_TREAD_POINTS + 1)
    spectrum = np.zeros(N_TREAD_POINTS // 2 + 1, dtype=complex)
    spectrum[order] = 0.5 * N_TREAD_POINTS * amplitude * np.exp(1j * phases)
    tread = np.fft.irfft(spectrum, N_TREAD_POINTS)
    tread = np.append(tread, tread[0])

    def dips(x: np.ndarray, phase: float) -> np.ndarray:
        return np.interp(np.mod(np.asarray(x) / radius + phase, 2.0 * np.pi), angle, tread)

    return dips
