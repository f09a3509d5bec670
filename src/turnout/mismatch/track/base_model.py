"""The base model of a turnout: which of its numbers are free, how free, and the track that they give."""

from dataclasses import dataclass, replace

import numpy as np

from turnout.mismatch.case import Nuisance
from turnout.simulate.track import PER_SUPPORT

# Common logarithmic factor on a value of all supports: field, tag of its links, what of the link, prior sd.
# Priors: spread of published values, Knothe and Grassie 1993, tables 1 to 3.
COMMON = (
    ("pad_stiffness", "pad", "stiffness", 0.25),
    ("pad_damping", "pad", "damping", 0.5),
    ("ballast_stiffness", "ballast", "stiffness", 0.25),
    ("ballast_damping", "ballast", "damping", 0.5),
    ("sleeper_mass", "sleeper", "mass", 0.06),
)
OWN = (("pad_stiffness", "pad", "stiffness"), ("ballast_stiffness", "ballast", "stiffness"))
SCATTER = 0.10  # from support to support, Oscarsson 2002
REACH = 1.3  # supports this far beyond sensors and blows have values of their own [m]
MARGIN = 18.0  # track kept beyond them [m]


@dataclass(frozen=True)
class Zone:
    """Supports ``first`` to ``last`` (inclusive) of the kept track lie among sensors and blows."""

    turnout: object
    first: int
    last: int

    @property
    def supports(self):
        """Indices of the supports of the zone."""
        return range(self.first, self.last + 1)


def zone_of(turnout, places):
    """The part of a turnout that matters, with absorbing ends kept as they are."""
    low, high = min(places), max(places)

    def cut(track):
        keep = (track.support >= low - MARGIN) & (track.support <= high + MARGIN)
        values = {name: getattr(track, name)[keep] for name in PER_SUPPORT}
        section = tuple(s for s, k in zip(track.section, keep) if k)
        return replace(track, support=track.support[keep], section=section, **values)

    tracks = {name: cut(track) for name, track in turnout.tracks.items()}
    smaller = replace(turnout, track=cut(turnout.track), tracks=tracks)
    support = smaller.track.support
    inside = np.flatnonzero((support >= low - REACH) & (support <= high + REACH))
    return Zone(smaller, int(inside[0]), int(inside[-1]))


def track_nuisances(zone, trains):
    """Nuisances of track and vehicles, all as logarithms of a factor on the file's value."""
    found = [Nuisance(name, "-", 0.0, sd, bounds=(-2.0, 2.0), meaning=f"ln {name}") for name, _, _, sd in COMMON]
    for name, tag, _ in OWN:
        for j in zone.supports:
            found.append(Nuisance(f"{tag}_{j}", "-", 0.0, SCATTER, bounds=(-0.6, 0.6), meaning=f"ln {name} of {j}"))
    for train in trains:
        found.append(Nuisance(f"wheels_{train}", "-", 0.0, 0.08, bounds=(-0.5, 0.5), meaning="ln unsprung mass"))
    return found


def track_with(track, zone, values):
    """The track with the factors of ``values`` on its supports."""
    changes = {name: getattr(track, name) * np.exp(values[name]) for name, *_ in COMMON}
    for name, tag, _ in OWN:
        for j in zone.supports:
            changes[name][j] *= np.exp(values[f"{tag}_{j}"])
    return track.with_(**changes)


def vehicle_with(vehicle, values, train, load):
    """The vehicle with its wheels' mass and its load changed; ``load`` is relative, on all that is sprung."""
    factor, wheels = float(np.exp(values.get(f"wheels_{train}", 0.0))), set(vehicle.wheels)
    bodies = tuple(
        replace(b, mass=b.mass * (factor if i in wheels else 1.0 + load)) for i, b in enumerate(vehicle.bodies)
    )
    return vehicle.with_(bodies=bodies)
