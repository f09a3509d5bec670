"""Free parameters of supports, rail and vehicles of the base model, their priors, and the track for given values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.nuisance import Nuisance
from turnout.mismatch.turnout.chair_parameters import chair_nuisances, chair_values, with_chairs
from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.rail_parameters import RAIL_SDS, rail_meanings, rail_sds
from turnout.mismatch.turnout.toe_position import toe_nuisances
from turnout.mismatch.turnout.zone import Zone

if TYPE_CHECKING:
    from collections.abc import Iterable

    from turnout.mismatch.turnout.predictions import Values
    from turnout.simulate.track import Track
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
        First those of ``track_value_names``, then rail, chairs and toe of a blade, and wheelsets.
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
            model_sd=_model_sd(name),
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
    words = rail_meanings(zone)
    for name, sd in rail_sds(zone).items():
        bounds = (-TRACK.bound_sds * sd, TRACK.bound_sds * sd)
        at = WHOLE_TRACK if (name, sd) in RAIL_SDS else None  # a casting's value may stand for a cause beside it
        meaning, model_sd = f"ln {words[name]}", _model_sd(name)
        nuisances.append(Nuisance(name, "-", 0.0, sd, None, bounds, meaning, group="rail", at=at, model_sd=model_sd))
    tracks = zone.turnout.track, *zone.turnout.tracks.values()
    nuisances += [*chair_nuisances(tracks), *toe_nuisances(tracks)]
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


def _model_sd(name: str) -> float:
    """Error of the model in a value of the whole track; those that are not stated are below their standard errors."""
    return float(getattr(TRACK, f"{name}_model_sd", 0.0))


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
