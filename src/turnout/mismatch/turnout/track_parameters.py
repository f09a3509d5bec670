"""Free parameters of the base model of a turnout, their priors, and the track for given values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.chair_parameters import chair_nuisances, chair_values, with_chairs
from turnout.mismatch.turnout.priors import TRACK
from turnout.simulate.track import NODE_TOLERANCE, PER_SUPPORT, RailStretch

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from turnout.mismatch.turnout.predictions import Values
    from turnout.simulate.rail import Rail
    from turnout.simulate.track import Track
    from turnout.simulate.turnout_track import TurnoutTrack
    from turnout.simulate.vehicle import Vehicle

# Common logarithmic factor on a value of all supports: field, tag of its links, quantity of the link, prior sd.
# Priors: spread of published values, Knothe and Grassie 1993, tables 1 to 3.
COMMON_PARAMETERS = (
    ("pad_stiffness", "pad", "stiffness", TRACK.common_stiffness_sd),
    ("pad_damping", "pad", "damping", TRACK.common_damping_sd),
    ("ballast_stiffness", "ballast", "stiffness", TRACK.common_stiffness_sd),
    ("ballast_damping", "ballast", "damping", TRACK.common_damping_sd),
    ("sleeper_mass", "sleeper", "mass", TRACK.common_mass_sd),
)


@dataclass(frozen=True)
class SupportParameter:
    """A value that every support of the zone has of its own.

    ``field`` of the track, short ``tag``, the ``link`` it belongs to and the ``quantity`` of that. ``sd`` is the
    standard deviation of its logarithm from support to support.
    """

    field: str
    tag: str
    link: str
    quantity: str
    sd: float


WHOLE_TRACK = ("frequency", "track")  # what a value of all supports or of the whole rail is fixed to
# Scatter from support to support: Oscarsson 2002. Dampers were never measured singly; sleepers are cast alike.
SUPPORT_PARAMETERS = (
    SupportParameter("pad_stiffness", "pad", "pad", "stiffness", TRACK.support_stiffness_sd),
    SupportParameter("ballast_stiffness", "ballast", "ballast", "stiffness", TRACK.support_stiffness_sd),
    SupportParameter("pad_damping", "pad_damper", "pad", "damping", TRACK.support_damping_sd),
    SupportParameter("ballast_damping", "ballast_damper", "ballast", "damping", TRACK.support_damping_sd),
    SupportParameter("sleeper_mass", "sleeper", "sleeper", "mass", TRACK.support_mass_sd),
)
# Prior sd of ln stiffness of the rail: wear and rolling tolerances. Published shear coefficients of 60E1 are 0.34 to
# 0.41; 14 controls of another simulator, checked against closed forms, needed 0.12 ± 0.02 less (95 %).
RAIL_SDS = (("rail_bending", TRACK.rail_bending_sd), ("rail_shear", TRACK.rail_shear_sd))
# The same for a piece of other rail, inner and at an end: the file has one section for a casting that varies.
CASTING_SDS = (("cast_bending", *TRACK.casting_sds), ("cast_mass", *TRACK.casting_sds))


@dataclass(frozen=True)
class Casting:
    """A ``piece`` of the ``stretch`` of other rail, or just beyond it, with its rail as in the file.

    ``inner``: not at an end of the stretch.
    """

    stretch: RailStretch
    piece: RailStretch
    inner: bool


@dataclass(frozen=True)
class Zone:
    """Supports ``first`` to ``last`` (inclusive) lie among sensors and impacts and have values of their own.

    Supports of ``effect_supports`` may have an effect; ``castings`` are pieces of other rail there.
    """

    turnout: TurnoutTrack
    first: int
    last: int
    effect_supports: range
    castings: tuple[Casting, ...] = ()

    @property
    def supports(self) -> range:
        """Indices of the supports of the zone."""
        return range(self.first, self.last + 1)


def zone_of(turnout: TurnoutTrack, positions: Sequence[float]) -> Zone:
    """The relevant part of a turnout, with absorbing ends as they are.

    Parameters
    ----------
    turnout : TurnoutTrack
        The whole turnout.
    positions : sequence of float
        Of sensors and impacts. [m]

    Returns
    -------
    Zone
    """
    low, high = min(positions), max(positions)

    def cut(track: Track) -> Track:
        keep = (track.support >= low - TRACK.track_margin) & (track.support <= high + TRACK.track_margin)
        values = {name: getattr(track, name)[keep] for name in PER_SUPPORT}
        section = tuple(s for s, k in zip(track.section, keep) if k)
        support = track.support[keep]
        blade = track.blade.inside(float(support[0]), float(support[-1])) if track.blade else None
        return replace(track, support=support, section=section, blade=blade, **values)

    tracks = {name: cut(track) for name, track in turnout.tracks.items()}
    smaller = replace(turnout, track=cut(turnout.track), tracks=tracks)
    support = smaller.track.support
    inside, effect_supports = (
        np.flatnonzero((support >= low - r) & (support <= high + r)) for r in (TRACK.support_reach, TRACK.effect_reach)
    )
    castings = castings_of(
        smaller.track_of("main"), low - TRACK.support_reach, high + TRACK.support_reach
    )  # receptances are modelled on it
    return Zone(
        smaller, int(inside[0]), int(inside[-1]), range(int(effect_supports[0]), int(effect_supports[-1]) + 1), castings
    )


def castings_of(track: Track, low: float, high: float) -> tuple[Casting, ...]:
    """Pieces of other rail, and of what lies within ``TRACK.section_ramp`` of it, between ``low`` and ``high`` [m].

    Cuts are at all ends, at ``TRACK.section_ramp`` from them, where a section grows from that of the rail, and every
    metre or so.

    Parameters
    ----------
    track : Track
        The track.
    low : float
        [m]
    high : float
        [m]

    Returns
    -------
    tuple of Casting
        In order of position.
    """
    cuts = {
        x for s in track.stretches for x in (s.start - TRACK.section_ramp, s.start, s.end, s.end + TRACK.section_ramp)
    }
    for s in track.stretches:
        if s.end - s.start > 2.0 * TRACK.section_ramp:
            cuts |= set(
                np.linspace(
                    s.start + TRACK.section_ramp, s.end - TRACK.section_ramp, 1 + max(1, round(s.end - s.start))
                )
            )
    castings = []
    for start, end in pairwise(sorted(cuts)):
        middle = 0.5 * (start + end)
        near = [s for s in track.stretches if s.start - TRACK.section_ramp < middle < s.end + TRACK.section_ramp]
        if near and end - start > TRACK.min_piece_length and end > low and start < high:
            stretch = next((s for s in reversed(near) if s.start <= middle < s.end), near[-1])
            inner = stretch.start + TRACK.section_ramp < middle < stretch.end - TRACK.section_ramp
            castings.append(Casting(stretch, RailStretch(float(start), float(end), track.rail_at(middle)), inner))
    return tuple(castings)


def rail_sds(zone: Zone) -> dict[str, float]:
    """{name: standard deviation} of uncertain rail values: its stiffness, stiffness and mass of castings.

    Parameters
    ----------
    zone : Zone
        The supports with values of their own.

    Returns
    -------
    dict
        Name -> standard deviation of the logarithm.
    """
    cast = [(f"{name}_{k}", sds[not c.inner]) for k, c in enumerate(zone.castings) for name, *sds in CASTING_SDS]
    return dict([*RAIL_SDS, *cast])


def _rail_words(zone: Zone) -> dict[str, str]:
    """What each of ``rail_sds`` is, in words."""
    words = {"rail_bending": "bending stiffness of the rail", "rail_shear": "shear stiffness of the rail"}
    for k, c in enumerate(zone.castings):
        where = f"of the rail from {c.piece.start:.1f} to {c.piece.end:.1f} m"
        words |= {f"cast_bending_{k}": f"bending stiffness {where}", f"cast_mass_{k}": f"mass {where}"}
    return words


def casting_elements(zone: Zone, node: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Elements that each casting covers.

    Parameters
    ----------
    zone : Zone
        The supports with values of their own.
    node : (n_element + 1,) array of float
        Nodes. [m]

    Returns
    -------
    list of ((n,) array of int, (n,) array of float)
        By casting: elements, and the covered shares of their length.
    """
    length, elements = np.diff(node), []
    for c in zone.castings:
        covered = np.minimum(node[1:], c.piece.end) - np.maximum(node[:-1], c.piece.start)
        inside = np.flatnonzero(covered > NODE_TOLERANCE)
        elements.append((inside, covered[inside] / length[inside]))
    return elements


