"""Compute the dynamic stiffness of a section at one frequency: force over displacement."""

import numpy as np
import scipy


def dynamic_stiffness(
    frequency: np.ndarray, h1: np.ndarray, coherence: np.ndarray, passed: np.ndarray, n: int, at: float
) -> tuple[float, float, float] | None:
    r"""Dynamic stiffness :math:`|F/x| = 1/|H_1|` with its 95 % limits.

    .. math:: |\hat H - H| \le |\hat H| \sqrt{\frac{F_{2,\,2n-2}}{n-1} \frac{1-\gamma^2}{\gamma^2}}

    Parameters
    ----------
    frequency, h1, coherence, passed : (n_frequency,) arrays
        Lines [Hz] and the average over ``n`` impacts there: complex receptance [m/N], magnitude-squared coherence [-],
        and whether the line passes the coherence gate.
    n : int
        Number of impacts; fewer than two give None.
    at : float
        Frequency; the line next to it is taken. [Hz]

    Returns
    -------
    (value, low, high) or None
        [N/m]; None where the line does not pass the gate or ``at`` lies outside the lines. ``high`` may be infinite.

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
    k = int(np.argmin(np.abs(frequency - at)))
    magnitude, gamma_squared = float(np.abs(h1[k])), float(coherence[k])
    if not (passed[k] and magnitude > 0.0 and gamma_squared > 0.0):
        return None
    radius = float(
        np.sqrt(scipy.stats.f.ppf(0.95, 2, 2 * n - 2) / (n - 1) * max(0.0, 1.0 - gamma_squared) / gamma_squared)
    )
    return (
        1.0 / magnitude,
        1.0 / (magnitude * (1.0 + radius)),
        1.0 / (magnitude * (1.0 - radius)) if radius < 1.0 else float("inf"),
    )
