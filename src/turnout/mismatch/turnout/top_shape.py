r"""Error of the shape of the tops of stock rail and blade where wheels change from one to the other.

A track file has three numbers for each top, and a tolerance for its depth. Between the sections that were measured the
top may have any form within that tolerance. With the dip :math:`p_0` at which both tops are level and the tolerance
:math:`\sigma` of the depth, the error of each top is a Gaussian process with the covariance

.. math:: k(x, x') = (\sigma p_0)^2\, w(x)\, w(x')\, e^{-(x - x')^2 / 2 l^2}, \quad
          w(x) = \cos^2\frac{\pi (x - x_0)}{2 r} \text{ within } |x - x_0| < r

about the position :math:`x_0` of the change: beyond it wheels press one rail alone, and the numbers of the top suffice.
It is the same for all wheels. Its principal modes (Karhunen and Loeve) are nuisances of unit variance, so that a fit
integrates them out, and a dip or hump there has to exceed them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.surface_priors import TOP_SHAPE
from turnout.simulate.blade import is_on_blade, transfer_position
from turnout.simulate.wheel_path import uniform_spline

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.mismatch.turnout.predictions import Values
    from turnout.simulate.turnout_track import TurnoutTrack
    from turnout.simulate.wheel_path import PathPart, Surfaces


@dataclass(frozen=True)
class TopShape:
    """Error of one top of a route about the ``position`` of the change of wheels [m].

    ``sd`` [m] is its standard deviation there.
    """

    route: str
    on_blade: bool
    position: float
    sd: float

    @cached_property
    def modes(self) -> np.ndarray:
        """(n_mode, n) principal modes every ``TOP_SHAPE.step`` over the stretch, one standard deviation each. [m]"""
        half = round(TOP_SHAPE.reach / TOP_SHAPE.step)
        distance = TOP_SHAPE.step * np.arange(-half, half + 1)
        return principal_modes(top_covariance(distance, self.sd), TOP_SHAPE.kept_variance)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the amplitudes."""
        top = "blade" if self.on_blade else "stock"
        return tuple(f"{top}_shape_{self.route}_{k}" for k in range(len(self.modes)))

    def nuisances(self) -> list[Nuisance]:
        """One amplitude for each mode, in standard deviations."""
        top = "blade" if self.on_blade else "stock rail"
        meaning = f"shape of the top of the {top} where wheels change at {self.position:.2f} m"
        return [Nuisance(n, "sd", 0.0, 1.0, meaning=meaning, can_mask=False, group="top_shape") for n in self.names]

    def path(self, values: Values) -> tuple[TopError, ...]:
        """The error as a component of the top; () where all amplitudes are 0.

        Parameters
        ----------
        values : mapping of str to float
            Values of the parameters by their name.

        Returns
        -------
        tuple of TopError
        """
        amplitudes = tuple(float(values.get(n, 0.0)) for n in self.names)
        return (TopError(self, amplitudes),) if any(amplitudes) else ()


@dataclass(frozen=True)
class TopError:
    """Path part: error of a top, with the ``amplitudes`` of the modes of its ``shape`` in standard deviations."""

    shape: TopShape
    amplitudes: tuple[float, ...]
    is_shape_error = True

    @property
    def on_blade(self) -> bool:
        """Whether the top is that of the blade."""
        return self.shape.on_blade

    def __call__(self, x: np.ndarray, wheel: int = 0) -> np.ndarray:
        dip = np.array(self.amplitudes) @ self.shape.modes
        return uniform_spline(dip, self.shape.position - TOP_SHAPE.reach, TOP_SHAPE.step, x)


def top_shapes(turnout: TurnoutTrack, route: str, depth_spreads: Mapping[PathPart, float]) -> list[TopShape]:
    """Errors of both tops of a route; [] where wheels do not change to a blade.

    Parameters
    ----------
    turnout : TurnoutTrack
        The turnout as filed.
    route : str
        Route through it.
    depth_spreads : mapping
        Component -> relative tolerance of its depth. A top without one is exact.

    Returns
    -------
    list of TopShape
    """
    surfaces, blade = turnout.surfaces(route), turnout.track_of(route).blade
    position = None if blade is None else transfer_position(surfaces, blade)
    if position is None:
        return []
    shapes = [
        TopShape(route, is_on_blade(surface), position, _error_at(surface, position, depth_spreads))
        for surface in surfaces
    ]
    return [shape for shape in shapes if shape.sd > 0.0]


def with_shapes(surfaces: Surfaces, shapes: list[TopShape], values: Values) -> Surfaces:
    """Surfaces with the errors of their tops.

    Parameters
    ----------
    surfaces : tuple of tuple of path parts
        Surfaces of a route.
    shapes : list of TopShape
        Those of this route.
    values : mapping of str to float
        Values of the parameters by their name.

    Returns
    -------
    tuple of tuple of path parts
    """
    for shape in shapes:
        path = shape.path(values)
        surfaces = tuple((*s, *path) if is_on_blade(s) is shape.on_blade else s for s in surfaces)
    return surfaces


def top_covariance(distance: np.ndarray, sd: float) -> np.ndarray:
    """Covariance of the error of a top between points.

    Parameters
    ----------
    distance : (n,) array of float
        From the position of the change. [m]
    sd : float
        Standard deviation at the change. [m]

    Returns
    -------
    (n, n) array of float
        [m²]
    """
    weight = np.cos(0.5 * np.pi * np.clip(distance / TOP_SHAPE.reach, -1.0, 1.0)) ** 2
    lag = (distance[:, None] - distance) / TOP_SHAPE.correlation_length
    return sd**2 * np.outer(weight, weight) * np.exp(-0.5 * lag**2)


def principal_modes(covariance: np.ndarray, share: float) -> np.ndarray:
    """Fewest principal modes whose squares sum to a share of the variance.

    Parameters
    ----------
    covariance : (n, n) array of float
    share : float
        Of the trace, below 1.

    Returns
    -------
    (n_mode, n) array of float
        The largest first, one standard deviation each.
    """
    variance, vectors = np.linalg.eigh(covariance)
    variance, vectors = variance[::-1], vectors[:, ::-1]
    kept = 1 + int(np.searchsorted(np.cumsum(variance), share * np.trace(covariance)))
    return (vectors[:, :kept] * np.sqrt(variance[:kept])).T


def _error_at(surface: tuple[PathPart, ...], position: float, depth_spreads: Mapping[PathPart, float]) -> float:
    """Standard deviation of the top at a position [m]."""
    x = np.array([position])
    return float(np.sqrt(sum((depth_spreads.get(c, 0.0) * float(c(x, 0)[0])) ** 2 for c in surface)))
