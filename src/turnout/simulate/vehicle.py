"""Vehicle models: car bodies and bogies with bounce and pitch, wheels with bounce, springs and dampers between them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import GRAVITY
from turnout.errors import SimulationError
from turnout.simulate.force_laws import ForceLaw, PowerLaw
from turnout.simulate.number_checks import check_number

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

HERTZ = PowerLaw(93e9)
WHEEL_FIELDS = ("contact", "radius", "pressing")  # fields that may differ between the wheels of a train


@dataclass(frozen=True)
class Suspension:
    """A spring and damper from body ``upper`` at ``lever`` [m] behind its centre down to body ``lower``."""

    upper: int
    lower: int
    lever: float
    stiffness: float
    damping: float
    lower_lever: float = 0.0


@dataclass(frozen=True)
class Body:
    """``mass`` [kg]; pitch ``inertia`` [kg m²], None for a wheel; centre ``position`` [m] behind the front axle."""

    name: str
    mass: float
    inertia: float | None
    position: float


@dataclass(frozen=True)
class Vehicle:
    """Half a train (one rail). ``wheels`` are the bodies that touch the rail, front first.

    ``contact`` is the law of a wheel's contact with any rail surface it can touch (a crossing's wing and nose),
    ``radius`` of the wheels [m] and ``pressing`` [N] a massless force on each: one value for all wheels or a tuple with
    one for each. ``extra_links`` holds (ends, k, c, m) with ends pairs of a row and a weight.
    ``length`` over buffers and ``overhang`` from the front end to the first wheel [m], for coupling.

    Errors: SimulationError where a mass is not above 0, a spring negative or a body without support.
    """

    name: str
    bodies: tuple[Body, ...]
    suspensions: tuple[Suspension, ...]
    wheels: tuple[int, ...]
    contact: ForceLaw | tuple[ForceLaw, ...] = HERTZ
    radius: float | tuple[float, ...] = 0.43
    gravity: float = GRAVITY
    extra_links: tuple = ()
    pressing: float | tuple[float, ...] = 0.0
    length: float = 0.0
    overhang: float = 0.0
    conditions: dict = field(default_factory=dict)

    def __repr__(self) -> str:
        length = f"{self.wheel_positions[-1]:.1f} m from the first to the last axle"
        return f"Vehicle({self.name}: {len(self.wheels)} axles, {len(self.bodies)} bodies, {length})"

    def __post_init__(self) -> None:
        for body in self.bodies:
            if not 0.0 < body.mass < np.inf or (body.inertia is not None and not 0.0 < body.inertia < np.inf):
                raise SimulationError(
                    f"{self.name}: body {body.name!r} has mass {body.mass!r}, inertia {body.inertia!r}."
                )
        check_number(f"{self.name}: gravity", self.gravity, "m/s²")
        for s in self.suspensions:
            if not (s.stiffness >= 0.0 and s.damping >= 0.0):
                name = self.bodies[s.upper].name
                raise SimulationError(
                    f"{self.name}: suspension of {name!r} has {s.stiffness!r} N/m, {s.damping!r} N s/m."
                )
        positions = self.wheel_positions
        if not len(positions) or np.any(np.diff(positions) <= 0.0):
            stated = ", ".join(f"{x:g}" for x in positions) or "not given"
            raise SimulationError(f"{self.name}: wheels must follow each other, their positions [m] are {stated}.")
        for quantity in WHEEL_FIELDS:
            value = getattr(self, quantity)
            if isinstance(value, tuple) and len(value) != len(positions):
                raise SimulationError(
                    f"{self.name}: {quantity} of {len(value)} wheels, the train has {len(positions)}."
                )
        for wheel, force in enumerate(self.wheel_values("pressing")):
            check_number(f"{self.name}: pressing of wheel {wheel}", force, "N")
        for wheel, radius in enumerate(self.wheel_values("radius")):
            check_number(f"{self.name}: radius of wheel {wheel}", radius, "m", above=0.0)

    @cached_property
    def row(self) -> np.ndarray:
        """Row of the bounce of each body; its pitch, if it has one, is the next row."""
        sizes = [1 if body.inertia is None else 2 for body in self.bodies]
        return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    @property
    def n(self) -> int:
        """Degrees of freedom."""
        return int(self.row[-1])

    @property
    def wheel_rows(self) -> np.ndarray:
        """Row of each wheel, (n_wheel,)."""
        return self.row[list(self.wheels)]

    @property
    def wheel_positions(self) -> np.ndarray:
        """Distance of each wheel behind the front one [m], (n_wheel,)."""
        return np.array([self.bodies[i].position for i in self.wheels])

    def wheel_values(self, quantity: str) -> tuple[Any, ...]:
        """``contact``, ``radius`` or ``pressing`` of every wheel.

        Parameters
        ----------
        quantity : str
            Name of the field, one of ``WHEEL_FIELDS``.

        Returns
        -------
        tuple
            One value for each wheel.
        """
        value = getattr(self, quantity)
        return value if isinstance(value, tuple) else (value,) * len(self.wheels)

    @cached_property
    def matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Mass, damping, stiffness (n, n) and weight (n,) [N] downwards."""
        mass, damping, stiffness = (np.zeros((self.n, self.n)) for _ in range(3))
        weight = np.zeros(self.n)
        for body, row in zip(self.bodies, self.row):
            mass[row, row], weight[row] = body.mass, self.gravity * body.mass
            if body.inertia is not None:
                mass[row + 1, row + 1] = body.inertia
        weight[self.wheel_rows] += self.wheel_values("pressing")
        for s in self.suspensions:
            ends = self._ends(s.upper, s.lever, 1.0) + self._ends(s.lower, s.lower_lever, -1.0)
            _add(stiffness, ends, s.stiffness)
            _add(damping, ends, s.damping)
        for ends, k, c, m in self.extra_links:
            for matrix, value in ((stiffness, k), (damping, c), (mass, m)):
                _add(matrix, ends, value)
        return mass, damping, stiffness, weight

    def _ends(self, body: int, lever: float, sign: float) -> list[tuple[int, float]]:
        row = self.row[body]
        ends = [(row, sign)]
        if self.bodies[body].inertia is not None and lever:
            ends.append((row + 1, sign * lever))
        return ends

    @cached_property
    def static_loads(self) -> np.ndarray:
        """Force of each wheel on a level rigid rail [N], (n_wheel,)."""
        _, _, stiffness, weight = self.matrices
        wheels = self.wheel_rows
        sprung = np.setdiff1d(np.arange(self.n), wheels)
        if not sprung.size:
            return weight[wheels].copy()
        if np.linalg.matrix_rank(stiffness[np.ix_(sprung, sprung)]) < sprung.size:
            raise SimulationError(f"{self.name}: a body rests on nothing, its stiffness matrix is singular.")
        z = np.linalg.solve(stiffness[np.ix_(sprung, sprung)], weight[sprung])
        return weight[wheels] - stiffness[np.ix_(wheels, sprung)] @ z

    @cached_property
    def blocks(self) -> np.ndarray:
        """First row of each group of coupled rows, with the end; rows of a group follow each other."""
        _, damping, stiffness, _ = self.matrices
        mass = self.matrices[0]
        coupled = (stiffness != 0.0) | (damping != 0.0) | (mass != 0.0)
        starts, reach = [0], 0
        for i in range(self.n):
            if i > reach:
                starts.append(i)
            reach = max(reach, i, int(np.flatnonzero(coupled[i]).max(initial=i)))
        return np.array([*starts, self.n], dtype=np.int64)

    def with_(self, **changes: Any) -> Vehicle:
        """The same vehicle with some fields changed.

        Parameters
        ----------
        **changes : Any
            New values by name of the field.

        Returns
        -------
        Vehicle
            A copy, checked like a new vehicle.

        Raises
        ------
        SimulationError
            If the changed values are not those of a vehicle.
        """
        return replace(self, **changes)

    def reverse(self) -> Vehicle:
        """The same vehicle in the opposite direction, its last wheel first."""
        last = float(self.wheel_positions[-1])
        pitch = {int(r) + 1 for r, b in zip(self.row, self.bodies) if b.inertia is not None}
        links = tuple(
            (tuple((r, -w if r in pitch else w) for r, w in ends), *values) for ends, *values in self.extra_links
        )
        return self.with_(
            bodies=tuple(replace(b, position=last - b.position) for b in self.bodies),
            suspensions=tuple(replace(s, lever=-s.lever, lower_lever=-s.lower_lever) for s in self.suspensions),
            wheels=self.wheels[::-1], extra_links=links,
            **{name: self.wheel_values(name)[::-1] for name in WHEEL_FIELDS if isinstance(getattr(self, name), tuple)},
            overhang=self.length - last - self.overhang if self.length else self.overhang,
        )  # fmt: skip


