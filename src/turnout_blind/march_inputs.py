"""Inputs of the time integration: rail, supports, attached masses, cars, wheels, their motion, and the hammer."""

from typing import NamedTuple

import numpy as np


class Beam(NamedTuple):
    """Rail on its grid: constants, or arrays where its section changes.

    ``bending`` and ``mass`` belong to nodes, ``shear`` and ``rotary`` to the intervals between them. ``rate`` and
    ``rate_between`` [1/s] are damping rates of the nodes and of the rotations between them.
    """

    step: float
    bending: float | np.ndarray
    shear: float | np.ndarray
    mass: float | np.ndarray
    rotary: float | np.ndarray
    rate: np.ndarray
    rate_between: np.ndarray


class Supports(NamedTuple):
    """Supports, (n,) each; ``first`` and ``weights`` (n, 4) are their nodes on the grid.

    ``lift``: pad stiffness in uplift over that in compression. ``gap`` [m] under the sleeper; below 0 there is none and
    the ballast acts in both directions. ``seated``: share of the bed without a gap. ``close`` [m]: compression over
    which the gap closes. ``hardening`` [1/m] and ``drift`` [1/s] of the ballast stiffness. ``shear`` and
    ``shear_damping`` act between neighbouring sleepers. ``branch_share`` (of the pad stiffness) and ``branch_rate``
    [1/s] describe Maxwell elements.
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

    ``bending`` and ``mass`` belong to its nodes, ``shear`` and ``rotary`` to the intervals between them, as the rates.
    ``first`` and ``weights`` (n, 4) are the nodes above the chairs, ``support`` their supports. A ``gap`` [m] below 0
    is a fastening; others press only, with a preload ``load`` [N] if they are closed. Wheels change to it between
    ``change_start`` and ``change_end`` [m].
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
    """Masses attached to the rail by a spring, with stops of stiffness ``stop`` at ``play`` [m] on both sides."""

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
    """(4 n_car,) mass, static load [N] and distance behind the first wheel [m].

    ``path`` (n, m) is the surface under each wheel, from ``path_start`` in steps of ``path_step`` [m],
    ``blade_path`` that of a second rail. ``stiffness`` is
    the Hertz constant [N/m^1.5], ``local`` a compliance of the rail [m/N].
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
    """Hammer with ``velocities`` and ``times`` of its impacts and tip force k d^1.5 (1 + loss d'). ``mass`` 0: none."""

    first: int
    weights: np.ndarray
    mass: float
    tip: float
    loss: float
    times: np.ndarray
    velocities: np.ndarray