def with_rail(zone: Zone, values: Mapping[str, float]) -> Zone:
    """The zone with rail stiffness and casting mass multiplied by the exponentials of ``values``.

    Parameters
    ----------
    zone : Zone
        The supports with values of their own.
    values : mapping
        Logarithms of the factors, by the names of ``rail_sds``.

    Returns
    -------
    Zone
    """
    factor = {name: float(np.exp(value)) for name, value in values.items()}

    def with_scales(rail: Rail, bending: float = 1.0, mass: float = 1.0) -> Rail:
        return replace(
            rail,
            bending_stiffness=rail.bending_stiffness * factor["rail_bending"] * bending,
            shear_stiffness=rail.shear_stiffness * factor["rail_shear"],
            mass=rail.mass * mass,
        )

    def with_factors(track: Track) -> Track:
        stretches = [replace(s, rail=with_scales(s.rail)) for s in track.stretches]
        for k, c in enumerate(zone.castings):
            if c.stretch in track.stretches:
                stretches.append(
                    replace(
                        c.piece, rail=with_scales(c.piece.rail, *(factor[f"{name}_{k}"] for name, *_ in CASTING_SDS))
                    )
                )
        return track.with_(rail=with_scales(track.rail), stretches=tuple(stretches))

    tracks = {name: with_factors(track) for name, track in zone.turnout.tracks.items()}
    return replace(zone, turnout=replace(zone.turnout, track=with_factors(zone.turnout.track), tracks=tracks))


