"""Compute the dynamic stiffness of a section at one frequency: force over displacement."""

import numpy as np
import scipy


def dynamic_stiffness(
    frequency: np.ndarray, h1: np.ndarray, coherence: np.ndarray, passed: np.ndarray, n: int, at: float
) -> tuple[float, float, float] | None:
    r"""Dynamic stiffness :math:`|K| = |F/x|` at one frequency with its 95 % limits.

    .. math:: K = (1 - t) K_0 + t K_1, \qquad K_i = 1 / H_i, \qquad
        |\hat H_i - H_i| \le |\hat H_i| \sqrt{\frac{F_{2,\,2n-2}}{n-1} \frac{1-\gamma_i^2}{\gamma_i^2}}

    with the two neighbouring lines i and the distance t from the lower one in line spacings. Near a resonance K is a
    parabola of the frequency, so its chord is off by :math:`\Delta f^2 / (8 \zeta f^2)` of K at most, and at right
    angles to K. At the nearest line |K| itself is off by :math:`\Delta f^2 / (8 \zeta^2 f^2)`.

    Parameters
    ----------
    frequency, h1, coherence, passed : (n_frequency,) arrays
        Lines [Hz] and the average over ``n`` impacts there: complex receptance [m/N], magnitude-squared coherence [-],
        and whether the line passes the coherence gate.
    n : int
        Number of impacts; fewer than two give None.
    at : float
        Frequency. [Hz]

    Returns
    -------
    (value, low, high) or None
        [N/m]; None where the nearest line does not pass the gate or ``at`` lies outside the lines. ``high`` may be
        infinite.

    References
    ----------
    Jenkins and Watts 1968, Spectral Analysis and its Applications, chapter 10: the region of confidence of a
    frequency response from one input, noise on the response.

    Examples
    --------
    A spring of 50 MN/m, from ten impacts with a coherence of 0.99:

    >>> seen = np.array([100.0]), np.array([2e-8 + 0j]), np.array([0.99]), np.array([True])
    >>> print([f"{v / 1e6:.1f}" for v in dynamic_stiffness(*seen, 10, 100.0)])
    ['50.0', '47.0', '53.4']
    """
    frequency = np.asarray(frequency, dtype=float)
    if n < 2 or not frequency.size or not frequency[0] <= at <= frequency[-1]:
        return None
    if not passed[int(np.argmin(np.abs(frequency - at)))]:
        return None
    above = int(np.searchsorted(frequency, at))
    below = above if frequency[above] == at else above - 1
    share = (at - frequency[below]) / (frequency[above] - frequency[below]) if above > below else 0.0
    lines, weight = np.array([below, above]), np.array([1.0 - share, share])
    gamma_squared = np.asarray(coherence, dtype=float)[lines]
    with np.errstate(divide="ignore", invalid="ignore"):
        stiffness = 1.0 / np.asarray(h1)[lines]
        incoherence = np.maximum(0.0, 1.0 - gamma_squared) / gamma_squared
    radius = np.sqrt(scipy.stats.f.ppf(0.95, 2, 2 * n - 2) / (n - 1) * incoherence)
    value = float(np.abs(weight @ stiffness))
    relative = float(weight @ (np.abs(stiffness) * radius)) / value if value > 0.0 else float("nan")
    if not np.isfinite([value, relative]).all():
        return None
    return value, value / (1.0 + relative), value / (1.0 - relative) if relative < 1.0 else float("inf")
