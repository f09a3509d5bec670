"""Parts of the path of a wheel: dips, kinks, joints, crossings, corrugation, wheel flats; a dip is positive.

The sum of all parts is a cubic spline on a uniform grid, C2, with straight ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.number_checks import check_fields, check_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

PathPart = Callable[[np.ndarray, int], np.ndarray]  # position [m] and wheel -> dip [m]
Surfaces = tuple[tuple[PathPart, ...], ...]  # of a route: the parts of the path on each surface


def uniform_pieces(value: np.ndarray | Sequence[float]) -> np.ndarray:
    """Coefficients of the natural cubic spline through ``value`` at unit steps.

    Parameters
    ----------
    value : (n,) array of float
        Values on the grid, at least two.

    Returns
    -------
    (n - 1, 4) array of float
        Coefficients of each piece, highest power first.

    Examples
    --------
    >>> pieces = uniform_pieces(np.array([0.0, 1.0, 2.0, 3.0]))
    >>> bool(np.allclose(pieces, [[0, 0, 1, 0], [0, 0, 1, 1], [0, 0, 1, 2]]))
    True
    """
    # imported here, because it loads numba, which the text of an effect need not
    from turnout.simulate.spline_kernel import second_differences

    value = np.ascontiguousarray(value, dtype=float)
    m = np.zeros(value.size)
    second_differences(value, m)
    a, b = m[:-1], m[1:]
    slope = np.diff(value) - (2.0 * a + b) / 6.0
    return np.column_stack([(b - a) / 6.0, 0.5 * a, slope, value[:-1]])


def uniform_spline(value: np.ndarray | Sequence[float], start: float, step: float, x: ArrayLike) -> np.ndarray:
    """Natural cubic spline on a uniform grid; 0 outside the grid.

    Parameters
    ----------
    value : (n,) array of float
        Values on the grid.
    start : float
        Position of the first value. [m]
    step : float
        Distance of two values. [m]
    x : float or (...) array
        Positions. [m]

    Returns
    -------
    (...) array
        Value at each ``x``.
    """
    pieces = uniform_pieces(value)
    grid_position = (np.asarray(x, dtype=float) - start) / step
    k = np.clip(np.floor(grid_position).astype(np.int64), 0, len(pieces) - 1)
    r = grid_position - k
    c = pieces[k]
    dip = ((c[..., 0] * r + c[..., 1]) * r + c[..., 2]) * r + c[..., 3]
    return np.where((grid_position >= 0.0) & (grid_position <= len(pieces)), dip, 0.0)


@dataclass(frozen=True)
class Dip:
    r"""Dipped joint or weld of two halves :math:`p = d\,e^{-|x-x_0|/a}`.

    Both sides slope by α at ``place`` x₀ [m]: the total angle 2α = 2 d / a of Jenkins et al. 1974. ``depth`` d [m],
    ``length`` a [m].

    >>> dip = Dip(10.0, depth=2e-3, length=0.5)
    >>> [round(float(dip(10.0 + 0.5 * np.log(n))), 6) for n in (1.0, 2.0, 4.0)]
    [0.002, 0.001, 0.0005]
    """

    place: float
    depth: float
    length: float

    def __post_init__(self) -> None:
        _check_part("dip", self.place, self.length, self)

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        return self.depth * np.exp(-np.abs(np.asarray(x) - self.place) / self.length)


@dataclass(frozen=True)
class Cosine:
    r"""Smooth dip :math:`p = \tfrac d2 (1 + \cos 2\pi(x - x_0)/L)` over one length L [m]."""

    place: float
    depth: float
    length: float

    def __post_init__(self) -> None:
        _check_part("cosine", self.place, self.length, self)

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        phase = np.clip((np.asarray(x) - self.place) / self.length, -0.5, 0.5)
        return 0.5 * self.depth * (1.0 + np.cos(2.0 * np.pi * phase))


@dataclass(frozen=True)
class Kink:
    r"""Dip of two curves, flat at its ends, that meet in a kink: :math:`p = d\,(1 - |x - x_0| / a)^n`.

    A wheel that leaves the wing of a crossing falls slowly and is lifted abruptly by the nose. ``depth`` d [m] at
    ``place``. a is ``share`` of ``length`` [m] before the kink, the remainder after it. ``power`` n: 2 for parabolas.

    >>> kink = Kink(60.0, depth=2e-3, length=0.5, share=0.5)
    >>> float(kink(60.125)), round(kink.angle, 6)
    (0.0005, 0.032)
    """

    place: float
    depth: float
    length: float
    share: float = 0.5
    power: float = 2.0

    def __post_init__(self) -> None:
        _check_part("kink", self.place, self.length, self)
        if not self.power >= 1.0:
            raise SimulationError(f"kink at {self.place:.3f} m: power {self.power!r} is below 1.")
        if not 0.0 < self.share < 1.0:
            raise SimulationError(f"kink at {self.place:.3f} m: share {self.share!r} is not between 0 and 1.")

    @property
    def angle(self) -> float:
        """Change of slope at the lowest point [rad]."""
        return self.power * self.depth * (1.0 / (self.share * self.length) + 1.0 / ((1.0 - self.share) * self.length))

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        distance = np.asarray(x) - self.place
        before, after = self.share * self.length, (1.0 - self.share) * self.length
        return (
            self.depth
            * np.clip(1.0 - np.where(distance < 0.0, -distance / before, distance / after), 0.0, None) ** self.power
        )


@dataclass(frozen=True)
class Sections:
    """Path measured at some positions, a monotone cubic between them (C1). ``places`` increasing [m], ``dips`` [m].

    Constant outside. The spacing of the sections is part of the model: a spacing of 0.25 m reduces the response of a
    crossing by 8 dB, which needs 10 mm.
    """

    places: tuple[float, ...]
    dips: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.places) != len(self.dips) or len(self.places) < 2 or np.any(np.diff(self.places) <= 0.0):
            raise SimulationError(f"sections: {len(self.places)} places, {len(self.dips)} dips; places must rise.")
        if not np.all(np.isfinite([*self.places, *self.dips])):
            raise SimulationError("sections: not all places and dips are numbers.")

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        from scipy.interpolate import PchipInterpolator

        x = np.clip(np.asarray(x, dtype=float), self.places[0], self.places[-1])
        return PchipInterpolator(self.places, self.dips)(x)


@dataclass(frozen=True)
class BladeTop:
    r"""Top of a blade: ``depth`` d below the stock rail at its toe, level with it after ``length``.

    .. math:: p = d\,(1 - s)^n, \quad s = (x - x_0) / L \text{ within } 0..1

    The toe is at ``start`` [m]; ``length`` L [m] is negative where the blade points to larger x; ``power`` n. It
    belongs to the blade: the wheel on it presses that rail. EN 13232-5 (from memory, unverified): 14 to 23 mm at the
    toe.
    """

    start: float
    length: float
    depth: float
    power: float = 1.5
    on_blade = True

    def __post_init__(self) -> None:
        _check_part("blade top", self.start, abs(self.length), self)
        if not self.power >= 1.0:
            raise SimulationError(f"blade top at {self.start:.3f} m: power {self.power!r} is below 1.")

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        share = (np.asarray(x, dtype=float) - self.start) / self.length
        return self.depth * np.clip(1.0 - share, 0.0, 1.0) ** self.power


@dataclass(frozen=True)
class StockFall:
    r"""Stock rail from which the wheel moves off, :math:`p = d\,s^n` from ``start`` over ``length`` to ``depth``.

    The contact runs outwards on the cone of the wheel, which so sinks. ``start`` [m]; ``length`` [m] is negative where
    the wheel moves off towards smaller x; ``depth`` d [m], beyond which the wheel is on the other rail; ``power`` n.
    """

    start: float
    length: float
    depth: float
    power: float = 2.0

    def __post_init__(self) -> None:
        _check_part("stock rail", self.start, abs(self.length), self)
        if not self.power >= 1.0:
            raise SimulationError(f"stock rail at {self.start:.3f} m: power {self.power!r} is below 1.")

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        share = (np.asarray(x, dtype=float) - self.start) / self.length
        return self.depth * np.clip(share, 0.0, 1.0) ** self.power


@dataclass(frozen=True)
class Corrugation:
    r"""Waves :math:`p = A \sin 2\pi(x - x_0)/\lambda` between ``start`` and ``end``, faded over a wavelength."""

    start: float
    end: float
    amplitude: float
    wavelength: float

    def __post_init__(self) -> None:
        _check_part("corrugation", self.start, self.wavelength, self)
        check_number(f"corrugation from {self.start:g} m: end", self.end, "m", above=self.start)

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        fade = np.clip(np.minimum(x - self.start, self.end - x) / self.wavelength, 0.0, 1.0)
        return (
            self.amplitude * fade * fade * (3.0 - 2.0 * fade) * np.sin(2.0 * np.pi * (x - self.start) / self.wavelength)
        )


@dataclass(frozen=True)
class WheelFlat:
    r"""Rounded flat of one wheel: once per revolution it drops by :math:`d = l^2/16R` along a cosine of length l.

    ``wheel`` counts from the front, ``length`` l and ``radius`` R [m], ``phase`` [m] of rolling to the first
    flat. Newton and Clark 1979, An investigation into the dynamic effects on track of wheelflats on railway
    vehicles (from memory, unverified: half the chord's sagitta :math:`l^2/8R`, as the wheel falls while it rolls on).

    >>> flat = WheelFlat(wheel=0, length=0.05, radius=0.43)
    >>> f"{flat.depth * 1e3:.2f} mm"
    '0.36 mm'
    """

    wheel: int
    length: float
    radius: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        check_fields(f"flat of wheel {self.wheel}", self)
        check_number(f"flat of wheel {self.wheel}: length", self.length, "m", least=0.0)
        check_number(f"flat of wheel {self.wheel}: radius", self.radius, "m", above=0.0)

    @property
    def depth(self) -> float:
        """Drop of the wheel's centre [m]."""
        return self.length**2 / (16.0 * self.radius)

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        if wheel != self.wheel:
            return np.zeros_like(x)
        turn = 2.0 * np.pi * self.radius
        distance = np.remainder(x - self.phase + 0.5 * turn, turn) - 0.5 * turn
        return (
            0.5
            * self.depth
            * np.where(np.abs(distance) < 0.5 * self.length, 1.0 + np.cos(2.0 * np.pi * distance / self.length), 0.0)
        )


@dataclass(frozen=True)
class OutOfRound:
    r"""Wheel of wave number n: :math:`p = A \cos(n (x - x_0) / R)`."""

    wheel: int
    amplitude: float
    order: int
    radius: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        check_fields(f"out-of-round wheel {self.wheel}", self)
        check_number(f"out-of-round wheel {self.wheel}: radius", self.radius, "m", above=0.0)

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        x = np.asarray(x, dtype=float)
        return (self.amplitude if wheel == self.wheel else 0.0) * np.cos(self.order * (x - self.phase) / self.radius)


@dataclass(frozen=True)
class Sampled:
    """Dip given at every ``step`` [m] from ``start`` on, cubic between; 0 outside. Roughness is one of these."""

    start: float
    step: float
    dip: np.ndarray

    def __post_init__(self) -> None:
        check_fields("sampled dip", self)
        check_number("sampled dip: step", self.step, "m", above=0.0)
        if np.ndim(self.dip) != 1 or np.size(self.dip) < 2:
            raise SimulationError(f"sampled dip: needs two values or more in a row, got {self.dip!r}.")

    def __call__(self, x: ArrayLike, wheel: int = 0) -> np.ndarray:
        return uniform_spline(self.dip, self.start, self.step, x)


def _check_part(name: str, position: float, length: float, part: PathPart) -> None:
    if not length > 0.0:
        raise SimulationError(f"{name} at {position:.3f} m: a length of {length!r} m is none.")
    check_fields(f"{name} at {position:.3f} m", part)


def spline_pieces(path_parts: Sequence[PathPart], wheel: int, start: float, end: float, step: float) -> np.ndarray:
    """Spline of the sum of ``path_parts`` for one wheel, C2.

    Parameters
    ----------
    path_parts : sequence of path parts
        Parts of the path.
    wheel : int
        Number of the wheel, counted from the front.
    start : float
        First position. [m]
    end : float
        Last position; the grid covers it. [m]
    step : float
        Length of a piece. [m]

    Returns
    -------
    (n, 4) array of float
        Cubic coefficients of each piece, highest power first.

    Raises
    ------
    SimulationError
        Where the sum is not a number.
    """
    x = np.arange(start, end + 1.5 * step, step)
    dip = np.zeros_like(x)
    for path_part in path_parts:
        dip += path_part(x, wheel)
    if not np.all(np.isfinite(dip)):
        raise SimulationError(f"the path of wheel {wheel} is not a number at {x[~np.isfinite(dip)][0]:.3f} m.")
    return uniform_pieces(dip)
