"""Provide Butterworth filters as second-order sections, causal or with zero phase, and reduction of the sampling rate.

The module also has the usual shapes of a hammer's contact force.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy


@lru_cache(maxsize=64)
def butterworth_sections(low: float | None, high: float | None, rate: float, order: int = 4) -> np.ndarray:
    """Second-order sections of a Butterworth filter that passes low ... high.

    Parameters
    ----------
    low, high : float or None
        Half-power edges; None leaves that side open. [Hz]
    rate : float
        Sampling rate. [Hz]
    order : int
        Order of each flank.

    Returns
    -------
    (n_section, 6) array of float, read-only

    Raises
    ------
    ValueError
        Edges missing, crossed, or not between 0 and half the rate.

    Examples
    --------
    At its edges the filter halves the power.

    >>> from scipy.signal import freqz_sos
    >>> _, gain = freqz_sos(butterworth_sections(80.0, 800.0, 20000.0), [80.0, 800.0], fs=20000.0)
    >>> print(np.round(abs(gain) ** 2, 6))
    [0.5 0.5]
    """
    edges = [edge for edge in (low, high) if edge is not None]
    if not edges or any(not 0.0 < edge < rate / 2 for edge in edges) or sorted(set(edges)) != edges:
        raise ValueError(f"cannot pass {low} ... {high} Hz at a rate of {rate} Hz")
    band_type = "bandpass" if len(edges) == 2 else ("highpass" if high is None else "lowpass")
    sections = scipy.signal.butter(order, edges if len(edges) == 2 else edges[0], band_type, fs=rate, output="sos")
    sections.flags.writeable = False
    return sections


def band_pass(
    x: np.ndarray, low: float | None, high: float | None, rate: float, order: int = 4, zero_phase: bool = False
) -> np.ndarray:
    """Filter the last axis with ``butterworth_sections``.

    Causal (from rest) by default; a model must pass the same filter. With ``zero_phase`` the filter runs forwards and
    backwards: no delay, twice the attenuation in dB, and energy before every onset.

    Parameters
    ----------
    x : (..., n) array of float
        Samples. [any unit]
    low, high : float or None
        Half-power edges; None leaves that side open. [Hz]
    rate : float
        Sampling rate. [Hz]
    order : int
        Order of each flank.
    zero_phase : bool
        Whether the filter runs in both directions.

    Returns
    -------
    (..., n) array of float
        Filtered samples. [same unit]

    Raises
    ------
    ValueError
        Edges missing, crossed, or not between 0 and half the rate.

    Examples
    --------
    >>> t = np.arange(4000) / 4000.0
    >>> y = band_pass(np.sin(2 * np.pi * 30 * t) + np.sin(2 * np.pi * 300 * t), 150.0, 600.0, 4000.0, zero_phase=True)
    >>> print(f"{np.std(y[500:-500] - np.sin(2 * np.pi * 300 * t)[500:-500]):.3f}")
    0.000
    """
    sections = np.array(butterworth_sections(low, high, float(rate), order))
    apply_sections = scipy.signal.sosfiltfilt if zero_phase else scipy.signal.sosfilt
    return apply_sections(sections, np.asarray(x, dtype=float), axis=-1)


# Skewed pulse x^p e^(p (1-x)): it rises fast and decays slowly; above 2 % of its peak until x = SKEW_END.
SKEW_EXPONENT = 3.0
SKEW_END = 3.5791


def half_sine(x: np.ndarray) -> np.ndarray:
    r""":math:`\sin \pi x`: a mass on a linear spring.

    Parameters
    ----------
    x : (...) array of float
        Time since the first touch over the contact time. [-]

    Returns
    -------
    (...) array of float
        Force over its peak. [-]
    """
    return np.sin(np.pi * x)


def haversine(x: np.ndarray) -> np.ndarray:
    r""":math:`\sin^2 \pi x`: the smooth standard pulse of shock tests.

    Parameters
    ----------
    x : (...) array of float
        Time since the first touch over the contact time. [-]

    Returns
    -------
    (...) array of float
        Force over its peak. [-]
    """
    return np.sin(np.pi * x) ** 2


def hertzian(x: np.ndarray) -> np.ndarray:
    r""":math:`\sin^{3/2} \pi x`, close to the contact of a sphere on a plane.

    Parameters
    ----------
    x : (...) array of float
        Time since the first touch over the contact time. [-]

    Returns
    -------
    (...) array of float
        Force over its peak. [-]

    References
    ----------
    Hunter 1957, Energy absorbed by elastic waves during impact, J. Mech. Phys. Solids 5, 162-171.
    """
    return np.abs(np.sin(np.pi * x)) ** 1.5


def skewed_pulse(x: np.ndarray) -> np.ndarray:
    """:math:`(u e^{1-u})^3` with u = 3.58 x: a soft tip that yields quickly and recovers slowly.

    Parameters
    ----------
    x : (...) array of float
        Time since the first touch over the contact time. [-]

    Returns
    -------
    (...) array of float
        Force over its peak. [-]
    """
    u = SKEW_END * np.asarray(x, dtype=float)
    return (u * np.exp(1.0 - u)) ** SKEW_EXPONENT


FAMILIES = {"half-sine": half_sine, "haversine": haversine, "Hertzian": hertzian, "skewed": skewed_pulse}


def force_pulse(family: str, time: np.ndarray, contact: float) -> np.ndarray:
    """Force over its peak at each time since the first touch.

    Parameters
    ----------
    family : str
        A key of ``FAMILIES``.
    time : (...) array of float
        Since the first touch; 0 before it and after ``contact`` (the skewed pulse decays further). [s]
    contact : float
        Contact time. [s]

    Returns
    -------
    (...) array of float
        Between 0 and 1. [-]

    Examples
    --------
    The impulse of a half-sine is 2/pi, that of a haversine 1/2 of peak times contact:

    >>> t = np.linspace(0.0, 2e-3, 20001)
    >>> [round(float(np.mean(force_pulse(f, t, 2e-3))), 3) for f in ("half-sine", "haversine")]
    [0.637, 0.5]
    """
    time = np.asarray(time, dtype=float)
    in_contact = (time > 0.0) & ((time < contact) | (family == "skewed"))
    return np.where(in_contact, FAMILIES[family](np.where(in_contact, time / contact, 0.0)), 0.0)
