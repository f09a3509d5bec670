"""Factorise a track for a time step and scheme; trains, speeds and paths share the result."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.band_matrix import all_diagonals, factorise, inverse_windows, upper_rows
from turnout.simulate.integrator import scheme as scheme_called
from turnout.simulate.matrices import TrackMatrices, assemble
from turnout.simulate.number_checks import check_count, check_number
from turnout.simulate.state import SchemeArrays, TrackArrays
from turnout.simulate.track import Track

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.simulate.effect import Effect
    from turnout.simulate.integrator import Scheme

MIN_PIVOT_RATIO = 1e-11  # pivot over its diagonal element below which the pivot is a rounded 0
WINDOW_DECAY = 30.0  # exp(-30) = 1e-13: windows of the inverse are exact to rounding


@dataclass(frozen=True)
class Prepared:
    """A factorised track: ``matrices`` for sensors and statics, ``arrays`` and ``scheme`` for the kernels.

    ``stand_ins`` caches the stand-in track for each position at which wheels enter.
    """

    track: Track
    terms: tuple
    dt: float
    scheme_name: str
    matrices: TrackMatrices
    arrays: TrackArrays
    scheme: SchemeArrays
    static: tuple[np.ndarray, np.ndarray, np.ndarray]
    stand_ins: dict[float, tuple[float, float, float]] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    def static_response(self, rows: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Static deflection of all degrees of freedom under a unit force with these weights.

        Parameters
        ----------
        rows : (n_end,) array of int
            Degrees of freedom on which the force acts.
        weights : (n_end,) array of float
            Share of the force on each.

        Returns
        -------
        (n,) array of float
            Deflection of every degree of freedom. [m/N]
        """
        lower, upper, inverse_pivot = self.static
        x = np.zeros(self.matrices.n)
        np.add.at(x, rows, weights)
        from turnout.simulate.band_solution import solve

        solve(lower, upper, inverse_pivot, x, 0, x.size)
        return x

    def check_step(self, rate: float, substeps: int) -> None:
        """Check that this was prepared for a sampling rate and a number of steps per sample.

        Parameters
        ----------
        rate : float
            Sampling rate. [Hz]
        substeps : int
            Time steps per sample.

        Raises
        ------
        SimulationError
            If it was prepared for another time step, and for a rate or number of steps that is none.
        """
        time_step_of(rate, substeps)
        if not abs(self.dt * rate * substeps - 1.0) < 1e-9:
            raise SimulationError(
                f"the track is prepared for steps of {self.dt:.9g} s, but {rate!r} Hz with {substeps!r} per sample "
                f"ask for {1.0 / (rate * substeps):.9g} s: prepare it with the same rate and substeps."
            )


def time_step_of(rate: float, substeps: int) -> float:
    """Time step of a sampling rate.

    Parameters
    ----------
    rate : float
        Sampling rate, above 0. [Hz]
    substeps : int
        Time steps per sample, at least 1.

    Returns
    -------
    float
        Time step. [s]

    Raises
    ------
    SimulationError
        For a rate or number of steps that is none.
    """
    check_number("rate", rate, "Hz", above=0.0)
    check_count("substeps", substeps)
    return 1.0 / (rate * substeps)


