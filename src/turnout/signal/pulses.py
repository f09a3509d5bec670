"""Shapes of a hammer's contact force, by the names of the field."""

import numpy as np

# Skewed pulse x^p e^(p (1-x)): it rises fast and ebbs slowly; above 2 % of its peak until x = SKEW_END.
SKEW = 3.0
SKEW_END = 3.5791


def half_sine(x):
    r""":math:`\sin \pi x`: a mass on a linear spring."""
    return np.sin(np.pi * x)


def haversine(x):
    r""":math:`\sin^2 \pi x`: the smooth standard pulse of shock tests."""
    return np.sin(np.pi * x) ** 2


def hertzian(x):
    r""":math:`\sin^{3/2} \pi x`, close to the contact of a sphere on a plane.

    References
    ----------
    Hunter 1957, Energy absorbed by elastic waves during impact, J. Mech. Phys. Solids 5, 162-171.
    """
    return np.abs(np.sin(np.pi * x)) ** 1.5


def skewed(x):
    r""":math:`(u e^{1-u})^3` with u = 3.58 x: a soft tip that gives way quickly and recovers slowly."""
    u = SKEW_END * np.asarray(x, dtype=float)
    return (u * np.exp(1.0 - u)) ** SKEW


FAMILIES = {"half-sine": half_sine, "haversine": haversine, "Hertzian": hertzian, "skewed": skewed}


def force_pulse(family: str, time: np.ndarray, contact: float) -> np.ndarray:
    """Force over its peak at each time since the first touch.

    Parameters
    ----------
    family : str
        A key of ``FAMILIES``.
    time : array of float
        Since the first touch; 0 before it and after ``contact`` (the skewed pulse ebbs on). [s]
    contact : float
        Contact time. [s]

    Returns
    -------
    array of float
        Between 0 and 1. [-]

    Examples
    --------
    The impulse of a half-sine is 2/pi, that of a haversine 1/2 of peak times contact:

    >>> t = np.linspace(0.0, 2e-3, 20001)
    >>> [round(float(np.mean(force_pulse(f, t, 2e-3))), 3) for f in ("half-sine", "haversine")]
    [0.637, 0.5]
    """
    time = np.asarray(time, dtype=float)
    touching = (time > 0.0) & ((time < contact) | (family == "skewed"))
    return np.where(touching, FAMILIES[family](np.where(touching, time / contact, 0.0)), 0.0)
