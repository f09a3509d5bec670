"""A worn nose: a dip of the track file that is certainly much deeper than the file has it.

The file allows for the depth of a nose by a wide tolerance, so that a worn nose is no evidence for any effect. The fit
estimates the depth all the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.turnout.candidates.catalogue import candidate_of, parameters_with
from turnout.mismatch.turnout.defect_priors import GEOMETRY
from turnout.physics.hypothesis import Hypothesis, Masking
from turnout.physics.surface_dip import SurfaceDip
from turnout.simulate.wheel_path import Kink

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.turnout.running_surface import RunningSurface


def worn_noses(surface: RunningSurface, estimates: Iterable[Mapping[str, Any]], fit: Fit) -> Iterator[Candidate]:
    """Noses as dips beside the nose of the file, those that are certainly worn.

    A depth d with the standard error s is certain to be ``worn_depth`` deeper than the depth f of the file if
    ln(d / f) exceeds it by ``finding_sds`` times s / d: the rule of the calibrated model.

    Parameters
    ----------
    surface : RunningSurface
        With the numbers of the file that may be off.
    estimates : iterable of mapping
        Of these numbers, as ``RunningSurface.estimate`` yields them.
    fit : Fit
        Without effects. It has the numbers of the nose as the trains meet it.

    Yields
    ------
    Candidate
        The dip that the file lacks, masked by the depth of the nose. Its fit starts with the nose of the file.
    """
    for e in estimates:
        if e["name"] != "depth" or not is_certainly_worn(e["value"], e["se"], e["filed"]):
            continue
        own = {p.field: p for p in surface.parameters if getattr(p.component, "place", None) == e["place"]}
        nose = own["depth"].component
        if not isinstance(nose, Kink):
            continue
        position = nose.place + (fit.values[own["place"].name] if "place" in own else 0.0)
        length = nose.length * (float(np.exp(fit.values[own["length"].name])) if "length" in own else 1.0)
        yield candidate_of(
            SurfaceDip,
            Hypothesis(
                starts=((e["value"] - e["filed"], length, GEOMETRY.worn_nose_sharpness, 0.0),),
                fixed={"place": position},
                where={"place": round(position, 3)},
                parameters=parameters_with(
                    SurfaceDip,
                    length=(length, GEOMETRY.worn_nose_length_sd * length),
                    shift=(0.0, GEOMETRY.position_step),
                ),
                masking=Masking(own["depth"].name),
                start_nuisances={p.name: 0.0 for p in own.values()},
            ),
        )


def is_certainly_worn(depth: float, error: float, file_depth: float) -> bool:
    """Whether a depth is certainly much larger than that of the file.

    Parameters
    ----------
    depth, error : float
        Estimate and its standard error. [m]
    file_depth : float
        [m]

    Returns
    -------
    bool

    Examples
    --------
    >>> is_certainly_worn(1.54e-3, 0.18e-3, 0.43e-3), is_certainly_worn(1.54e-3, 0.18e-3, 0.9e-3)
    (True, False)
    """
    if min(depth, file_depth) <= 0.0:
        return False
    return float(np.log(depth / file_depth)) - CALIBRATION.finding_sds * error / depth >= CALIBRATION.worn_depth
