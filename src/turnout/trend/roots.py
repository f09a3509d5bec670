"""Root of a function of one variable. SciPy's own needs 20 MB and 0.2 s to be imported, in every job of the trends."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

MAX_EVALUATIONS = 200
RELATIVE_TOLERANCE = 2.0**-50  # four units in the last place


def find_root(function: Callable[[float], float], low: float, high: float, tolerance: float) -> float:
    """Root of a continuous function between two points where its signs differ.

    Brent's method as ``scipy.optimize.brentq`` has it: inverse quadratic interpolation, or a bisection where that is no
    better.

    Parameters
    ----------
    function : callable
        Of one number.
    low, high : float
        Both ends; one of them is returned if the function is 0 there.
    tolerance : float
        The root is known to so much, in the unit of ``low``.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If the signs at both ends are the same.
    ArithmeticError
        If the root is not known to the tolerance after ``MAX_EVALUATIONS`` evaluations.

    References
    ----------
    Brent 1973, Algorithms for Minimization without Derivatives, chapter 4.

    Examples
    --------
    >>> print(f"{find_root(lambda x: x**2 - 2.0, 0.0, 2.0, 1e-12):.9f}")
    1.414213562
    """
    previous, current = low, high
    f_previous, f_current = function(low), function(high)
    if f_previous == 0.0 or f_current == 0.0:
        return low if f_previous == 0.0 else high
    if (f_previous > 0.0) == (f_current > 0.0):
        raise ValueError(f"the function has the same sign at {low:g} and at {high:g}")
    opposite, f_opposite, last_step, step = previous, f_previous, 0.0, 0.0
    for _ in range(MAX_EVALUATIONS):
        if f_previous != 0.0 and f_current != 0.0 and (f_previous > 0.0) != (f_current > 0.0):
            opposite, f_opposite = previous, f_previous
            last_step = step = current - previous
        if abs(f_opposite) < abs(f_current):
            previous, current, opposite = current, opposite, current
            f_previous, f_current, f_opposite = f_current, f_opposite, f_current
        delta = 0.5 * (tolerance + RELATIVE_TOLERANCE * abs(current))
        bisection = 0.5 * (opposite - current)
        if f_current == 0.0 or abs(bisection) < delta:
            return current
        trial = bisection
        if abs(last_step) > delta and abs(f_current) < abs(f_previous):
            trial = _interpolated_step((previous, f_previous), (current, f_current), (opposite, f_opposite))
        if 2.0 * abs(trial) < min(abs(last_step), 3.0 * abs(bisection) - delta):
            last_step, step = step, trial
        else:
            last_step = step = bisection
        previous, f_previous = current, f_current
        current += step if abs(step) > delta else delta if bisection > 0.0 else -delta
        f_current = function(current)
    raise ArithmeticError(f"no root after {MAX_EVALUATIONS} evaluations, the last at {current:g}")


def _interpolated_step(
    previous: tuple[float, float], current: tuple[float, float], opposite: tuple[float, float]
) -> float:
    """Step from the current point to the root of the secant, or of the parabola through three points."""
    (x0, f0), (x1, f1), (x2, f2) = previous, current, opposite
    if x0 == x2:
        return -f1 * (x1 - x0) / (f1 - f0)
    slope0, slope2 = (f0 - f1) / (x0 - x1), (f2 - f1) / (x2 - x1)
    return -f1 * (f2 * slope2 - f0 * slope0) / (slope2 * slope0 * (f2 - f0))
