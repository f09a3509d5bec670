"""A switch panel: long bearers, a blade beside the stock rail, and the change of every wheel from one to the other.

The second rail is a beam of its own on the grid of the first, from its free toe to the end of the grid. Up to the heel
it lies on slide chairs, which press and do not pull; behind it is the closure rail, fastened like the stock rail.
Sensors and hammer are on the stock rail. Geometry after Palsson and Nielsen 2012, Vehicle System Dynamics 50, and Kassa
and
Nielsen 2009, Journal of Sound and Vibration 320.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout_blind.grid import spread
from turnout_blind.march_inputs import Blade

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout_blind.grid import Grid, Rail
    from turnout_blind.true_site import World
    from turnout_blind.vehicle import Train

GRAVITY = 9.81
PLANED_SHARE = 0.55  # mass and bending of the planed toe over those of the full section
BLADE_POWER, STOCK_POWER = 1.3, 1.8  # exponents of both tops; the owner's file has others
ONLY_BLADE = 0.25  # length behind the planed part from which wheels cannot touch the stock rail [m]
FIRST_CHAIR = 0.2  # no chair lies nearer behind the toe: its force is spread over the nodes about it [m]
BESIDE_SUPPORT = 0.07  # a toe this near behind a bearer would count as on it [m]
TOE_ERROR = 0.01  # of the owner's file: the blade creeps and expands [m]
WHEEL_DEPTH_SPREAD, WHEEL_SHIFT = 0.1, 0.03  # each wheel sinks differently and changes elsewhere [-, m]


@dataclass(frozen=True)
class Switch:
    """Blade from ``toe`` to ``heel`` [m]; its top rises from ``depth`` below the stock rail over ``length`` [m].

    From ``fall_start`` [m] on the wheel sinks on the stock rail by ``fall`` [m] over ``fall_length`` [m]. ``chair``
    [N/m] and ``chair_damping`` [N s/m] are those of a slide chair and of a fastening.
    """

    toe: float
    heel: float
    depth: float
    length: float
    fall_start: float
    fall: float
    fall_length: float
    chair: float
    chair_damping: float

    def blade_top(self, x: np.ndarray) -> np.ndarray:
        """Top of the blade below that of the stock rail.

        Parameters
        ----------
        x : (n,) array of float
            Positions. [m]

        Returns
        -------
        (n,) array of float
            Dip, down positive. [m]
        """
        return self.depth * np.clip(1.0 - (x - self.toe) / self.length, 0.0, 1.0) ** BLADE_POWER

    def stock_top(self, x: np.ndarray) -> np.ndarray:
        """Dip that a wheel on the stock rail follows while it moves off it.

        Parameters
        ----------
        x : (n,) array of float
            Positions. [m]

        Returns
        -------
        (n,) array of float
            Dip, down positive. [m]
        """
        return self.fall * np.clip((x - self.fall_start) / self.fall_length, 0.0, 1.0) ** STOCK_POWER


@dataclass
class TrueBlade:
    """State of a blade: ``supports`` (n,) of the track under it, each with ``stiffness``, ``damping`` and ``gap``.

    These are arrays (n,) in N/m, N s/m and m. A ``gap`` of -1 marks a fastening. ``surface`` is a list of functions of
    position that lower its top. ``wheels``: (train, axle from 1) -> factor and shift [m] of the fall on the stock rail.
    """

    switch: Switch
    supports: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    gap: np.ndarray
    surface: list[Callable[[np.ndarray], np.ndarray]] = field(default_factory=list)
    wheels: dict[tuple[str, int], tuple[float, float]] = field(default_factory=dict)

    def copy(self) -> TrueBlade:
        """A copy that can be changed without changing this one."""
        return replace(
            self, stiffness=self.stiffness.copy(), damping=self.damping.copy(), gap=self.gap.copy(),
            surface=list(self.surface), wheels=dict(self.wheels),
        )  # fmt: skip

    def inputs(self, grid: Grid, rail: Rail, position: np.ndarray) -> Blade:
        """Inputs of the march.

        Parameters
        ----------
        grid : Grid
            Grid of the stock rail.
        rail : Rail
            Section of the stock rail; the blade has the same behind its planed part.
        position : (n_support,) array of float
            Positions of all supports. [m]

        Returns
        -------
        Blade
        """
        start = round((self.switch.toe - grid.start) / grid.step)
        x = grid.start + grid.step * np.arange(start, grid.n)
        between = x[:-1] + 0.5 * grid.step
        loss, rates = rail.damping / rail.mass, (grid.rates()[start:], grid.rates(0.5)[start:-1])
        first, weights = spread(grid, position[self.supports])
        bay = float(np.median(np.diff(position)))
        load = GRAVITY * rail.mass * bay * np.where(self.gap < 0.0, 0.0, 1.0)
        return Blade(
            start, rail.bending * self._section(x), rail.shear * self._section(between), rail.mass * self._section(x),
            rail.rotary * self._section(between), rates[0] + loss, rates[1], first - start, weights, self.supports,
            self.stiffness, self.damping, self.gap, load, self.switch.toe,
            self.switch.toe + self.switch.length + ONLY_BLADE,
        )  # fmt: skip

    def _section(self, x: np.ndarray) -> np.ndarray:
        """Share of the full section along the planed part."""
        s = np.clip((x - self.switch.toe) / self.switch.length, 0.0, 1.0)
        return PLANED_SHARE + (1.0 - PLANED_SHARE) * s

    def paths(self, x: np.ndarray, train: Train) -> tuple[np.ndarray, np.ndarray]:
        """What both tops add to the dips that the wheels of a train meet.

        Parameters
        ----------
        x : (m,) array of float
            Positions. [m]
        train : Train
            The train.

        Returns
        -------
        two (n_wheel, m) arrays of float
            On the stock rail and on the blade. [m]
        """
        top = self.switch.blade_top(x) + sum((loss(x) for loss in self.surface), np.zeros(x.size))
        n = train.axles().size
        wheels = [self.wheels.get((train.name, i + 1), (1.0, 0.0)) for i in range(n)]
        return np.array([f * self.switch.stock_top(x - shift) for f, shift in wheels]), np.tile(top, (n, 1))


def clear_of_bearers(toe: float, bearers: np.ndarray, nodes: np.ndarray) -> float:
    """The node nearest to a toe at which every bearer behind it has a chair, and none is at the toe.

    Parameters
    ----------
    toe : float
        Drawn position. [m]
    bearers : (n,) array of float
        Positions of the bearers. [m]
    nodes : (m,) array of float
        Nodes of the grid; the blade begins at one of them. [m]

    Returns
    -------
    float
        [m]

    Examples
    --------
    >>> bearers, nodes = np.array([2.4, 3.0, 3.6]), np.linspace(2.0, 4.0, 21)
    >>> [round(clear_of_bearers(toe, bearers, nodes), 2) for toe in (2.42, 2.61, 2.83, 3.0)]
    [2.5, 2.6, 2.7, 3.1]
    """
    distance = nodes[:, None] - bearers
    is_clear = ~np.any((distance > -FIRST_CHAIR - 0.01) & (distance < BESIDE_SUPPORT), axis=1)
    clear = nodes[is_clear]
    return float(clear[np.argmin(np.abs(clear - toe))])


def draw_switch(rng: np.random.Generator, bearers: np.ndarray, grid: Grid) -> tuple[Switch, Switch]:
    """Switch with its heel and the change of the wheels near the sensors, which lie from 2 to 9 m.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    bearers : (n,) array of float
        Positions of the bearers. [m]
    grid : Grid
        Grid of the stock rail; the blade begins at one of its nodes.

    Returns
    -------
    (Switch, Switch)
        True and nominal switch.
    """
    heel, length = float(rng.uniform(7.2, 8.0)), float(rng.uniform(2.2, 3.0))
    nodes = grid.start + grid.step * np.arange(grid.n)
    toe = clear_of_bearers(heel - float(rng.uniform(4.6, 5.8)), bearers, nodes)
    chair, damping = float(rng.uniform(2e8, 4e8)), float(rng.uniform(1.5e4, 3.5e4))
    true = Switch(
        toe, heel, float(rng.uniform(12e-3, 18e-3)), length, toe + float(rng.uniform(0.3, 0.8)),
        float(rng.uniform(9e-3, 14e-3)), float(rng.uniform(4.0, 5.0)), chair, damping,
    )  # fmt: skip

    def perturb(value: float, spread_: float) -> float:
        return value * float(np.exp(spread_ * rng.normal()))

    nominal = Switch(
        toe, heel, perturb(true.depth, 0.1), perturb(length, 0.05), true.fall_start + 0.05 * float(rng.normal()),
        perturb(true.fall, 0.1), true.fall_length, perturb(chair, 0.15), perturb(damping, 0.3),
    )  # fmt: skip
    return true, replace(nominal, toe=toe + TOE_ERROR * float(np.clip(rng.normal(), -3.0, 3.0)))


def add_switch(rng: np.random.Generator, world: World, switch: Switch, trains: Mapping[str, Train]) -> None:
    """Add the blade to the world.

    Parameters
    ----------
    rng : Generator
        Source of the random numbers.
    world : World
        World that is changed.
    switch : Switch
        True switch.
    trains : mapping
        Trains by name.
    """
    supports = np.flatnonzero(world.position > switch.toe + FIRST_CHAIR)
    n = supports.size
    gap = np.where(world.position[supports] < switch.heel, 0.0, -1.0)
    stiffness = switch.chair * np.exp(0.08 * rng.normal(size=n))
    damping = switch.chair_damping * np.exp(0.15 * rng.normal(size=n))
    world.blade = TrueBlade(switch, supports, stiffness, damping, gap)
    for train in trains.values():
        for axle in range(1, train.axles().size + 1):
            factor = float(np.exp(WHEEL_DEPTH_SPREAD * rng.normal()))
            world.blade.wheels[train.name, axle] = factor, WHEEL_SHIFT * float(rng.normal())