def rail_on_grid(values: Values, names: Iterable[str]) -> dict[str, float]:
    """Rail values rounded to a grid: models are made there and are linear from there to ``values``.

    Parameters
    ----------
    values : mapping
        Nuisances by name.
    names : iterable of str
        Of rail values.

    Returns
    -------
    dict
        Name -> value on the grid.
    """
    return {name: TRACK.rail_step * round(values[name] / TRACK.rail_step) for name in names}


def track_nuisances(zone: Zone, trains: Iterable[str]) -> list[Nuisance]:
    """Nuisances of track and vehicles, all as logarithms of a factor on the value of the file.

    Parameters
    ----------
    zone : Zone
        The supports with values of their own.
    trains : iterable of str
        Types or numbers of the trains.

    Returns
    -------
    list of Nuisance
        First those of ``track_value_names``, then rail, chairs of a blade and wheelsets.
    """
    nuisances = [
        Nuisance(
            name,
            "-",
            0.0,
            sd,
            bounds=(-TRACK.common_bound, TRACK.common_bound),
            meaning=f"ln {name}",
            group="track",
            at=WHOLE_TRACK,
        )
        for name, _, _, sd in COMMON_PARAMETERS
    ]
    for parameter in SUPPORT_PARAMETERS:
        steps = steps_of(getattr(zone.turnout.track, parameter.field))
        for j in zone.supports:
            sd = float(np.hypot(parameter.sd, steps[j]))
            meaning, most = f"ln {parameter.field} of {j}", TRACK.bound_sds * sd
            name = f"{parameter.tag}_{j}"
            limits, support = (-most, most), ("place", round(float(zone.turnout.track.support[j]), 3))
            group = parameter.tag
            nuisances.append(Nuisance(name, "-", 0.0, sd, None, limits, meaning, group=group, index=j, at=support))
    words = _rail_words(zone)
    for name, sd in rail_sds(zone).items():
        bounds = (-TRACK.bound_sds * sd, TRACK.bound_sds * sd)
        at = WHOLE_TRACK if (name, sd) in RAIL_SDS else None  # a casting's value may stand for a cause beside it
        nuisances.append(Nuisance(name, "-", 0.0, sd, None, bounds, f"ln {words[name]}", group="rail", at=at))
    nuisances += chair_nuisances((zone.turnout.track, *zone.turnout.tracks.values()))
    for train in trains:
        nuisances.append(
            Nuisance(
                f"wheels_{train}",
                "-",
                0.0,
                TRACK.wheels_sd,
                bounds=(-TRACK.wheels_bound, TRACK.wheels_bound),
                meaning="ln unsprung mass",
                group="wheels",
                at=("train", train),
            )
        )
    return nuisances


