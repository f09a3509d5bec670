"""Describe trains as rows of vehicles with their axles: the templates that an axle pattern is compared with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


MAX_VEHICLE_LENGTH = 500.0  # m, of a unit of a train; a longer one is in millimetres


@dataclass(frozen=True)
class Vehicle:
    """``length`` over couplers and the position of each axle behind the front coupler. [m]"""

    name: str
    length: float
    axles: tuple[float, ...]

    def __post_init__(self) -> None:
        if not 0.0 < self.length <= MAX_VEHICLE_LENGTH:
            limits = f"above 0 and up to {MAX_VEHICLE_LENGTH:g} m"
            raise ValueError(f"vehicle {self.name}: a length of {self.length:g} m; one unit of a train has {limits}")
        if not self.axles or sorted(self.axles) != list(self.axles):
            raise ValueError(f"vehicle {self.name}: axles must be in order, got {self.axles}")
        if self.axles[0] < 0 or self.axles[-1] > self.length:
            raise ValueError(f"vehicle {self.name}: axles {self.axles} reach beyond its length {self.length}")

    @property
    def rear(self) -> float:
        """Rear overhang. [m]"""
        return self.length - self.axles[-1]

    def reverse(self) -> Vehicle:
        """The vehicle in the other direction; itself where it is symmetric to a millimetre.

        Returns
        -------
        Vehicle
            With its axles counted from the other end.
        """
        axles = tuple(round(self.length - x, 4) for x in reversed(self.axles))
        if np.allclose(axles, self.axles, atol=1e-3):
            return self
        name = self.name.removesuffix("'") if self.name.endswith("'") else self.name + "'"
        return Vehicle(name, self.length, axles)

    @classmethod
    def of(cls, name: str, values: Mapping) -> Vehicle:
        """From a mapping: ``length`` with ``axles``, or ``length``, ``pivots`` and ``wheelbase`` of two bogies.

        Parameters
        ----------
        name : str
            Name of the vehicle.
        values : mapping
            ``length`` over couplers and the axles. [m]

        Returns
        -------
        Vehicle
            The vehicle as described.

        Raises
        ------
        ValueError
            Axles out of order or beyond the length.

        Examples
        --------
        >>> Vehicle.of("coach", {"length": 26.4, "pivots": 19.0, "wheelbase": 2.5}).axles
        (2.45, 4.95, 21.45, 23.95)
        """
        length = float(values["length"])
        if "axles" in values:
            return cls(name, length, tuple(float(x) for x in values["axles"]))
        pivots, base = float(values["pivots"]), float(values["wheelbase"])
        front = (length - pivots - base) / 2
        return cls(name, length, tuple(round(front + x, 4) for x in (0.0, base, pivots, pivots + base)))


@dataclass(frozen=True)
class Group:
    """``minimum`` to ``maximum`` vehicles in a row, each one of ``vehicles``."""

    vehicles: tuple[Vehicle, ...]
    minimum: int = 1
    maximum: int = 1


@dataclass(frozen=True)
class Pattern:
    """One composition of a ``type`` of train: groups one after the other, front first."""

    type: str
    groups: tuple[Group, ...]

    def reverse(self) -> Pattern:
        """The same train in the other direction.

        Returns
        -------
        Pattern
            Groups and vehicles in reverse order.
        """
        groups = tuple(
            Group(tuple(v.reverse() for v in g.vehicles), g.minimum, g.maximum) for g in reversed(self.groups)
        )
        return Pattern(self.type, groups)

    def fixed_row(self) -> tuple[float, tuple[Vehicle, ...], float] | None:
        """(0.0, vehicles, 0.0) where the pattern has one composition only, else None.

        Returns
        -------
        (float, tuple of Vehicle, float) or None
            Cost 0, the row, and logarithm 0 of its number of choices, as ``closest_row`` has them. [nat]
        """
        if any(len(g.vehicles) > 1 or g.minimum != g.maximum for g in self.groups):
            return None
        return 0.0, tuple(v for g in self.groups for v in g.vehicles * g.minimum), 0.0

    def next_vehicles(self, g: int, count: int) -> Iterator[tuple[int, int]]:
        """(group, vehicles used of it) of each possible next vehicle behind ``count`` vehicles of group ``g``.

        Parameters
        ----------
        g : int
            Index of the group.
        count : int
            Vehicles of this group so far.

        Yields
        ------
        (int, int)
            Index of the group and the number of its vehicles with the next one.
        """
        if count < self.groups[g].maximum:
            yield g, count + 1
        if count >= self.groups[g].minimum:
            for later in range(g + 1, len(self.groups)):
                yield later, 1
                if self.groups[later].minimum > 0:
                    return

    def can_end(self, g: int, count: int) -> bool:
        """Whether the train can end behind ``count`` vehicles of group ``g``.

        Parameters
        ----------
        g : int
            Index of the group.
        count : int
            Vehicles of this group so far.

        Returns
        -------
        bool
            True where no further vehicle is required.
        """
        return count >= self.groups[g].minimum and all(group.minimum == 0 for group in self.groups[g + 1 :])

    def lengths(self) -> tuple[float, float]:
        """Smallest and largest length over couplers. [m]

        Returns
        -------
        low, high : float
            Smallest and largest length. [m]
        """
        lengths = [[v.length for v in g.vehicles] for g in self.groups]
        low = sum(min(x) * g.minimum for x, g in zip(lengths, self.groups))
        return low, sum(max(x) * g.maximum for x, g in zip(lengths, self.groups))

    def axle_counts(self) -> tuple[int, int]:
        """Smallest and largest number of axles.

        Returns
        -------
        low, high : int
            Smallest and largest number.
        """
        return self._axle_counts

    @cached_property
    def spacings(self) -> dict[str, list[float]]:
        """Vehicle's name -> distances between its own axles. [m]"""
        return {v.name: np.diff(v.axles).tolist() for g in self.groups for v in g.vehicles}

    @cached_property
    def log_n_choices(self) -> list[float]:
        """Logarithm of the number of vehicles that each group offers."""
        return [float(np.log(len(g.vehicles))) for g in self.groups]

    @cached_property
    def _axle_counts(self) -> tuple[int, int]:
        counts = [[len(v.axles) for v in g.vehicles] for g in self.groups]
        low = sum(min(c) * g.minimum for c, g in zip(counts, self.groups))
        return low, sum(max(c) * g.maximum for c, g in zip(counts, self.groups))