def one_or_all(values: Sequence[Any]) -> Any:
    """The common value of all wheels, or the tuple of their ``values`` if they differ.

    Parameters
    ----------
    values : sequence
        Value of each wheel.

    Returns
    -------
    object
        A single value, or a tuple with one for each wheel.
    """
    return values[0] if all(value == values[0] for value in values) else tuple(values)


def _add(matrix: np.ndarray, ends: Iterable[tuple[int, float]], value: float) -> None:
    for a, wa in ends:
        for b, wb in ends:
            matrix[a, b] += value * wa * wb


def car(
    name: str = "car",
    body_mass: float = 16000.0,
    body_inertia: float = 9e5,
    bogie_mass: float = 1500.0,
    bogie_inertia: float = 1500.0,
    wheel_mass: float = 750.0,
    primary: tuple[float, float] = (0.6e6, 6e3),
    secondary: tuple[float, float] = (0.25e6, 12e3),
    half_base: float = 1.25,
    half_pivot: float = 8.85,
    **more: Any,
) -> Vehicle:
    """Half a four-axle car of 10 degrees of freedom; the default load of each wheel is 53.96 kN.

    Parameters
    ----------
    name : str
        Name of the vehicle.
    body_mass : float
        Mass of half the body. [kg]
    body_inertia : float
        Pitch inertia of half the body. [kg m²]
    bogie_mass : float
        Mass of half a bogie frame. [kg]
    bogie_inertia : float
        Pitch inertia of half a bogie frame. [kg m²]
    wheel_mass : float
        Mass of half a wheelset. [kg]
    primary : (float, float)
        Stiffness [N/m] and damping [N s/m] between wheel and bogie.
    secondary : (float, float)
        Stiffness [N/m] and damping [N s/m] between bogie and body.
    half_base : float
        Half the wheelbase of a bogie. [m]
    half_pivot : float
        Half the distance of the bogie centres. [m]
    **more : Any
        Further fields of ``Vehicle``.

    Returns
    -------
    Vehicle
        Car with wheels at 0, 2 ``half_base``, 2 ``half_pivot`` and 2 (``half_base`` + ``half_pivot``) behind the front
        axle.

    Examples
    --------
    >>> [f"{load / 1e3:.2f} kN" for load in car().static_loads]
    ['53.95 kN', '53.95 kN', '53.95 kN', '53.95 kN']
    """
    centre = half_pivot + half_base
    bodies = [Body("body", body_mass, body_inertia, centre)]
    suspensions = []
    for side in (-1.0, 1.0):
        bogie = len(bodies)
        position = centre + side * half_pivot
        bodies.append(Body(f"bogie {bogie}", bogie_mass, bogie_inertia, position))
        suspensions.append(Suspension(0, bogie, side * half_pivot, *secondary))
        for axle in (-1.0, 1.0):
            suspensions.append(Suspension(bogie, len(bodies), axle * half_base, *primary))
            bodies.append(Body(f"wheel {len(bodies)}", wheel_mass, None, position + axle * half_base))
    return Vehicle(name, tuple(bodies), tuple(suspensions), (2, 3, 5, 6), **more)


def lone_wheels(mass: float, positions: Sequence[float] = (0.0,), **more: Any) -> Vehicle:
    """Wheels without suspension.

    Parameters
    ----------
    mass : float
        Mass of each wheel. [kg]
    positions : sequence of float
        Position of each wheel behind the first, increasing. [m]
    **more : Any
        Further fields of ``Vehicle``.

    Returns
    -------
    Vehicle
        Vehicle with one body for each wheel.
    """
    bodies = tuple(Body(f"wheel {k}", mass, None, position) for k, position in enumerate(positions))
    return Vehicle("wheels", bodies, (), tuple(range(len(bodies))), **more)