def steps_of(values: np.ndarray) -> np.ndarray:
    """Largest step of the logarithm to a neighbour.

    Where sections meet, a support may belong to either, since a track file has their border to a bay.

    Parameters
    ----------
    values : (n,) array of float
        Values of the supports.

    Returns
    -------
    (n,) array of float

    Examples
    --------
    >>> [round(float(s), 3) for s in steps_of(np.array([2.0, 2.0, 1.0, 1.0]))]
    [0.0, 0.693, 0.693, 0.0]
    """
    step = np.abs(np.diff(np.log(values)))
    return np.maximum(np.append(step, 0.0), np.append(0.0, step))


def track_with(track: Track, zone: Zone, values: Values) -> Track:
    """The track with the factors of ``values`` on its supports.

    Parameters
    ----------
    track : Track
        The track.
    zone : Zone
        The supports with values of their own.
    values : mapping
        Nuisances by name.

    Returns
    -------
    Track
    """
    changes = {name: getattr(track, name) * np.exp(values[name]) for name, *_ in COMMON_PARAMETERS}
    for parameter in SUPPORT_PARAMETERS:
        for j in zone.supports:
            changes[parameter.field][j] *= np.exp(values[f"{parameter.tag}_{j}"])
    return with_chairs(track.with_(**changes), values)


def track_value_names(zone: Zone) -> list[str]:
    """Names of all values that ``track_with`` reads, first among the nuisances of a case.

    Parameters
    ----------
    zone : Zone
        The supports with values of their own.

    Returns
    -------
    list of str
        Common values, then each field of all supports.
    """
    return _names_of(zone.supports)


@lru_cache(maxsize=8)
def _names_of(supports: range) -> list[str]:
    return [n for n, *_ in COMMON_PARAMETERS] + [
        f"{parameter.tag}_{j}" for parameter in SUPPORT_PARAMETERS for j in supports
    ]


def track_value_key(zone: Zone, values: Values) -> bytes:
    """All values that ``track_with`` reads as bytes: a cache key.

    Parameters
    ----------
    zone : Zone
        The supports with values of their own.
    values : mapping
        Nuisances by name.

    Returns
    -------
    bytes
    """
    return np.array((*itemgetter(*track_value_names(zone))(values), *chair_values(values))).tobytes()


def vehicle_with(vehicle: Vehicle, values: Values, train: str, load: float) -> Vehicle:
    """The vehicle with another wheel mass and load; ``load`` is relative, on all that is sprung.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    values : mapping
        Nuisances by name.
    train : str
        Type or number of the train.
    load : float
        Change of all sprung masses, as a share of them.

    Returns
    -------
    Vehicle
    """
    factor, wheels = float(np.exp(values.get(f"wheels_{train}", 0.0))), set(vehicle.wheels)
    bodies = tuple(
        replace(b, mass=b.mass * (factor if i in wheels else 1.0 + load)) for i, b in enumerate(vehicle.bodies)
    )
    return vehicle.with_(bodies=bodies)
