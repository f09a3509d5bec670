r"""The blade of a switch: a second rail on the bearers of the stock rail, which wheels change to.

The blade is a beam of its own. From its free toe to the heel it rests on slide chairs, which press and do not pull.
From the heel on it is fastened to the bearers, as the closure rail that it becomes. Where the model ends both rails
have one node in common, so a wheel rolls on without a step.

The stock rail is the rail of the track. A wheel comes on it, and leaves it where the blade is higher. Both surfaces and
both rails take part while the wheel touches both: contacts in parallel.

.. math:: F_1 + F_2 = F, \qquad z - w_1 - p_1 = (F_1/k_H)^{2/3}, \quad z - w_2 - p_2 = (F_2/k_H)^{2/3}

References
----------
Kassa and Nielsen 2009, Dynamic train-turnout interaction in an extended frequency range using a detailed model of track
dynamics, Journal of Sound and Vibration 320. Chairs that press and do not pull: Bruni et al. 2009, Vehicle System
Dynamics 47.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import GRAVITY
from turnout.errors import SimulationError
from turnout.simulate.force_laws import LiftLaw, Port
from turnout.simulate.links import Link
from turnout.simulate.rail import in_series

if TYPE_CHECKING:
    from turnout.simulate.rail import Rail
    from turnout.simulate.track import Track
    from turnout.simulate.wheel_path import PathPart, Surfaces

AT_SUPPORT = 0.1  # bays; a toe that is closer to a support is on it


@dataclass(frozen=True)
class Blade:
    """Blade from its ``toe`` to its ``heel`` and on to the ``end`` of its model [m], in this order in either direction.

    ``rail`` is its section before the heel; behind it the closure rail has the section of the track's rail. The blade
    is planed over ``planed_length`` from its toe [m], where it has ``planed_share`` of its section; in between the
    share grows linearly. ``chair_stiffness`` [N/m] and ``chair_damping`` [N s/m] act between blade and bearer at every
    support. Before the heel the blade rests on them by its own weight, from the heel on it is fastened. The end is at
    the nearest support.
    """

    toe: float
    heel: float
    end: float
    rail: Rail
    chair_stiffness: float
    chair_damping: float
    planed_length: float = 0.0
    planed_share: float = 1.0

    def __post_init__(self) -> None:
        for name in ("chair_stiffness", "chair_damping", "planed_length"):
            if not getattr(self, name) >= 0.0:
                raise SimulationError(f"blade: {name} must not be negative, got {getattr(self, name)!r}.")
        if not 0.0 < self.planed_share <= 1.0:
            raise SimulationError(f"blade: planed_share must be above 0 and at most 1, got {self.planed_share!r}.")
        if not self.direction * self.toe < self.direction * self.heel <= self.direction * self.end:
            order = f"{self.toe:.3f}, {self.heel:.3f} and {self.end:.3f} m"
            raise SimulationError(f"blade: toe, heel and end at {order} are not in this order.")

    @property
    def direction(self) -> int:
        """1 where the heel has the larger position, otherwise -1."""
        return 1 if self.end > self.toe else -1

    def inside(self, start: float, end: float) -> Blade | None:
        """The blade on a shorter track; both rails then join at its end.

        Parameters
        ----------
        start : float
            First support of that track. [m]
        end : float
            Last support. [m]

        Returns
        -------
        Blade or None
            None without a toe and a heel on it: the blade is then no part of the model.
        """
        if not (start < self.toe < end and start < self.heel < end):
            return None
        return replace(self, end=min(max(self.end, start), end))

    def with_moved_end(self, offset: float) -> Blade:
        """The blade whose model ends elsewhere, not before the heel.

        Parameters
        ----------
        offset : float
            Distance by which the end moves along the track. [m]

        Returns
        -------
        Blade
        """
        last = max if self.direction > 0 else min
        return replace(self, end=last(self.end + offset, self.heel))

    def nodes(self, track: Track) -> tuple[int, int]:
        """First and last node of the blade on ``track``, in the order of positions.

        Parameters
        ----------
        track : Track
            The track with the stock rail.

        Returns
        -------
        (int, int)
            Numbers of nodes of the track; one is the toe, the other the end.

        Raises
        ------
        SimulationError
            If the toe or the end is not on the track, or the blade has no element.
        """
        for name in ("toe", "end"):
            if not track.start <= getattr(self, name) <= track.end:
                problem = f"from {track.start:.3f} to {track.end:.3f} m"
                raise SimulationError(f"{track.name}: the {name} at {getattr(self, name):.3f} m is not {problem}.")
        end, toe = track.nearest_support(self.end) * track.elements_per_bay, self.toe_node(track)
        if toe == end:
            raise SimulationError(f"{track.name}: the blade is shorter than an element.")
        return min(toe, end), max(toe, end)

    def toe_node(self, track: Track) -> int:
        """Node of the toe: that of a support close to it, otherwise the nearest one in the bay, which is moved to it.

        So the blade has the same length on every mesh, but for a bay of one element.

        Parameters
        ----------
        track : Track
            The track with the stock rail.

        Returns
        -------
        int
            Number of the node.
        """
        per_bay = track.elements_per_bay
        bay, share = self._bay_of_toe(track)
        if per_bay == 1 or not AT_SUPPORT < share < 1.0 - AT_SUPPORT:
            return (bay + round(share)) * per_bay
        return bay * per_bay + min(max(round(share * per_bay), 1), per_bay - 1)

    def _bay_of_toe(self, track: Track) -> tuple[int, float]:
        """Number of the bay with the toe, and the share of it before the toe."""
        position = float(np.interp(self.toe, track.support, np.arange(track.support.size)))
        bay = min(int(position), track.support.size - 2)
        return bay, position - bay

    def toe_limits(self, track: Track) -> tuple[float, float] | None:
        """How far the toe may move so that the same chairs are behind it.

        Parameters
        ----------
        track : Track
            The track with the stock rail.

        Returns
        -------
        (float, float) or None
            Lowest and highest shift [m]; None for a toe on a support, which has no free end.
        """
        bay, share = self._bay_of_toe(track)
        if not AT_SUPPORT < share < 1.0 - AT_SUPPORT:
            return None
        start, end = track.support[bay : bay + 2].tolist()
        margin = AT_SUPPORT * (end - start)
        return start + margin - self.toe, end - margin - self.toe

    def element_rail(self, track: Track, start: float, end: float) -> Rail:
        """Section of an element of the blade; several sections are combined in series.

        Parameters
        ----------
        track : Track
            The track with the stock rail.
        start : float
            First node. [m]
        end : float
            Second node. [m]

        Returns
        -------
        Rail
        """
        borders = {self.heel, self.toe + self.direction * self.planed_length}
        cuts = [start, *sorted(x for x in borders if start < x < end), end]
        rails = [self._section(track, 0.5 * (a + b)) for a, b in pairwise(cuts)]
        return in_series(rails, np.diff(cuts) / (end - start)) if len(rails) > 1 else rails[0]

    def _section(self, track: Track, position: float) -> Rail:
        """Section at a position [m]: planed, full or that of the closure rail."""
        from_toe = max(self.direction * (position - self.toe), 0.0)
        if from_toe > self.direction * (self.heel - self.toe):
            return track.rail_at(position)
        if from_toe >= self.planed_length:
            return self.rail
        share = self.planed_share + (1.0 - self.planed_share) * from_toe / self.planed_length
        fields = ("bending_stiffness", "mass", "shear_stiffness", "rotary_inertia")
        return replace(self.rail, **{name: share * getattr(self.rail, name) for name in fields})

    def chairs(self, track: Track) -> list[int]:
        """Supports under the blade from the toe to the one before the end.

        Parameters
        ----------
        track : Track
            The track with the stock rail.

        Returns
        -------
        list of int
            Numbers of the supports, the one at the toe first.
        """
        first, last = self.nodes(track)
        per_bay, end = track.elements_per_bay, track.nearest_support(self.end)
        inside = [j for j in range(-(-first // per_bay), last // per_bay + 1) if j != end]
        return inside[:: self.direction]

    def slide_chairs(self, track: Track) -> list[int]:
        """The chairs on which the blade only rests.

        Parameters
        ----------
        track : Track
            The track with the stock rail.

        Returns
        -------
        list of int
            Numbers of the supports, the one at the toe first.
        """
        return [j for j in self.chairs(track) if self.direction * (track.support[j] - self.heel) < 0.0]

    def chair_link(self, j: int) -> Link:
        """The chair on support ``j``.

        Parameters
        ----------
        j : int
            Number of the support, one of ``chairs``.

        Returns
        -------
        Link
            Between blade and bearer.
        """
        ends = ((("blade", j, 0), 1.0), (("sleeper", j), -1.0))
        return Link(ends, self.chair_stiffness, self.chair_damping, tag="chair")

    def chair_load(self, track: Track) -> float:
        """Weight of the blade over one bay, which a slide chair carries [N].

        Parameters
        ----------
        track : Track
            The track with the stock rail.

        Returns
        -------
        float
        """
        return GRAVITY * self.rail.mass * float(np.median(np.diff(track.support)))

    def ports(self, track: Track, replaced: Collection[tuple] = ()) -> list[Port]:
        """What removes the pull of the chairs on which the blade only rests.

        Parameters
        ----------
        track : Track
            The track with the stock rail.
        replaced : collection of tuple
            Ends of chairs whose contact a term describes.

        Returns
        -------
        list of Port
            One for each such chair; its preload is the weight of the blade over one bay.
        """
        law = LiftLaw(self.chair_stiffness, self.chair_damping, self.chair_load(track))
        links = [(j, self.chair_link(j).ends) for j in self.slide_chairs(track)]
        return [Port(ends, law, label=f"slide chair {j}") for j, ends in links if ends not in replaced]


def transfer_position(surfaces: Surfaces, blade: Blade) -> float | None:
    """Where the tops of stock rail and blade are level.

    Parameters
    ----------
    surfaces : tuple of tuple of path parts
        Surfaces of a route.
    blade : Blade
        The blade.

    Returns
    -------
    float or None
        Position, seen from the toe the first at which the blade is the higher one [m]; None if no surface is on the
        blade.
    """
    lines = [is_on_blade(surface) for surface in surfaces]
    if all(lines) or not any(lines):
        return None
    x = np.linspace(blade.toe, blade.heel, 2001)
    tops = [np.sum([component(x, 0) for component in surface], axis=0) + 0.0 * x for surface in surfaces]
    stock, top = tops[lines.index(False)], tops[lines.index(True)]
    return float(x[np.argmax(top <= stock)]) if np.any(top <= stock) else None


def is_on_blade(surface: Sequence[PathPart]) -> bool:
    """Whether wheels on this surface press the blade: a component of it is that of a blade.

    Parameters
    ----------
    surface : sequence of path parts
        One surface of a route.

    Returns
    -------
    bool
    """
    return any(getattr(component, "on_blade", False) for component in surface)
