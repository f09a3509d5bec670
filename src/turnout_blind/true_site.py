"""The true state of one site: rail, supports, attached masses, surfaces, sensors. Effects change it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout_blind.grid import Grid, Rail, spread
from turnout_blind.instrument import Fault
from turnout_blind.march_inputs import AttachedMasses, Beam, Blade, Supports, no_blade

if TYPE_CHECKING:
    from turnout_blind.switch import TrueBlade

SPACING = 0.6
PER_SUPPORT = ("place", "pad", "pad_damping", "mass", "ballast", "ballast_damping")


def _empty_array() -> np.ndarray:
    return np.zeros(0)


@dataclass
class World:
    """The true track, wheels and sensors: arrays (n_support,) unless noted, SI units. An effect changes a ``copy()``.

    ``branch_share`` and ``branch_rate`` are (n_branch,). ``pad`` is the stiffness at the ``reference`` temperature;
    ``softening``, a function of kelvin above it, multiplies it. ``profile`` is None, or at a crossing (bending, mass)
    of every node as factors on the values of the rail. ``surface`` is a list of functions of position [m] that give
    dips of the rail [m]. ``treads`` maps (train, axle from 1) to functions of position, phase and radius.
    ``attached_masses`` holds (position, mass, stiffness, damping, play, stop). ``channels`` maps a sensor to functions
    (recording type, rng) -> (function (signal, rate) -> signal). ``passage_noise`` is a list of functions (time, sensor
    positions, k, rng) -> accelerations (n_sensor, n) of another source. ``blade`` is that of a switch, None without
    one.
    """

    grid: Grid
    rail: Rail
    position: np.ndarray
    pad: np.ndarray
    pad_damping: np.ndarray
    mass: np.ndarray
    ballast: np.ndarray
    ballast_damping: np.ndarray
    lift: np.ndarray = field(default_factory=_empty_array)
    gap: np.ndarray = field(default_factory=_empty_array)
    seated: np.ndarray = field(default_factory=_empty_array)
    close: np.ndarray = field(default_factory=_empty_array)
    hardening: np.ndarray = field(default_factory=_empty_array)
    drift: np.ndarray = field(default_factory=_empty_array)
    shear: float = 0.0
    shear_damping: float = 0.0
    branch_share: np.ndarray = field(default_factory=_empty_array)
    branch_rate: np.ndarray = field(default_factory=_empty_array)
    reference: float = 15.0
    softening: Callable[[float], float] | None = None
    attached_masses: list[tuple[float, ...]] = field(default_factory=list)
    profile: tuple[np.ndarray, np.ndarray] | None = None
    surface: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)
    treads: dict[tuple[str, int], list[Callable[..., np.ndarray]]] = field(default_factory=dict)
    wheel_mass: dict[str, float] = field(default_factory=dict)
    wear_per_passage: dict[int, tuple[float, float]] = field(default_factory=dict)
    channels: dict[str, list[Callable[[str, np.random.Generator], Fault]]] = field(default_factory=dict)
    sensor_shift: dict[str, float] = field(default_factory=dict)
    passage_noise: list[Callable[..., np.ndarray]] = field(default_factory=list)
    blade: TrueBlade | None = None

    def __post_init__(self) -> None:
        n = self.position.size
        neutral = {"lift": 1.0, "gap": -1.0, "seated": 0.0, "close": 1e-4, "hardening": 0.0, "drift": 0.0}
        for name, value in neutral.items():
            if getattr(self, name).size != n:
                setattr(self, name, np.full(n, value))

    def copy(self) -> World:
        """A copy whose arrays and lists can be changed without changing this world."""
        values: dict[str, Any] = {}
        for name, value in self.__dict__.items():
            if isinstance(value, np.ndarray):
                values[name] = value.copy()
            elif isinstance(value, list):
                values[name] = list(value)
            elif name == "blade" and value is not None:
                values[name] = value.copy()
            elif isinstance(value, dict):
                values[name] = {k: list(v) if isinstance(v, list) else v for k, v in value.items()}
        return replace(self, **values)

    def nearest(self, position: float) -> int:
        """Index of the nearest support.

        Parameters
        ----------
        position : float
            Position. [m]

        Returns
        -------
        int
            Index of the support.
        """
        return int(np.argmin(np.abs(self.position - position)))

    def beam(self) -> Beam:
        """Inputs of the march: the rail."""
        g, r = self.grid, self.rail
        loss, rates = r.damping / r.mass, (g.rates(), g.rates(0.5)[:-1])
        if self.profile is None:
            return Beam(g.step, r.bending, r.shear, r.mass, r.rotary, rates[0] + loss, rates[1])
        bending, mass = self.profile
        between = [0.5 * (v[1:] + v[:-1]) for v in self.profile]
        return Beam(
            g.step, r.bending * bending, r.shear * between[1], r.mass * mass, r.rotary * between[0],
            rates[0] + loss / mass, rates[1],
        )  # fmt: skip

    def supports(self, temperature: float | None = None, n_passages: float = 0.0) -> Supports:
        """Inputs of the march: pads, sleepers and ballast.

        Parameters
        ----------
        temperature : float or None
            Rail temperature [°C]; None: the reference.
        n_passages : float
            Passages before, which have worn the supports.

        Returns
        -------
        Supports
            Inputs of the march.
        """
        first, weights = spread(self.grid, self.position)
        pad_factor = 1.0
        if self.softening is not None and temperature is not None:
            pad_factor = self.softening(temperature - self.reference)
        gap, ballast = self.gap.copy(), self.ballast.copy()
        for j, (gap_growth, factor) in self.wear_per_passage.items():
            gap[j] += gap_growth * n_passages if gap[j] >= 0.0 else 0.0
            ballast[j] *= factor**n_passages
        n = self.position.size
        return Supports(
            first, weights, self.pad * pad_factor, self.pad_damping, self.lift, self.mass, ballast,
            self.ballast_damping, gap, self.seated, self.close, self.hardening, self.drift,
            np.full(n, self.shear), np.full(n, self.shear_damping), self.branch_share, self.branch_rate,
        )  # fmt: skip

    def blade_inputs(self) -> Blade:
        """Inputs of the march: the blade of a switch."""
        return no_blade() if self.blade is None else self.blade.inputs(self.grid, self.rail, self.position)

    def attached_mass_inputs(self) -> AttachedMasses:
        """Inputs of the march: masses attached to the rail."""
        table = np.array(self.attached_masses, dtype=float).reshape(-1, 6)
        first, weights = spread(self.grid, table[:, 0])
        return AttachedMasses(first, weights.reshape(-1, 4), *(np.ascontiguousarray(c) for c in table.T[1:]))
