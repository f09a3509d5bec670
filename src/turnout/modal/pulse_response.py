"""Force of a soft-tipped hammer, and the response of modes to it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def haversine_pulse(time: np.ndarray, duration: np.ndarray | float) -> np.ndarray:
    r"""Force of a soft-tipped hammer over its peak, :math:`\sin^2(\pi t / T)` for 0 <= t <= T, else 0.

    Parameters
    ----------
    time : (...) array of float
        Time from the start of contact. [s]
    duration : float or (...) array
        Length T of the contact, broadcast against ``time``. [s]

    Returns
    -------
    (...) array
        Force relative to its peak, 0 to 1.

    Examples
    --------
    >>> haversine_pulse(np.array([-1.0, 0.5, 2.0]), 1.0)
    array([0., 1., 0.])
    """
    inside = (time >= 0.0) & (time <= duration)
    return np.where(inside, np.sin(np.pi * time / duration) ** 2, 0.0)


def pulse_response(time: ArrayLike, pole: ArrayLike, residue: ArrayLike, duration: ArrayLike) -> np.ndarray:
    r"""Response of a sum of modes to a haversine force of unit peak.

    .. math:: y(t) = \int_0^{\min(t, T)} \sin^2(\pi\tau/T) \, \mathrm{Re}\sum_m R_m e^{s_m (t - \tau)} d\tau

    Parameters
    ----------
    time : (..., n) array of float
        From the start of contact; 0 before it. [s]
    pole : (..., n_mode) array of complex
        Continuous poles, upper half plane. [1/s]
    residue : (..., n_mode) array of complex
        Of the impulse response :math:`\mathrm{Re} \sum R e^{st}`. [unit of y per N s]
    duration : (...) array of float
        Length of contact T. [s]

    Returns
    -------
    (..., n) array of float
        In the unit of the residues times a second, per newton of peak force.

    Examples
    --------
    A slow mode responds to the impulse T/2 of the pulse only.

    >>> y = pulse_response(np.array([1e-3]), np.array([-1.0 + 1.0j]), np.array([1.0 + 0j]), 1e-3)
    >>> print(f"{y[0] / 0.5e-3:.3f}")
    1.000
    """
    time, pole, residue = np.asarray(time, float), np.asarray(pole), np.asarray(residue)
    duration = np.asarray(duration, float)[..., None]
    upper_limit = np.clip(time, 0.0, duration)[..., None, :]
    turn = 2j * np.pi / duration[..., None]
    s = pole[..., None]
    total = 0.0
    for weight, a in ((0.5, 0.0), (-0.25, turn), (-0.25, -turn)):
        total = total + weight * np.expm1((a - s) * upper_limit) / (a - s)
    wave = residue[..., None] * np.exp(s * np.clip(time, 0.0, None)[..., None, :]) * total
    return np.where(time > 0.0, wave.sum(axis=-2).real, 0.0)
