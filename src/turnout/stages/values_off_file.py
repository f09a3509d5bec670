"""Sentences on values of the whole model that a fit has moved far from the files: they may absorb an effect."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnout.constants import Z95_EXACT
from turnout.mismatch.engine.strained_values import StrainedValue, values_off_file

if TYPE_CHECKING:
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance


def sentences_on_values(nuisances: Sequence[Nuisance], fit: Fit) -> list[str]:
    """Sentences on the values of ``values_off_file``. Such a value is no name: a name needs its evidence.

    Parameters
    ----------
    nuisances : sequence of Nuisance
        Of the case.
    fit : Fit
        The last one, with all named effects. Its covariance begins with the nuisances, in their order.

    Returns
    -------
    list of str
        With the factor on the value of the file and its 95 % interval, which contains the error of the model.
    """
    errors = {n.name: float(np.hypot(np.sqrt(fit.covariance[k, k]), n.model_sd)) for k, n in enumerate(nuisances)}
    return [_sentence(v, fit.values[v.nuisance.name], errors[v.nuisance.name]) for v in values_off_file(nuisances, fit)]


def _sentence(value: StrainedValue, size: float, error: float) -> str:
    """One sentence, of a logarithm with its standard error."""
    factor, low, high = np.exp([size, size - Z95_EXACT * error, size + Z95_EXACT * error])
    return (
        f"The {value.words} is {factor:.2f} times that of the file ({low:.2f} to {high:.2f}): "
        f"{value.deviation:.1f} times its tolerance."
    )
