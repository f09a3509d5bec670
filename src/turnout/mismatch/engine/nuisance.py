"""Nuisance parameters: what of the base model is not exactly known."""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from turnout.errors import CaseError


@dataclass(frozen=True)
class Nuisance:
    """A parameter of the base model that is not exactly known, free under a normal prior.

    ``mean`` and ``sd`` of the prior in ``unit``. ``owner`` is the observation that it belongs to, None if shared.
    ``max_step_sd`` is the largest step of a fit in prior standard deviations. ``can_mask``: the base fit may have
    changed it to hide an effect. ``group`` is the property that it describes, for example the stiffness of single
    railpads. ``index`` is the number of its component among those of the group that are alike, else None. ``at`` is
    what it is fixed to, as (frame, level) of ``ResidualSpace.combinations``; None if that is not known. ``model_sd`` is
    the error that the model itself makes in the value, which no recording reduces, as a standard deviation.

    Raises
    ------
    CaseError
        If the mean is not finite or outside the bounds, or the standard deviation is not finite and above 0.
    """

    name: str
    unit: str
    mean: float
    sd: float
    owner: str | None = None
    bounds: tuple[float, float] = (-np.inf, np.inf)
    meaning: str = ""
    max_step_sd: float = 3.0
    can_mask: bool = True
    group: str = ""
    index: int | None = None
    at: tuple[str, Any] | None = None
    model_sd: float = 0.0

    def __post_init__(self) -> None:
        low, high = self.bounds
        what = f"nuisance parameter {self.name!r}"
        if not all(isinstance(x, Real) for x in (self.mean, self.sd, low, high)):
            raise CaseError(f"{what}: mean {self.mean!r}, sd {self.sd!r} and bounds {self.bounds!r} must be numbers")
        if not np.isfinite(self.mean) or not low <= self.mean <= high or not low < high:
            raise CaseError(f"{what}: the mean {self.mean:g} must be finite and within the bounds {low:g} and {high:g}")
        if not 0.0 < self.sd < np.inf:
            raise CaseError(
                f"{what}: the standard deviation {self.sd:g} must be finite and above 0; a number that is known "
                "exactly is no nuisance parameter but a constant of the simulation"
            )
