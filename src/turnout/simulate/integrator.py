"""Implicit Runge-Kutta schemes, diagonalised so that a step costs one banded solve."""

from dataclasses import dataclass

import numpy as np

from turnout.errors import SimulationError

TABLEAUX = {
    "midpoint": ([[0.5]], [1.0], [0.5]),
    "radau": ([[5 / 12, -1 / 12], [3 / 4, 1 / 4]], [3 / 4, 1 / 4], [1 / 3, 1.0]),
    "gauss": (
        [[1 / 4, 1 / 4 - np.sqrt(3) / 6], [1 / 4 + np.sqrt(3) / 6, 1 / 4]],
        [0.5, 0.5],
        [0.5 - np.sqrt(3) / 6, 0.5 + np.sqrt(3) / 6],
    ),
}


@dataclass(frozen=True)
class Scheme:
    r"""A scheme as the time march uses it: stage increments :math:`Z_a = \mathrm{scale}\,\mathrm{Re}(t_a D)`.

    ``rate`` is an eigenvalue λ of the inverse tableau, ``t`` its eigenvector and ``tau`` its left eigenvector,
    ``weight`` is the sum of ``tau``. The step ends at u + scale Re(δ D), v → R v + scale Re(δ s D), s = λ/dt.
    ``node`` are the times of the stages in steps, ``quadrature`` their weights, ``inverse`` the inverse tableau.
    The two-stage schemes are complex (scale 2), the midpoint rule is real (scale 1).
    """

    name: str
    rate: complex
    t: np.ndarray
    tau: np.ndarray
    weight: complex
    delta: complex
    carry: float
    node: np.ndarray
    quadrature: np.ndarray
    inverse: np.ndarray
    scale: float


def _to_real(value: complex) -> float:
    return float(np.real(value))


def scheme(name: str) -> Scheme:
    """Scheme called "radau" (2 stages, order 3, L-stable), "gauss" (2 stages, order 4) or "midpoint".

    Source: Hairer and Wanner 1996, Solving ordinary differential equations II, IV.5 and IV.8.

    Parameters
    ----------
    name : str
        Key of ``TABLEAUX``.

    Returns
    -------
    Scheme
        Its coefficients, diagonalised.

    Raises
    ------
    SimulationError
        For a name that is not in ``TABLEAUX``.

    References
    ----------
    Hairer and Wanner 1996, Solving ordinary differential equations II, IV.5 and IV.8.

    Examples
    --------
    >>> radau = scheme("radau")
    >>> f"{radau.rate:.6f}, w0 = {radau.weight:.6f}, end of step: δ = {abs(radau.delta):.3f}, R = {radau.carry:.0f}"
    '2.000000+1.414214j, w0 = 0.500000+1.414214j, end of step: δ = 1.000, R = 0'
    """
    if name not in TABLEAUX:
        raise SimulationError(f"scheme {name!r} is none of {', '.join(TABLEAUX)}.")
    a, b, c = (np.array(v) for v in TABLEAUX[name])
    inverse = np.linalg.inv(a)
    rates, right_vectors = np.linalg.eig(inverse)
    k = int(np.argmax(rates.imag))
    right_vectors = right_vectors / right_vectors[-1]
    left_vectors = np.linalg.inv(right_vectors)
    t, tau = right_vectors[:, k], left_vectors[k]
    real = len(b) == 1
    cast = np.real if real else np.asarray
    number = _to_real if real else complex
    carry = 0.0 if name == "radau" else float(1.0 - b @ inverse @ np.ones(len(b)))
    return Scheme(
        name,
        number(rates[k]),
        cast(t).copy(),
        cast(tau).copy(),
        number(tau.sum()),
        number(b @ inverse @ t),
        carry,
        c,
        b,
        inverse,
        1.0 if real else 2.0,
    )
