"""Model of a turnout: its track, and the path of a wheel along each of its routes."""

from dataclasses import dataclass, field, replace

import numpy as np

from turnout.errors import SimulationError
from turnout.simulate.roughness import roughness
from turnout.simulate.track import PER_SUPPORT, Track


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
    routes: dict = field(default_factory=lambda: {"main": ((),)})
    roughness_level: float | None = None
    locations: dict = field(default_factory=dict)
    numbers: tuple = ()
    tracks: dict = field(default_factory=dict)
    terms: tuple = ()
    spreads: dict = field(default_factory=dict)

    @property
    def name(self):
        """Name of the track."""
        return self.track.name

    def track_of(self, route):
        """The track under ``route``."""
        return self.tracks.get(route, self.track)

    def is_divided_at(self, position):
        """Whether the routes have separate supports at ``position`` [m], as behind a crossing."""
        return len({track.section[track.nearest_support(position)] for track in self.tracks.values()}) > 1

    def surfaces(self, route):
        """Surfaces of ``route``; an unknown one is a SimulationError."""
        if route not in self.routes:
            raise SimulationError(f"{self.name}: no route {route!r}; there are {', '.join(self.routes)}.")
        return self.routes[route]

    def roughness_parts(self, start, end, seed, level=None):
        """The roughness between two positions as path parts, () for a smooth rail."""
        level = self.roughness_level if level is None else level
        return () if level is None else (roughness(start, end, seed, level),)

    def with_track(self, **changes):
        """The same turnout with some fields of its track changed."""
        tracks = {name: replace(track, **changes) for name, track in self.tracks.items()}
        return replace(self, track=replace(self.track, **changes), tracks=tracks)


def supports_within(track, position, half_length):
    """(n_support,) whether each support is in the ``stretch_of_track``."""
    return np.abs(track.support - position) <= half_length


def stretch_of_track(track, position, half_length=30.0):
    """The track within ``half_length`` [m] of ``position``, which is enough for a hammer test."""
    inside = supports_within(track, position, half_length)
    if inside.sum() < 3:
        raise SimulationError(f"{track.name}: no three supports within {half_length} m of {position} m.")
    values = {name: getattr(track, name)[inside] for name in PER_SUPPORT}
    section = tuple(s for s, k in zip(track.section, inside) if k)
    return replace(track, support=track.support[inside], section=section, **values)
