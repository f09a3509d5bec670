"""All numeric constants of the case of a turnout: group, value, unit, reason and source of each."""

from dataclasses import fields
from typing import Any

from turnout.mismatch.turnout.defect_priors import CORRUGATION, FLATS, GEOMETRY, IMPACTS, POLYGONS, SHORT_POLYGONS
from turnout.mismatch.turnout.priors import (
    ACCEPTED,
    ALIGNMENT,
    CASE,
    DISTURBANCE,
    PASSAGE,
    RECEPTANCE,
    SATURATION,
    SIMULATION,
    TRACK,
)
from turnout.mismatch.turnout.surface_priors import ROUGHNESS, SURFACE, TOP_SHAPE, WHEELS

GROUPS = (
    TRACK,
    ACCEPTED,
    CASE,
    RECEPTANCE,
    PASSAGE,
    SIMULATION,
    ALIGNMENT,
    SURFACE,
    TOP_SHAPE,
    WHEELS,
    ROUGHNESS,
    SATURATION,
    DISTURBANCE,
    FLATS,
    POLYGONS,
    SHORT_POLYGONS,
    GEOMETRY,
    CORRUGATION,
    IMPACTS,
)


def prior_rows() -> list[tuple[str, str, Any, str, str, str]]:
    """Group, name, value, unit, reason and source of every constant, in the order of the code.

    Returns
    -------
    list of tuple
    """
    return [
        (type(group).__name__, f.name, f.default, f.metadata["unit"], f.metadata["reason"], f.metadata["source"])
        for group in GROUPS
        for f in fields(group)
    ]
