"""Model of a track: one rail on supports, each with its own pad, sleeper and ballast."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.blade import Blade
from turnout.simulate.links import Link
from turnout.simulate.number_checks import check_count, check_number
from turnout.simulate.rail import Rail, in_series

NOT_NEGATIVE = (
    "pad_stiffness",
    "pad_damping",
    "sleeper_mass",
    "ballast_stiffness",
    "ballast_damping",
    "ballast_mass",
    "subgrade_stiffness",
    "subgrade_damping",
    "pad_loss_factor",
    "ballast_loss_factor",
)
PER_SUPPORT = (*NOT_NEGATIVE, "bay_shear_stiffness", "bay_shear_damping")


@dataclass(frozen=True)
class RailStretch:
    """Another rail profile between ``start`` and ``end`` [m]: crossing body, switch blade, fishplate joint."""

    start: float
    end: float
    rail: Rail

    def __post_init__(self) -> None:
        check_number("rail stretch: start", self.start, "m")
        check_number(f"rail stretch from {self.start:g} m: end", self.end, "m", above=self.start)


NODE_TOLERANCE = 1e-6  # m from a node within which an end is on it
# One number is the value of all supports; it becomes an array when the track is created.
ZERO: Any = 0.0


@dataclass(frozen=True)
class Track:
    """Half a track (one rail, half sleepers), everything per support.

    ``support`` (n,) positions of the supports [m], increasing. Per support, (n,) or one number for all:
    ``pad_stiffness`` [N/m], ``pad_damping`` [N s/m], ``sleeper_mass`` of half a sleeper [kg],
    ``ballast_stiffness``, ``ballast_damping``; with ``layers`` 3 also ``ballast_mass`` [kg],
    ``subgrade_stiffness``, ``subgrade_damping`` and the shear between neighbouring ballast masses
    ``bay_shear_stiffness``, ``bay_shear_damping``. Loss factors act in the frequency domain only.
    ``pad_width`` [m] spreads a pad over three nodes; ``layers`` 1 is a rail on pads on rigid ground.
    ``end_length`` [m] and ``end_damping`` [1/s] make both ends absorb. ``section`` (n,) labels.
    ``elements_per_bay`` >= 4 keeps the pinned-pinned resonance within 1 %. ``blade``: that of a switch, a
    second rail on the same supports.
    """

    rail: Rail
    support: np.ndarray
    pad_stiffness: np.ndarray
    pad_damping: np.ndarray
    sleeper_mass: np.ndarray = ZERO
    ballast_stiffness: np.ndarray = ZERO
    ballast_damping: np.ndarray = ZERO
    ballast_mass: np.ndarray = ZERO
    subgrade_stiffness: np.ndarray = ZERO
    subgrade_damping: np.ndarray = ZERO
    bay_shear_stiffness: np.ndarray = ZERO
    bay_shear_damping: np.ndarray = ZERO
    pad_loss_factor: np.ndarray = ZERO
    ballast_loss_factor: np.ndarray = ZERO
    layers: int = 2
    pad_width: float = 0.0
    elements_per_bay: int = 4
    stretches: tuple[RailStretch, ...] = ()
    end_length: float = 0.0
    end_damping: float = 0.0
    section: tuple[str, ...] = ()
    name: str = "track"
    blade: Blade | None = None

    def __repr__(self) -> str:
        n_support, extent = len(self.support), f"{self.support[0]:g} to {self.support[-1]:g} m"
        return f"Track({self.name}: {extent}, {n_support} supports, {self.layers} layers)"

    def __post_init__(self) -> None:
        support = np.array(self.support, dtype=float)
        if support.ndim != 1 or support.size < 3 or not np.all(np.diff(support) > 0.0):
            raise SimulationError(f"{self.name}: needs at least 3 supports at rising positions, got {support!r}.")
        object.__setattr__(self, "support", support)
        self._set_support_values()
        if self.layers not in (1, 2, 3):
            raise SimulationError(f"{self.name}: {self.layers} layers; 1, 2 or 3 are possible.")
        check_count(f"{self.name}: elements_per_bay", self.elements_per_bay)
        check_number(f"{self.name}: end_length", self.end_length, "m", least=0.0)
        check_number(f"{self.name}: end_damping", self.end_damping, "1/s", least=0.0)
        required = {1: (), 2: ("sleeper_mass",), 3: ("sleeper_mass", "ballast_mass")}[self.layers]
        for name in required:
            if np.any(getattr(self, name) <= 0.0):
                raise SimulationError(f"{self.name}: {self.layers} layers need {name} above 0 at every support.")

        self._check_pad_width()
        if self.blade is not None:
            if self.layers == 1:
                raise SimulationError(f"{self.name}: a blade needs sleepers, the track has one layer.")
            self.blade.nodes(self)

    def _check_pad_width(self) -> None:
        """A pad on three nodes is at most 8/3 elements wide: then all three nodes carry the same."""
        element = float(np.min(np.diff(self.support))) / self.elements_per_bay
        if not 0.0 <= self.pad_width <= 8.0 / 3.0 * element:
            raise SimulationError(
                f"{self.name}: pad_width {self.pad_width!r} m is not between 0 and {8.0 / 3.0 * element:.3f} m, what "
                f"three nodes hold that are {element:.3f} m apart; fewer elements per bay hold more."
            )

    def _set_support_values(self) -> None:
        """Give every support its own values, all in one array: they are checked together, a track is made often."""
        n, values = self.support.size, np.empty((len(PER_SUPPORT), self.support.size))
        for row, name in zip(values, PER_SUPPORT):
            value = np.asarray(getattr(self, name), dtype=float)
            if value.ndim and value.shape != (n,):
                raise SimulationError(f"{self.name}: {name} has {value.size} values for {n} supports.")
            row[:] = value
            object.__setattr__(self, name, row)
        if not np.all(np.isfinite(values)):
            k = int(np.argmin(np.all(np.isfinite(values), axis=1)))
            raise SimulationError(f"{self.name}: {PER_SUPPORT[k]} holds {values[k][~np.isfinite(values[k])]!r}.")
        if np.any(negative := values[: len(NOT_NEGATIVE)] < 0.0):
            k, j = np.argwhere(negative)[0]
            value, position = values[k, j], self.support[j]
            raise SimulationError(
                f"{self.name}: {NOT_NEGATIVE[k]} of support {j} at {position:.3f} m is negative: {value:g}."
            )

    @property
    def start(self) -> float:
        """Position of the first node [m]."""
        return float(self.support[0])

    @property
    def end(self) -> float:
        """Position of the last node [m]."""
        return float(self.support[-1])

    def with_(self, **changes: Any) -> Track:
        """The same track with some fields changed.

        Parameters
        ----------
        **changes : Any
            New values by name of the field.

        Returns
        -------
        Track
            A copy, checked like a new track.

        Raises
        ------
        SimulationError
            If the changed values are not those of a track.
        """
        return replace(self, **changes)

    def nearest_support(self, position: float) -> int:
        """Index of the support nearest to ``position`` [m].

        Parameters
        ----------
        position : float
            Position along the track. [m]

        Returns
        -------
        int
            Number of the support, the first of two at the same distance.
        """
        return int(np.argmin(np.abs(self.support - position)))

    def rail_at(self, x: float) -> Rail:
        """Rail profile at ``x`` [m]; if stretches overlap that of the last one.

        Parameters
        ----------
        x : float
            Position along the track. [m]

        Returns
        -------
        Rail
            Profile.
        """
        rails = [stretch.rail for stretch in self.stretches if stretch.start <= x < stretch.end]
        return rails[-1] if rails else self.rail

    def element_rail(self, start: float, end: float) -> Rail:
        """Rail profile of an element from ``start`` to ``end`` [m]; several profiles are combined in series.

        Parameters
        ----------
        start : float
            First node. [m]
        end : float
            Second node. [m]

        Returns
        -------
        Rail
            Profile.
        """
        ends = self._stretch_ends
        inside = ends[bisect_right(ends, start + NODE_TOLERANCE) : bisect_left(ends, end - NODE_TOLERANCE)]
        if not inside:
            return self.rail_at(0.5 * (start + end))
        cuts = [start, *inside, end]
        rails = [self.rail_at(0.5 * (a + b)) for a, b in pairwise(cuts)]
        return in_series(rails, np.diff(cuts) / (end - start))

    @cached_property
    def _stretch_ends(self) -> list[float]:
        """Ends of all stretches, each once, in order. [m]"""
        return sorted({x for s in self.stretches for x in (s.start, s.end)})

    def links(self) -> list[Link]:
        """All springs, dampers and masses of the supports as links, and the chairs of a blade."""
        links = []
        for j in range(self.support.size):
            links.extend(self.support_links(j))
        if self.blade is not None:
            links.extend(self.blade.chair_link(j) for j in self.blade.chairs(self))
        return links

    def pad_link(self, j: int) -> Link:
        """The pad of support ``j``.

        Parameters
        ----------
        j : int
            Number of the support.

        Returns
        -------
        Link
            Between rail and sleeper; with one layer between rail and ground.
        """
        values = self.pad_stiffness[j], self.pad_damping[j], 0.0, self.pad_loss_factor[j]
        return Link(self._pad_ends(j), *values, "pad")

    def _pad_ends(self, j: int) -> tuple:
        ends: tuple = ((("rail", j), 1.0),)
        if self.pad_width and 0 < j < self.support.size - 1:
            before, behind = self._pad_shares(j)
            ends = ((("rail", j, -1), before), (("rail", j), 1.0 - before - behind), (("rail", j, 1), behind))
        return ends if self.layers == 1 else (*ends, (("sleeper", j), -1.0))

    def _pad_shares(self, j: int) -> list[float]:
        """Shares of the nodes before and after support ``j`` in its pad.

        Two points of a uniform pressure over the width b are b/3 apart on average. So are shares a, 1 - 2a, a at
        -h, 0, h with 4 h a (1 - a) = b/3. This is right for a rail with shear, whose influence line has a kink.
        A rail that only bends needs the second moment, a = b²/24h², which has half of the effect on a rail with shear.
        """
        nearness = self.elements_per_bay / np.diff(self.support[j - 1 : j + 2])
        total = nearness.sum()
        return (nearness * (1.0 - np.sqrt(1.0 - total * self.pad_width / 6.0)) / total).tolist()

    def ballast_link(self, j: int) -> Link:
        """The ballast under sleeper ``j``: to the ground, or to the ballast mass with 3 layers.

        Parameters
        ----------
        j : int
            Number of the support.

        Returns
        -------
        Link
            From the sleeper downwards.

        Raises
        ------
        SimulationError
            For a track of one layer.
        """
        if self.layers == 1:
            raise SimulationError(f"{self.name}: a track of one layer has no ballast under support {j}.")
        values = self.ballast_stiffness[j], self.ballast_damping[j], 0.0, self.ballast_loss_factor[j]
        return Link(self._ballast_ends(j), *values, "ballast")

    def _ballast_ends(self, j: int) -> tuple:
        sleeper = ((("sleeper", j), 1.0),)
        return (*sleeper, (("ballast", j), -1.0)) if self.layers == 3 else sleeper

    def spring_between(self, ends: tuple) -> str:
        """Which spring of a support acts on the degrees of freedom of a link with the same weights.

        Parameters
        ----------
        ends : tuple
            ``ends`` of the link, the first of them at the support.

        Returns
        -------
        str
            "pad", "ballast" or "subgrade"; "" if none does.
        """
        j = ends[0][0][1]
        if ends == self._pad_ends(j):
            return "pad"
        if self.layers > 1 and ends == self._ballast_ends(j):
            return "ballast"
        return "subgrade" if self.layers == 3 and ends == ((("ballast", j), 1.0),) else ""

    def support_links(self, j: int) -> list[Link]:
        """Springs, dampers and masses of support ``j``, which terms can scale or remove.

        Parameters
        ----------
        j : int
            Number of the support.

        Returns
        -------
        list of Link
            Pad, sleeper and ballast; with 3 layers also ballast mass, subgrade and shear to the support before.
        """
        pad = self.pad_link(j)
        if self.layers == 1:
            return [pad]
        links = [pad, Link(((("sleeper", j), 1.0),), mass=self.sleeper_mass[j], tag="sleeper"), self.ballast_link(j)]
        if self.layers == 2:
            return links
        ballast = ((("ballast", j), 1.0),)
        links.append(Link(ballast, mass=self.ballast_mass[j]))
        links.append(Link(ballast, self.subgrade_stiffness[j], self.subgrade_damping[j], tag="subgrade"))
        if j and (self.bay_shear_stiffness[j] or self.bay_shear_damping[j]):
            ends = (*ballast, (("ballast", j - 1), -1.0))
            links.append(Link(ends, self.bay_shear_stiffness[j], self.bay_shear_damping[j], tag="bay_shear"))
        return links


def uniform_track(
    length: float = 96.0, spacing: float = 0.6, rail: Rail | None = None, start: float = 0.0, **values: Any
) -> Track:
    """A uniform track of ``length`` [m] with supports every ``spacing`` [m].

    Unless given otherwise: 60 kg/m rail, pad 300 MN/m and 30 kN s/m, half sleeper 150 kg, ballast 90 MN/m
    and 80 kN s/m per rail seat, rail damping 20 N s/m².

    Parameters
    ----------
    length : float
        Length, rounded to whole bays. [m]
    spacing : float
        Distance of two supports. [m]
    rail : Rail or None
        Profile of the rail; None: 60 kg/m.
    start : float
        Position of the first support. [m]
    **values : Any
        Further fields of ``Track``, or other values of those above.

    Returns
    -------
    Track
        The track.

    Raises
    ------
    SimulationError
        If the values are not those of a track.

    Examples
    --------
    >>> track = uniform_track(length=6.0)
    >>> track.support.size, float(track.pad_stiffness[3])
    (11, 300000000.0)
    """
    check_number("length", length, "m", above=0.0)
    check_number("spacing", spacing, "m", above=0.0)
    check_number("start", start, "m")
    rail = rail or Rail(6.42e6, 60.21, 0.4 * 81e9 * 76.7e-4, 7850 * 3.055e-5, damping=20.0)
    reference = {"pad_stiffness": 300e6, "pad_damping": 30e3, "sleeper_mass": 150.0}
    reference |= {"ballast_stiffness": 90e6, "ballast_damping": 80e3}
    support = start + spacing * np.arange(round(length / spacing) + 1)
    return Track(rail, support, **(reference | values))