def prepare(
    track: Track,
    dt: float = 5e-5,
    scheme: str = "radau",
    terms: Sequence[Effect] = (),
    decay: float = WINDOW_DECAY,
    matrices: TrackMatrices | None = None,
) -> Prepared:
    """Assemble and factorise ``track`` with the matrix entries of ``terms`` for steps of ``dt`` [s].

    The response to a force is neglected where it has decayed to exp(-``decay``). ``matrices`` are those of this track
    with these terms, if they are assembled already.

    Parameters
    ----------
    track : Track
        The track.
    dt : float
        Time step. [s]
    scheme : str
        Name of the integration scheme.
    terms : sequence of Effect
        Effects added to the base model.
    decay : float
        Exponent of the decay beyond which the response to a force is neglected. [-]
    matrices : TrackMatrices or None
        Matrices of this track with these terms; None: assemble them.

    Returns
    -------
    Prepared
        The factorised track.

    Raises
    ------
    SimulationError
        For a time step that is not above 0, and where the track carries no load.
    """
    check_number("time step", dt, "s", above=0.0)
    terms = tuple(terms)
    matrices = assemble(track, terms) if matrices is None else matrices
    integration_scheme = scheme_called(scheme)
    s = integration_scheme.rate / dt
    system = s * s * matrices.mass + s * matrices.damping + matrices.stiffness
    lower, upper, inverse_pivot = _factors(system)
    static = _factors(matrices.stiffness)
    is_loose = (static[2] <= 0.0) | (1.0 / static[2] < MIN_PIVOT_RATIO * matrices.stiffness[0])
    if np.any(is_loose):
        k = int(np.argmax(is_loose))
        raise SimulationError(
            f"{track.name}: the track carries no load, its stiffness has pivot {1 / static[2][k]:.3g} in row {k}."
        )
    reach = _reach(track, matrices, s, decay)
    window = inverse_windows(lower, upper, inverse_pivot, reach)
    lower_back, upper_back, pivot_back, middle = _two_sided_factors(system, window, reach)
    arrays = TrackArrays(
        matrices.n,
        reach,
        lower,
        upper,
        inverse_pivot,
        all_diagonals(matrices.mass, max(4, matrices.half)),
        all_diagonals(matrices.stiffness, max(4, matrices.half)),
        window,
        lower_back,
        upper_back,
        pivot_back,
        middle,
        matrices.node,
        *matrices.line_elements,
    )
    return Prepared(track, terms, dt, scheme, matrices, arrays, _scheme_arrays(integration_scheme, dt), static)


def _factors(system: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    half, n = system.shape[0] - 1, system.shape[1]
    width = 4 if half <= 4 else 6 if half <= 6 else half
    lower, inverse_pivot = np.zeros((n, width), dtype=system.dtype), np.zeros(n, dtype=system.dtype)
    factorise(np.ascontiguousarray(system), lower, inverse_pivot)
    return lower, upper_rows(lower, n, half, width), inverse_pivot


def _two_sided_factors(
    system: np.ndarray, window: np.ndarray, reach: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Factors of the reversed matrix and the middle block of the inverse, for half bandwidth 6 at most."""
    half, n = system.shape[0] - 1, system.shape[1]
    size = 4 if half <= 4 else 6
    if half > 6 or n < 4 * size or reach < size:
        empty = np.zeros((0, 4), dtype=system.dtype)
        return empty, empty, np.zeros(0, dtype=system.dtype), np.zeros((0, 0), dtype=system.dtype)
    reversed_system = np.zeros_like(system)
    for k in range(half + 1):
        reversed_system[k, : n - k] = system[k, : n - k][::-1]
    top = (n - size) // 2
    middle = np.array([[window[top + i, reach + j - i] for j in range(size)] for i in range(size)])
    return *_factors(reversed_system), np.ascontiguousarray(middle)


def _reach(track: Track, matrices: TrackMatrices, s: complex, exponent: float) -> int:
    """Half width of the windows: decay of EI w'''' + s² m w = 0 down to exp(-``exponent``), in rows."""
    rails = {*matrices.rails, *matrices.blade_rails}
    decay = min(float(np.min(np.abs(np.roots([r.bending_stiffness, 0, 0, 0, s * s * r.mass]).real))) for r in rails)
    span = exponent / decay
    node = matrices.node
    rows = [
        matrices.node_index[min(np.searchsorted(node, x + span), node.size - 1)] - i
        for x, i in zip(node, matrices.node_index)
    ]
    return int(min(max(rows) + matrices.half + 2, matrices.n - 1))


def _scheme_arrays(integration_scheme: Scheme, dt: float) -> SchemeArrays:
    return SchemeArrays(
        float(dt),
        integration_scheme.rate / dt,
        integration_scheme.t,
        integration_scheme.tau,
        integration_scheme.weight,
        integration_scheme.delta,
        float(integration_scheme.carry),
        integration_scheme.node,
        integration_scheme.quadrature,
        integration_scheme.inverse,
        float(integration_scheme.scale),
        integration_scheme.quadrature @ integration_scheme.inverse,
    )
