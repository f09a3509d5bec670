"""Compute the receptance of a track in the frequency domain, and its gradient by the parameters of the track."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import SimulationError
from turnout.kernel_cache import borrowing_kernel, kernel
from turnout.simulate.band_matrix import factorise, factorise4, upper_rows
from turnout.simulate.band_solution import LANES, solve, solve_lanes
from turnout.simulate.matrices import link_vector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.simulate.links import Link
    from turnout.simulate.matrices import TrackMatrices

GROWTH_LIMIT = 1e6  # largest factor without pivoting: above it six digits are lost, so solve with pivoting


@kernel
def _solve_lines(
    mass: np.ndarray,
    damping: np.ndarray,
    stiffness: np.ndarray,
    hysteresis: np.ndarray,
    omega: np.ndarray,
    right: np.ndarray,
    selected: np.ndarray,
    width: int,
    out: np.ndarray,
) -> float:
    """Rows ``selected`` for all lines and right-hand sides in ``out[line, k]``; returns the largest factor."""
    half, n = mass.shape[0] - 1, mass.shape[1]
    system = np.zeros((width + 1, n + 4), dtype=np.complex128)
    lower = np.zeros((n + 4, width), dtype=np.complex128)
    upper = np.zeros((n, width), dtype=np.complex128)
    pivot, x = np.zeros(n, dtype=np.complex128), np.zeros(n, dtype=np.complex128)
    lanes = np.zeros(2 * (n + 8) * LANES)
    worst = 0.0
    for line in range(omega.size):
        w = omega[line]
        for k in range(half + 1):
            for i in range(n):
                system[k, i] = stiffness[k, i] - w * w * mass[k, i] + 1j * (w * damping[k, i] + hysteresis[k, i])
        if width == 4:
            worst = max(worst, factorise4(system, lower, upper, pivot, n))
            system[:, n:] = 0.0
        else:
            worst = max(worst, factorise(system[: half + 1, :n], lower[:n], pivot))
            upper[:] = upper_rows(lower[:n], n, half, width)
        together = right.shape[0] if width == 4 and right.shape[0] > 2 else 0  # at once, the others one by one
        for first in range(0, together, LANES):
            _solve_rows(lower[:n], upper, pivot, lanes, right[first : first + LANES], selected, out[line, first:])
        for r in range(together, right.shape[0]):
            for i in range(n):
                x[i] = right[r, i]
            solve(lower[:n], upper, pivot, x, 0, n)
            for i in range(selected.size):
                out[line, r, i] = x[selected[i]]
    return worst


@borrowing_kernel
def _solve_rows(
    lower: np.ndarray,
    upper: np.ndarray,
    pivot: np.ndarray,
    lanes: np.ndarray,
    right: np.ndarray,
    selected: np.ndarray,
    out: np.ndarray,
) -> None:
    """Rows ``selected`` for up to ``LANES`` right-hand sides in ``out[k]``; ``lanes`` is a workspace."""
    n = pivot.size
    lanes[:] = 0.0
    for r in range(right.shape[0]):
        for i in range(n):
            lanes[2 * LANES * (i + 4) + r] = right[r, i]
    solve_lanes(lower, upper, pivot, lanes, n)
    for r in range(right.shape[0]):
        for i in range(selected.size):
            k = 2 * LANES * (selected[i] + 4) + r
            out[r, i] = complex(lanes[k], lanes[k + LANES])


def _solve_pivoted(matrices: TrackMatrices, omega: np.ndarray, right: np.ndarray) -> np.ndarray:
    from scipy.linalg import solve_banded

    half, n = matrices.half, matrices.n
    out = np.zeros((omega.size, right.shape[0], n), dtype=complex)
    for line, w in enumerate(omega):
        upper = matrices.stiffness + 1j * (w * matrices.damping + matrices.hysteresis) - w * w * matrices.mass
        band = np.zeros((2 * half + 1, n), dtype=complex)
        for k in range(half + 1):
            band[half - k, k:] = upper[k, : n - k]
            band[half + k, : n - k] = upper[k, : n - k]
        out[line] = solve_banded((half, half), band, right.T.astype(complex)).T
    return out


def responses(
    matrices: TrackMatrices,
    frequency: np.ndarray | Sequence[float] | float,
    points: Sequence[float | tuple],
    rows: np.ndarray | Sequence[int] | None = None,
    pivoted: bool = False,
) -> np.ndarray:
    r"""(n_line, n_point, n) complex displacement of all degrees of freedom, or of ``rows``, under unit forces.

    ``points`` are positions (rail at x [m]) or names of degrees of freedom. ``frequency`` [Hz] may be 0. A complex one,
    :math:`f - i \sigma / 2 \pi`, is that of signals weighted by :math:`e^{-\sigma t}` (Laplace transform).
    It solves without pivoting unless a factor exceeds 1e6 or ``pivoted`` is set.

    Parameters
    ----------
    matrices : TrackMatrices
        Matrices of the track.
    frequency : (n_line,) array of float or complex
        Not negative. [Hz]
    points : sequence of float or tuple
        Points of the unit forces.
    rows : (n_row,) array of int or None
        Degrees of freedom to return; None: all.
    pivoted : bool
        Solve with pivoting.

    Returns
    -------
    (n_line, n_point, n_row) array of complex
        Displacement, down positive. [m/N]

    Raises
    ------
    SimulationError
        For a negative frequency or one that is not a number.
    """
    omega = 2.0 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=complex))
    if not (np.all(np.isfinite(omega)) and np.all(omega.real >= 0.0)):
        raise SimulationError(f"frequencies must not be negative, got {frequency!r}.")
    right = np.zeros((len(points), matrices.n))
    for k, point in enumerate(points):
        np.add.at(right[k], *matrices.weights(point))
    selected = np.arange(matrices.n) if rows is None else np.asarray(rows, dtype=np.int64)
    if not pivoted:
        out = np.zeros((omega.size, len(points), selected.size), dtype=complex)
        width = 4 if matrices.half <= 4 else 6 if matrices.half <= 6 else matrices.half
        arrays = matrices.mass, matrices.damping, matrices.stiffness, matrices.hysteresis
        growth = _solve_lines(*arrays, omega, right, selected, width, out)
        if growth < GROWTH_LIMIT:
            return out
    return _solve_pivoted(matrices, omega, right)[:, :, selected]


def receptance(
    matrices: TrackMatrices, frequency: np.ndarray | Sequence[float], excited: float | tuple, measured: float | tuple
) -> np.ndarray:
    r"""Receptance :math:`H = b_m^T (K + iH_s + i\omega C - \omega^2 M)^{-1} b_e` [m/N], (n_frequency,).

    ``excited`` and ``measured`` are positions on the rail [m] or names of degrees of freedom. If both are in one rail
    element its local compliance is added, so that both may lie between nodes.

    Parameters
    ----------
    matrices : TrackMatrices
        Matrices of the track.
    frequency : (n_frequency,) array of float
        May be 0. [Hz]
    excited : float or tuple
        Point of the force.
    measured : float or tuple
        Point of the displacement.

    Returns
    -------
    (n_frequency,) array of complex
        Receptance. [m/N]

    Raises
    ------
    SimulationError
        For a negative frequency and for a point that the track does not have.

    References
    ----------
    Grassie et al. 1982, The dynamic response of railway track to high frequency vertical excitation.

    Examples
    --------
    Far below its resonance a track on pads alone has the static stiffness of a beam on Winkler's foundation,
    :math:`2\sqrt{2} (EI)^{1/4} (k/L)^{3/4}`, to the one per cent that its supports are discrete:

    >>> from turnout.simulate.matrices import assemble
    >>> from turnout.simulate.rail import Rail
    >>> from turnout.simulate.track import uniform_track
    >>> rail = Rail(6.42e6, 60.21, 2.4e8, beam="euler")
    >>> track = uniform_track(48.0, rail=rail, layers=1, pad_stiffness=50e6)
    >>> h = receptance(assemble(track), [1.0], 24.15, 24.15)
    >>> print(f"{abs(1 / h[0]) / (2 * 2**0.5 * 6.42e6**0.25 * (50e6 / 0.6) ** 0.75):.2f}")
    1.00
    """
    rows, weights = matrices.weights(measured)
    h = responses(matrices, frequency, [excited], rows)[:, 0] @ weights
    return h + _element_compliance(matrices, excited, measured)


def _element_compliance(matrices: TrackMatrices, excited: float | tuple, measured: float | tuple) -> float:
    """Compliance between two positions in one rail element, which the motion of the nodes does not include [m/N]."""
    if isinstance(excited, tuple) or isinstance(measured, tuple):
        return 0.0
    return matrices.compliance(float(excited), float(measured))


def receptance_gradient(
    matrices: TrackMatrices,
    frequency: np.ndarray,
    excited: float | tuple,
    measured: float | tuple,
    parameters: Sequence[tuple[str, Sequence[Link]]],
) -> tuple[np.ndarray, np.ndarray]:
    r"""Receptance and its derivatives by stiffness, damping or mass of links.

    .. math:: \partial H / \partial p = -u_m^T (\partial Z / \partial p) u_e

    Parameters
    ----------
    matrices : TrackMatrices
        Of the track.
    frequency : (n,) array of float
        [Hz]
    excited, measured : float or tuple
        Positions [m] or names of degrees of freedom.
    parameters : list of (quantity, list of Link)
        ``quantity`` is "stiffness", "damping", "mass" or "loss_factor". The derivative is by a common value that is
        added to all links of the list.

    Returns
    -------
    (n,) complex, (n, n_parameter) complex
        Receptance [m/N] and its derivatives [m/N per unit of the parameter].
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
    point_responses = responses(matrices, frequency, [excited, measured])
    rows, weights = matrices.weights(measured)
    h = point_responses[:, 0][:, rows] @ weights + _element_compliance(matrices, excited, measured)
    gradient = np.zeros((omega.size, len(parameters)), dtype=complex)
    for k, (quantity, links) in enumerate(parameters):
        factor: Any = {"stiffness": -1.0 + 0.0 * omega, "damping": -1j * omega, "mass": omega**2}.get(quantity)
        for link in links:
            link_rows, weight = link_vector(link, matrices.index)
            product = (point_responses[:, 0][:, link_rows] @ weight) * (point_responses[:, 1][:, link_rows] @ weight)
            derivative = -1j * link.stiffness if quantity == "loss_factor" else factor
            if quantity == "stiffness" and link.loss_factor:
                derivative = factor * (1.0 + 1j * link.loss_factor)
            gradient[:, k] += derivative * product
    return h, gradient
