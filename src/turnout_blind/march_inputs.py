"""What the march is given: rail, supports, what hangs on them, what rolls over them, and blows."""

from typing import NamedTuple

import numpy as np


class Beam(NamedTuple):
    """Rail on its grid: constants, or arrays where its profile changes (``bending`` and ``mass`` of nodes, ``shear``
    and ``rotary`` of what lies between), and damping rates of nodes and of the rotations between them [1/s]."""

    step: float
    bending: object
    shear: object
    mass: object
    rotary: object
    rate: np.ndarray
    rate_between: np.ndarray


class Supports(NamedTuple):
    """(n,) each; ``first`` and ``weights`` (n, 4) on the grid. ``lift`` pad stiffness in uplift over that in
    compression, ``gap`` [m] under the sleeper (below 0: none, ballast holds both ways), ``seated`` share of its bed
    that has no gap, ``close`` [m] over which the gap closes, ``hardening`` [1/m], ``drift`` [1/s] of ballast
    stiffness; ``shear`` and ``shear_damping`` to the next sleeper; branches: share of pad stiffness and rate [1/s] of
    Maxwell elements."""

    first: np.ndarray
    weights: np.ndarray
    pad: np.ndarray
    pad_damping: np.ndarray
    lift: np.ndarray
    mass: np.ndarray
    ballast: np.ndarray
    ballast_damping: np.ndarray
    gap: np.ndarray
    seated: np.ndarray
    close: np.ndarray
    hardening: np.ndarray
    drift: np.ndarray
    shear: np.ndarray
    shear_damping: np.ndarray
    branch_share: np.ndarray
    branch_rate: np.ndarray


class Riders(NamedTuple):
    """Masses hung on the rail by a spring, with stops ``play`` [m] away on both sides of stiffness ``stop``."""

    first: np.ndarray
    weights: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    play: np.ndarray
    stop: np.ndarray


class Cars(NamedTuple):
    """(n,) per car, for one rail: body, two bogies, four wheels; masses [kg], inertias [kg m²], suspension."""

    body: np.ndarray
    body_inertia: np.ndarray
    bogie: np.ndarray
    bogie_inertia: np.ndarray
    primary: np.ndarray
    primary_damping: np.ndarray
    secondary: np.ndarray
    secondary_damping: np.ndarray
    half_base: np.ndarray
    half_pivot: np.ndarray


class Wheels(NamedTuple):
    """(4 n_car,) mass, static load [N], place behind the first [m]; ``path`` (n, m) under each from ``path_start``
    on, ``path_step`` apart [m]; ``stiffness`` of Hertz [N/m^1.5], ``local`` compliance of the rail [m/N]."""

    mass: np.ndarray
    load: np.ndarray
    behind: np.ndarray
    stiffness: np.ndarray
    local: float
    path: np.ndarray
    path_start: float
    path_step: float


class Roll(NamedTuple):
    """Place of the first wheel at time 0 [m], speed [m/s]; wheels take hold of the rail between two places [m]."""

    start: float
    speed: float
    hold: float
    held: float
    leave: float
    left: float


class Blow(NamedTuple):
    """Hammer: ``mass`` 0 for none; ``velocities`` and ``times`` of its blows, tip k d^1.5 (1 + loss d')."""

    first: int
    weights: np.ndarray
    mass: float
    tip: float
    loss: float
    times: np.ndarray
    velocities: np.ndarray
