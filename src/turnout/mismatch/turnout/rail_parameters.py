"""Uncertain stiffness and mass of the rail and of its pieces with other sections, and the zone for given values."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.turnout.priors import TRACK
from turnout.mismatch.turnout.zone import Zone

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from turnout.mismatch.turnout.predictions import Values
    from turnout.simulate.rail import Rail
    from turnout.simulate.track import Track

# Prior sd of ln stiffness of the rail: wear and rolling tolerances. Published shear coefficients of 60E1 are 0.34 to
# 0.41; 14 controls of another simulator, checked against closed forms, needed 0.12 ± 0.02 less (95 %).
RAIL_SDS = (("rail_bending", TRACK.rail_bending_sd), ("rail_shear", TRACK.rail_shear_sd))
# The same for a piece of other rail, inner and at an end: the file has one section for a casting that varies.
CASTING_SDS = (("cast_bending", *TRACK.casting_sds), ("cast_mass", *TRACK.casting_sds))


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


def rail_meanings(zone: Zone) -> dict[str, str]:
    """What each of ``rail_sds`` is.

    Parameters
    ----------
    zone : Zone
        The supports with values of their own.

    Returns
    -------
    dict
        Name -> words for a message.
    """
    words = {"rail_bending": "bending stiffness of the rail", "rail_shear": "shear stiffness of the rail"}
    for k, c in enumerate(zone.castings):
        where = f"of the rail from {c.piece.start:.1f} to {c.piece.end:.1f} m"
        words |= {f"cast_bending_{k}": f"bending stiffness {where}", f"cast_mass_{k}": f"mass {where}"}
    return words


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
