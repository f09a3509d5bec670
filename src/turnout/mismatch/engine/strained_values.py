"""Values of the base model that a fit has moved so far from their file that no tolerance explains it.

The base model may absorb what it lacks by one value that all recordings share. The residual is then as small as in
intact recordings, but the value has paid for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance

LOGARITHM = "ln "  # with it begins the meaning of a value whose logarithm is fitted, relative to the file


@dataclass(frozen=True)
class StrainedValue:
    """A value of the base model that is ``deviation`` prior standard deviations from its file, which costs ``nats``."""

    nuisance: Nuisance
    deviation: float
    nats: float

    def __str__(self) -> str:
        words = (self.nuisance.meaning or self.nuisance.name).removeprefix(LOGARITHM).replace("_", " ")
        return f"{words} ({self.deviation:.1f} times its tolerance from the file)"


def strained_value(case: Case, fit: Fit, threshold: float) -> StrainedValue | None:
    r"""The value that has paid more than a name costs.

    A value at :math:`\eta` has lost :math:`(\eta - \mu)^2 / 2 \sigma^2` of the logarithm of its prior
    :math:`N(\mu, \sigma^2)`. The largest of n counts if that exceeds the threshold by :math:`\ln n`. Values of a single
    recording, those with many alike, such as the stiffness of each railpad, those of waves and of the running surface,
    and those that an effect of the library describes as well are left out: the first are no property of the track, one
    of many is often far from its mean, and the last are judged as effects.

    Parameters
    ----------
    case : Case
    fit : Fit
    threshold : float
        Evidence that a name needs. [nats]

    Returns
    -------
    StrainedValue or None
    """
    described = {c.site.masking_parameter for c in case.candidates}
    shared = [
        n
        for n in case.nuisances
        if n.owner is None and n.index is None and (n.can_mask or n.at) and n.name not in described
    ]
    if not shared:
        return None
    distances = [abs(fit.values[n.name] - n.mean) / n.sd for n in shared]
    k = int(np.argmax(distances))
    nats = float(0.5 * distances[k] ** 2 - np.log(len(shared)))
    return StrainedValue(shared[k], float(distances[k]), nats) if nats > threshold else None
