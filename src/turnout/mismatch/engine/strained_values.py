"""Values of the base model that a fit has moved so far from their file that no tolerance explains it.

The base model may absorb what it lacks by one value that all recordings share. The residual is then as small as in
intact recordings, but the value has paid for it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit

LOGARITHM = "ln "  # with it begins the meaning of a value whose logarithm is fitted, relative to the file


def strained_value(case: Case, fit: Fit, threshold: float) -> str:
    r"""The value that has paid more than a name costs, in words.

    A value at :math:`\eta` has lost :math:`(\eta - \mu)^2 / 2 \sigma^2` of the logarithm of its prior
    :math:`N(\mu, \sigma^2)`. The largest of n counts if that exceeds the threshold by :math:`\ln n`. Values of a single
    recording, those with many alike, such as the stiffness of each railpad, and those that an effect of the library
    describes as well are left out: the first are no property of the track, one of many is often far from its mean, and
    the last are judged as effects.

    Parameters
    ----------
    case : Case
    fit : Fit
        Without effects.
    threshold : float
        Evidence that a name needs. [nats]

    Returns
    -------
    str
        "" if there is none.
    """
    described = {c.site.masking_parameter for c in case.candidates}
    shared = [
        n for n in case.nuisances if n.owner is None and n.index is None and n.can_mask and n.name not in described
    ]
    if not shared:
        return ""
    distances = [abs(fit.values[n.name] - n.mean) / n.sd for n in shared]
    k = int(np.argmax(distances))
    if 0.5 * distances[k] ** 2 - np.log(len(shared)) <= threshold:
        return ""
    words = (shared[k].meaning or shared[k].name).removeprefix(LOGARITHM).replace("_", " ")
    return f"{words} ({distances[k]:.1f} times its tolerance from the file)"
