"""Size of a change: that at the newest visit, with the error of the model."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.file_comparison import model_error_sds
from turnout.mismatch.calibrated.model_answer import least_size
from turnout.mismatch.calibrated.stiffness_under_load import is_under_load
from turnout.mismatch.calibrated.stretch_ends import STRETCH_GROUPS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from turnout.mismatch.calibrated.belief import StateParameter
    from turnout.mismatch.calibrated.change import ChangeEffect, OnsetEvidence


def with_model_error(
    effect: ChangeEffect, size: tuple[float, float], by_name: Mapping[str, StateParameter]
) -> tuple[float, float]:
    """Size of a change and its standard deviation with the error of the model, which is a share of the size.

    The share is larger for stiffness under load. The model of a visit is linear in the stiffness about its value
    without the effect, but signals may be linear in the compliance. A loss x of the linear model is then ln(1 - x).

    Parameters
    ----------
    effect : ChangeEffect
    size : (float, float)
        Size and its standard deviation, in the unit of the effect.
    by_name : mapping of str to StateParameter

    Returns
    -------
    (float, float)
    """
    share = CALIBRATION.linear_error if is_under_load(effect) else CALIBRATION.size_error
    hidden = error_of_stiff_spring(effect, size[0], by_name)
    return size[0], float(np.linalg.norm([size[1], share * size[0], hidden]))


def error_of_stiff_spring(effect: ChangeEffect, size: float, by_name: Mapping[str, StateParameter]) -> float:
    r"""Error of the model in the size of an effect that makes springs stiffer, beside that of other effects.

    A stiff spring hides itself, since its compliance falls to :math:`e^{-x}`. The error of the model stays the share
    :math:`\epsilon` of the compliance before (``model_error_sds``), and that of the size x is
    :math:`\epsilon (e^x - 1)` beside it.

    Parameters
    ----------
    effect : ChangeEffect
    size : float
        [ln]
    by_name : mapping of str to StateParameter

    Returns
    -------
    float
        Standard deviation, 0 for an effect that softens, on other parameters, or under load alone. [ln]
    """
    springs = [p for name in effect.direction if (p := by_name.get(name)) and p.group in STRETCH_GROUPS]
    if size <= 0.0 or not springs or is_under_load(effect):
        return 0.0
    return float(np.max(model_error_sds(springs)) * np.expm1(size))


def is_material(evidence: OnsetEvidence, by_name: Mapping[str, StateParameter]) -> bool:
    """Whether the present size causes any action.

    Parameters
    ----------
    evidence : OnsetEvidence
    by_name : mapping of str to StateParameter

    Returns
    -------
    bool
    """
    return abs(present_size(evidence)[0]) >= least_size(evidence.effect, by_name)


def present_size(evidence: OnsetEvidence) -> tuple[float, float]:
    """Size at the last visit and its standard deviation: of growth, that since its most probable onset.

    Parameters
    ----------
    evidence : OnsetEvidence

    Returns
    -------
    (float, float)
    """
    start = evidence.times[int(np.argmax(evidence.gains))]
    elapsed = float(evidence.times[-1] - start) if evidence.effect.grows else 1.0
    return elapsed * evidence.size[0], elapsed * evidence.size[1]
