"""Values of the whole model that a fit has moved far from the files: a tolerance can absorb an effect without any name.

Single supports are left out. They differ among themselves, and on intact tracks of another generator one of some two
hundred values reaches three to five tolerances.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import Z95_EXACT
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance

LOGARITHM = "ln "  # with it begins the meaning of a value whose logarithm is fitted, relative to the file


def sentences_on_values(nuisances: Iterable[Nuisance], fit: Fit) -> list[str]:
    r"""Sentences on values of the track and of wheelsets beyond their tolerance, the farthest first.

    A value is stated where :math:`|\eta - \mu| > 3 \sigma`, with its prior :math:`N(\mu, \sigma^2)`: one in 370 right
    ones is beyond if the data determine it, fewer if they do not. It is no name: a name needs its evidence.

    Parameters
    ----------
    nuisances : iterable of Nuisance
        Of the case.
    fit : Fit
        The last one, with all named effects. Its covariance begins with the nuisances, in their order.

    Returns
    -------
    list of str
        With the factor on the value of the file and its 95 % interval.
    """
    off_file = []
    for k, nuisance in enumerate(nuisances):
        if nuisance.owner is not None or nuisance.index is not None or nuisance.group == "surface":
            continue
        if not nuisance.meaning.startswith(LOGARITHM):
            continue
        value, error = fit.values[nuisance.name], float(np.sqrt(fit.covariance[k, k]))
        distance = abs(value - nuisance.mean) / nuisance.sd
        if distance > THRESHOLDS.max_ordinary_spreads:
            off_file.append((distance, _sentence(nuisance, value, error, distance)))
    return [sentence for _, sentence in sorted(off_file, reverse=True)]


def _sentence(nuisance: Nuisance, value: float, error: float, distance: float) -> str:
    """One sentence."""
    words = nuisance.meaning.removeprefix(LOGARITHM).replace("_", " ")
    if nuisance.group == "wheels":
        words = f"{words} of {nuisance.name.removeprefix('wheels_')}"
    factor, low, high = np.exp([value, value - Z95_EXACT * error, value + Z95_EXACT * error])
    return (
        f"The {words} is {factor:.2f} times that of the file ({low:.2f} to {high:.2f}): "
        f"{distance:.1f} times its tolerance."
    )
