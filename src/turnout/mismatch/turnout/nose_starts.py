"""The fit of a visit from several positions of the noses: where trains meet a nose, a fit has more than one minimum."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.calibrated.constants import CALIBRATION

if TYPE_CHECKING:
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.search import Search


def fit_from_nose_positions(search: Search, fit: Fit, names: Collection[str]) -> Fit:
    """The most probable of a fit and those that begin with a nose before and behind its position in the file.

    A nose that is a few centimetres off is explained by depth, length and shape as well, so that a fit may stay there.
    It then leaves more of the trains than their stated errors. A fit that does not is returned as it is.

    Parameters
    ----------
    search : Search
        Of the case that was fitted.
    fit : Fit
        Without effects.
    names : collection of str
        Nuisances that are positions of noses.

    Returns
    -------
    Fit
    """
    fits = [fit]
    positions = [n for n in search.case.nuisances if n.name in names]
    if max(fit.scale.values(), default=1.0) <= 1.0:
        return fit
    for position in positions:
        surface = position.name.rpartition("_")[0]  # the other numbers of this nose start as in the file
        other_values = {name: value for name, value in fit.values.items() if not name.startswith(f"{surface}_")}
        for sds in (-CALIBRATION.nose_start_sds, CALIBRATION.nose_start_sds):
            try:
                start = search.fit((), np.zeros(0), {**other_values, position.name: position.mean + sds * position.sd})
                fits.append(search.converge(start))
            except SimulationError:
                continue
    return max(fits, key=lambda f: f.evidence)