def offsets(vehicles: Sequence[Vehicle]) -> np.ndarray:
    """(n_axle,) metres behind the first axle of a row of vehicles.

    Parameters
    ----------
    vehicles : sequence of Vehicle
        The row, front first.

    Returns
    -------
    (n_axle,) array of float
        Distance of each axle behind the first. [m]

    Examples
    --------
    >>> wagon = Vehicle("wagon", 10.0, (2.0, 8.0))
    >>> offsets([wagon, wagon]).tolist()
    [0.0, 6.0, 10.0, 16.0]
    """
    front = np.concatenate([[0.0], np.cumsum([v.length for v in vehicles])])
    positions = np.concatenate([start + np.asarray(v.axles) for start, v in zip(front, vehicles)])
    return positions - positions[0]


def read_patterns(document: Mapping) -> tuple[Pattern, ...]:
    """Patterns of all train types of a document with ``vehicles`` and ``trains``, in both directions.

    A train is ``units``: a list whose items name a vehicle, or give ``any: [names]`` with ``count: [least, most]``.
    A name ending in ``'`` is the reversed vehicle. ``coupled`` is the largest number of whole units in a train.
    ``type`` is the train type where that is not the train's own name. KeyError names a vehicle that is not described.

    Parameters
    ----------
    document : mapping
        ``vehicles`` and ``trains``, as read from YAML.

    Returns
    -------
    tuple of Pattern
        Every composition of every type.

    Raises
    ------
    KeyError
        A train names a vehicle that is not described; the message names both.
    ValueError
        Axles of a vehicle out of order or beyond its length; a length, a count or a number of coupled units that no
        train has; a text in place of a number. The message names the vehicle or the train.
    """
    vehicles = {name: _vehicle(name, values) for name, values in document["vehicles"].items()}
    patterns: list[Pattern] = []
    for name, values in document["trains"].items():
        type_ = values.get("type", name)
        groups = tuple(_group(item, vehicles, name) for item in values["units"])
        reversed_groups = Pattern(type_, groups).reverse().groups
        for n in range(1, _count(values.get("coupled", 1), 1, f"train {name}: coupled") + 1):
            compositions = {Pattern(type_, groups * n), Pattern(type_, reversed_groups * n)}
            if values.get("mixed", False) and n == 2:
                compositions |= {Pattern(type_, groups + reversed_groups), Pattern(type_, reversed_groups + groups)}
            patterns += sorted(compositions, key=repr)
    return tuple(patterns)


def _group(item: str | Mapping, vehicles: Mapping[str, Vehicle], type_: str) -> Group:
    if isinstance(item, str):
        item = {"any": [item]}
    names = item["any"] if isinstance(item["any"], list) else [item["any"]]
    choices = []
    for name in names:
        base = str(name).removesuffix("'")
        if base not in vehicles:
            raise KeyError(f"train {type_}: no vehicle {base!r}; there are {sorted(vehicles)}")
        choices.append(vehicles[base].reverse() if str(name).endswith("'") else vehicles[base])
    minimum, maximum = item.get("count", (1, 1))
    least = _count(minimum, 0, f"train {type_}: count")
    return Group(tuple(choices), least, _count(maximum, max(least, 1), f"train {type_}: the second count"))


def _vehicle(name: str, values: Mapping) -> Vehicle:
    """The vehicle ``name``; ValueError names it also where a value is no number."""
    try:
        return Vehicle.of(name, values)
    except (KeyError, TypeError) as error:
        what = f"{error} is missing" if isinstance(error, KeyError) else "length and axles [m] are missing"
        raise ValueError(f"vehicle {name}: {what}") from None
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith("vehicle") else f"vehicle {name}: {text}") from None


def _count(value: Any, least: int, what: str) -> int:
    """A whole number of at least ``least``; ValueError otherwise."""
    if not isinstance(value, int) or isinstance(value, bool) or value < least:
        raise ValueError(f"{what} is {value!r}, not a whole number of at least {least}")
    return value
