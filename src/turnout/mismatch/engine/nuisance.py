"""Nuisance parameters: what of the base model is not exactly known."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Nuisance:
    """A parameter of the base model that is not exactly known, free under a normal prior.

    ``mean`` and ``sd`` of the prior in ``unit``. ``owner`` is the observation that it belongs to, None if shared.
    ``max_step_sd`` is the largest step of a fit in prior standard deviations. ``can_mask``: the base fit may have
    changed it to hide an effect. ``group`` is the property that it describes, for example the stiffness of single
    railpads. ``index`` is the number of its component among those of the group that are alike, else None. ``at`` is
    what it is fixed to, as (frame, level) of ``ResidualSpace.combinations``; None if that is not known. ``model_sd`` is
    the error that the model itself makes in the value, which no recording reduces, as a standard deviation.
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
