"""Inputs of the time integration: rail, supports, attached masses, cars, wheels, their motion, and the hammer."""

from typing import NamedTuple

import numpy as np


class Beam(NamedTuple):
    """Rail on its grid of ``step`` [m]: constants, or arrays where its section changes.

    ``bending`` [N m²] and ``mass`` [kg/m] belong to nodes, (n_node,). ``shear`` [N] and ``rotary`` [kg m] belong to the
    intervals between them, (n_node - 1,). ``rate`` (n_node,) and ``rate_between`` (n_node - 1,) [1/s] are damping rates
    of the nodes and of the rotations between them.
    """

    step: float
    bending: float | np.ndarray
    shear: float | np.ndarray
    mass: float | np.ndarray
    rotary: float | np.ndarray
    rate: np.ndarray
    rate_between: np.ndarray


class Supports(NamedTuple):
    """Supports, arrays (n_support,) unless noted.

    ``first`` and ``weights`` (n_support, 4) are their nodes on the grid. Stiffnesses in N/m, dampings in N s/m,
    ``mass`` of the sleepers [kg]. ``lift``: pad stiffness in uplift over that in compression. ``gap`` [m] under the
    sleeper; below 0 there is none and the ballast acts in both directions. ``seated``: share of the bed without a gap.
    ``close`` [m]: compression over which the gap closes. ``hardening`` [1/m] and ``drift`` [1/s] of the ballast
    stiffness. ``shear`` and ``shear_damping`` act between neighbouring sleepers. ``branch_share`` (of the pad
    stiffness) and ``branch_rate`` [1/s], (n_branch,) each, describe Maxwell elements.
    """

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


class Blade(NamedTuple):
    """Second rail from node ``start`` of the grid on, its first node free; no values: none.

    ``bending``, ``mass`` and ``rate`` belong to its nodes, (n_node,). ``shear``, ``rotary`` and ``rate_between`` belong
    to the intervals between them, (n_node - 1,). Units as of ``Beam``. Chairs have arrays (n_chair,): ``first`` and
    ``weights`` (n_chair, 4) are the nodes above them, ``support`` their supports, ``stiffness`` [N/m] and ``damping``
    [N s/m]. A ``gap`` [m] below 0 is a fastening; others press only, with a preload ``load`` [N] if closed. Wheels
    change to it between ``change_start`` and ``change_end`` [m].
    """

    start: int
    bending: np.ndarray
    shear: np.ndarray
    mass: np.ndarray
    rotary: np.ndarray
    rate: np.ndarray
    rate_between: np.ndarray
    first: np.ndarray
    weights: np.ndarray
    support: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    gap: np.ndarray
    load: np.ndarray
    change_start: float
    change_end: float


def no_blade() -> Blade:
    """Inputs of the march without a second rail."""
    none = np.zeros(0)
    index = np.zeros(0, dtype=np.int64)
    weights = np.zeros((0, 4))
    return Blade(
        0, none, none, none, none, none, none, index, weights, index, none, none, none, none, 0.0, 0.0
    )  # fmt: skip


class AttachedMasses(NamedTuple):
    """Masses attached to the rail by a spring, with stops of stiffness ``stop`` at ``play`` [m] on both sides.

    Arrays (n_mass,): ``mass`` [kg], ``stiffness`` and ``stop`` [N/m], ``damping`` [N s/m]. ``first`` and ``weights``
    (n_mass, 4) are their nodes on the grid.
    """

    first: np.ndarray
    weights: np.ndarray
    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    play: np.ndarray
    stop: np.ndarray


class Cars(NamedTuple):
    """Cars for one rail, arrays (n_car,): body, two bogies, four wheels.

    Masses [kg], inertias [kg m²], stiffness [N/m] and damping [N s/m] of the suspension at one wheel or bogie, half
    distances [m] of the wheels of a bogie and of its pivots.
    """

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
    """Wheels, arrays (4 n_car,): ``mass`` [kg], static ``load`` [N], distance behind the first [m].

    ``path`` (4 n_car, m) is the surface under each wheel [m], from ``path_start`` in steps of ``path_step`` [m],
    ``blade_path`` (4 n_car, m) that of a second rail. ``stiffness`` is the Hertz constant [N/m^1.5], ``local`` a
    compliance of the rail [m/N].
    """

    mass: np.ndarray
    load: np.ndarray
    distance_behind: np.ndarray
    stiffness: np.ndarray
    local: float
    path: np.ndarray
    path_start: float
    path_step: float
    blade_path: np.ndarray


class WheelMotion(NamedTuple):
    """Position of the first wheel at time 0 [m] and speed [m/s].

    A wheel engages the rail gradually from ``engage_start`` to ``engage_end`` and releases it from ``release_start`` to
    ``release_end`` [m].
    """

    start: float
    speed: float
    engage_start: float
    engage_end: float
    release_start: float
    release_end: float


class Hammer(NamedTuple):
    """Hammer of ``mass`` [kg], 0 for none, with tip force k d^1.5 (1 + loss d').

    ``velocities`` [m/s] and ``times`` [s] of its impacts, (n_impact,) each. ``first`` and ``weights`` (4,) are its
    nodes on the grid, ``tip`` is k [N/m^1.5], ``loss`` [s/m].
    """

    first: int
    weights: np.ndarray
    mass: float
    tip: float
    loss: float
    times: np.ndarray
    velocities: np.ndarray
