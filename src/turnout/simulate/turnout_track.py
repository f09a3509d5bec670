"""Model of a turnout: its track, and the path of a wheel along each of its routes."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.config.parameters import Number, ParameterSet
from turnout.errors import SimulationError
from turnout.records import MID_SPAN
from turnout.simulate.roughness import roughness
from turnout.simulate.track import PER_SUPPORT, Track
from turnout.simulate.wheel_path import PathPart, Surfaces

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any


@dataclass(frozen=True)
class TurnoutTrack:
    """``track`` with its ``routes``: name -> surfaces, each the parts of a wheel's path along it.

    ``roughness_level`` [dB above the limit curve of ISO 3095], None for a smooth rail. ``locations`` are named
    (position [m], route), ``numbers`` the parameters with unit, source and prior as read. ``tracks`` holds the track
    of a route that has separate rails, as behind a crossing. ``terms`` are entries of effects that were diagnosed as
    missing in the base track; ``turnout.stages.accepted_effects`` converts them to terms. ``spreads`` has, for parts
    of routes, the relative standard deviation of each number with a prior, by field.
    """

    track: Track
    routes: dict[str, Surfaces] = field(default_factory=lambda: {"main": ((),)})
    roughness_level: float | None = None
    locations: dict[str, tuple[float, str]] = field(default_factory=dict)
    numbers: tuple[tuple[str, Number], ...] = ()
    tracks: dict[str, Track] = field(default_factory=dict)
    terms: tuple[ParameterSet, ...] = ()
    spreads: dict[PathPart, dict[str, float]] = field(default_factory=dict)

    def __repr__(self) -> str:
        locations = f", locations {', '.join(self.locations)}" if self.locations else ""
        n_effect = f", {len(self.terms)} accepted effects" if self.terms else ""
        extent = f"{self.track.start:g} to {self.track.end:g} m"
        return f"TurnoutTrack({self.name or 'unnamed'}: {extent}, routes {', '.join(self.routes)}{locations}{n_effect})"

    @property
    def name(self) -> str:
        """Name of the track."""
        return self.track.name

    def track_of(self, route: str) -> Track:
        """The track under ``route``.

        Parameters
        ----------
        route : str
            Name of the route.

        Returns
        -------
        Track
            Its own track, or the common one.
        """
        return self.tracks.get(route, self.track)

    def with_moved_support(self, support: int, offset: float) -> TurnoutTrack:
        """The turnout with one support elsewhere.

        Parameters
        ----------
        support : int
            Its index, in every track.
        offset : float
            Distance by which it moves along the track. [m]

        Returns
        -------
        TurnoutTrack
        """

        def with_offset(track: Track) -> Track:
            return replace(track, support=track.support + offset * (np.arange(track.support.size) == support))

        return self._with_each_track(with_offset)

    def with_moved_supports(self, offset: float) -> TurnoutTrack:
        """The turnout with all supports elsewhere; rails, surfaces and locations stay.

        The model of a blade ends at a support, and moves its end with that; toe and heel stay.

        Parameters
        ----------
        offset : float
            Distance by which the supports move along the track. [m]

        Returns
        -------
        TurnoutTrack

        Raises
        ------
        SimulationError
            If a blade is no longer on its track.
        """

        def with_offset(track: Track) -> Track:
            blade = track.blade and track.blade.with_moved_end(offset)
            return replace(track, support=track.support + offset, blade=blade)

        return self._with_each_track(with_offset)

    def _with_each_track(self, change: Callable[[Track], Track]) -> TurnoutTrack:
        tracks = {name: change(track) for name, track in self.tracks.items()}
        return replace(self, track=change(self.track), tracks=tracks)

    def is_divided_at(self, position: float) -> bool:
        """Whether the routes have separate supports at ``position`` [m], as behind a crossing.

        Parameters
        ----------
        position : float
            Position along the track. [m]

        Returns
        -------
        bool
            Whether the tracks of the routes have different sections there.
        """
        return len({track.section[track.nearest_support(position)] for track in self.tracks.values()}) > 1

    def surfaces(self, route: str) -> Surfaces:
        """Surfaces of ``route``.

        Parameters
        ----------
        route : str
            Name of the route.

        Returns
        -------
        tuple of tuples of path parts
            Parts of the path on each surface.

        Raises
        ------
        SimulationError
            For a route that the turnout does not have.
        """
        if route not in self.routes:
            raise SimulationError(f"{self.name}: no route {route!r}; there are {', '.join(self.routes)}.")
        return self.routes[route]

    def roughness_parts(self, start: float, end: float, seed: int, level: float | None = None) -> tuple[PathPart, ...]:
        """The roughness between two positions as path parts.

        Parameters
        ----------
        start : float
            First position. [m]
        end : float
            Last position. [m]
        seed : int
            Seed of the roughness.
        level : float or None
            Level above the limit curve [dB]; None: that of the turnout.

        Returns
        -------
        tuple of Sampled
            One part, or none for a smooth rail.
        """
        level = self.roughness_level if level is None else level
        return () if level is None else (roughness(start, end, seed, level),)

    def with_track(self, **changes: Any) -> TurnoutTrack:
        """The same turnout with some fields of its track changed.

        Parameters
        ----------
        **changes : Any
            New values by name of the field of ``Track``, for the tracks of all routes.

        Returns
        -------
        TurnoutTrack
            A copy.
        """
        tracks = {name: replace(track, **changes) for name, track in self.tracks.items()}
        return replace(self, track=replace(self.track, **changes), tracks=tracks)


def half_bay(track: Track, position: float) -> float:
    """Half the distance of two supports: so far behind its sleeper an accelerometer at mid-span is.

    Parameters
    ----------
    track : Track
        The track.
    position : float
        Position of the sleeper. [m]

    Returns
    -------
    float
        Half the bay from the nearest support towards growing x; at the end of the track half its last bay. [m]

    Examples
    --------
    >>> from turnout.simulate.track import uniform_track
    >>> half_bay(uniform_track(24.0, spacing=0.75), 12.0)
    0.375
    """
    first = min(track.nearest_support(position), track.support.size - 2)
    return round(0.5 * float(track.support[first + 1] - track.support[first]), 6)


def position_by_mounting(track: Track, position: float, mounting: str) -> float:
    """Position of an accelerometer of a hammer test, if none is stated.

    Parameters
    ----------
    track : Track
        The track.
    position : float
        Position of the impacts. [m]
    mounting : str
        Where the accelerometer is fixed; ``MID_SPAN`` in it is half a bay behind the impacts.

    Returns
    -------
    float
        Position. [m]
    """
    return position + (half_bay(track, position) if MID_SPAN in mounting else 0.0)


def supports_within(track: Track, position: float, half_length: float) -> np.ndarray:
    """Whether each support is in the ``stretch_of_track``.

    Parameters
    ----------
    track : Track
        The track.
    position : float
        Middle of the stretch. [m]
    half_length : float
        Half its length. [m]

    Returns
    -------
    (n_support,) array of bool
        True for the supports of the stretch.
    """
    return np.abs(track.support - position) <= half_length


def stretch_of_track(track: Track, position: float, half_length: float = 30.0) -> Track:
    """The track within ``half_length`` [m] of ``position``, which is enough for a hammer test.

    Parameters
    ----------
    track : Track
        The track.
    position : float
        Middle of the stretch. [m]
    half_length : float
        Half its length. [m]

    Returns
    -------
    Track
        The supports of the stretch with their values.

    Raises
    ------
    SimulationError
        With less than three supports in the stretch.
    """
    inside = supports_within(track, position, half_length)
    if inside.sum() < 3:
        raise SimulationError(f"{track.name}: no three supports within {half_length} m of {position} m.")
    values = {name: getattr(track, name)[inside] for name in PER_SUPPORT}
    section = tuple(s for s, k in zip(track.section, inside) if k)
    return replace(track, support=track.support[inside], section=section, **values)
