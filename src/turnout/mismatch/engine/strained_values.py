"""Values of the base model that a fit has moved so far from their file that no tolerance explains it.

The base model may absorb what it lacks by one value that all recordings share. The residual is then as small as in
intact recordings, but the value is then improbable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from collections.abc import Iterable

    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.nuisance import Nuisance

LOGARITHM = "ln "  # with it begins the meaning of a value whose logarithm is fitted, relative to the file


@dataclass(frozen=True)
class StrainedValue:
    """A value of the base model that is ``deviation`` prior standard deviations from its file.

    ``nats`` is its conflict with the prior.
    """

    nuisance: Nuisance
    deviation: float
    nats: float

    def __str__(self) -> str:
        return f"{self.words} (it differs from the file by {self.deviation:.1f} times its tolerance)"

    @property
    def words(self) -> str:
        """The value in words, with its train."""
        words = (self.nuisance.meaning or self.nuisance.name).removeprefix(LOGARITHM).replace("_", " ")
        if self.nuisance.group == "wheels":
            words = f"{words} of {self.nuisance.name.removeprefix('wheels_')}"
        return words


def values_off_file(nuisances: Iterable[Nuisance], fit: Fit) -> list[StrainedValue]:
    r"""Values of the whole model beyond their tolerance, :math:`|\eta - \mu| > 3 \sigma`, the farthest first.

    One in 370 right ones is beyond if the data determine it, fewer if they do not. Single supports are left out. They
    differ among themselves, and on intact tracks of another generator one of some two hundred values reaches three to
    five tolerances.

    Parameters
    ----------
    nuisances : iterable of Nuisance
        Of the case.
    fit : Fit
        The last one, with all named effects.

    Returns
    -------
    list of StrainedValue
        ``nats`` as in ``strained_value``, with the number of all such values.
    """
    common = [
        n
        for n in nuisances
        if n.owner is None and n.index is None and n.group != "surface" and n.meaning.startswith(LOGARITHM)
    ]
    deviations = [abs(fit.values[n.name] - n.mean) / n.sd for n in common]
    off_file = [
        StrainedValue(n, float(d), float(0.5 * d**2 - np.log(len(common))))
        for n, d in zip(common, deviations)
        if d > THRESHOLDS.max_ordinary_spreads
    ]
    return sorted(off_file, key=lambda v: v.deviation, reverse=True)


def conflict_of_files(nuisances: Iterable[Nuisance], fit: Fit, threshold: float) -> str:
    """Values of different parts of the model that are off their files, in words; "" where the files may be right.

    One wrong value of a file does not make a name doubtful. Sleepers, rail and wheelsets that are all wrong do: their
    values then stand for something that the files do not describe, such as the casting of a crossing.

    Parameters
    ----------
    nuisances : iterable of Nuisance
        Of the case.
    fit : Fit
        The last one, with all named effects.
    threshold : float
        Evidence that a name needs: the conflicts of all values with their priors must exceed it together. [nats]

    Returns
    -------
    str
    """
    off_file = values_off_file(nuisances, fit)
    if len({v.nuisance.group for v in off_file}) < 2 or sum(v.nats for v in off_file) <= threshold:
        return ""
    return ", ".join(map(str, off_file))


def strained_value(case: Case, fit: Fit, threshold: float) -> StrainedValue | None:
    r"""The value farthest from its file, if its conflict with the prior exceeds the evidence that a name needs.

    A value with the prior :math:`N(\mu, \sigma^2)` is fitted at :math:`\eta` with the standard error s. Before the data
    are known, the estimate has the variance :math:`\sigma^2 - s^2`. The conflict of prior and data is (Evans and
    Moshonas 2006, Bayesian Analysis 1, 893)

    .. math:: z^2 / 2, \quad z = (\eta - \mu) / \sqrt{\sigma^2 - s^2}

    nats. For a value without a lock s = 0, because its tolerance may be rough. The largest of n values counts if it
    exceeds the threshold by :math:`\ln n`. These values are left out:

    - those that the data do not determine, and those of a single recording: they are no property of the track;
    - those of one component of many, such as each railpad, of waves and of the running surface: one of many is often
      far from its mean;
    - those that an effect of the library describes as well: they are judged as effects.

    Parameters
    ----------
    case : Case
    fit : Fit
        Its covariance begins with the nuisances, in their order.
    threshold : float
        Evidence that a name needs. [nats]

    Returns
    -------
    StrainedValue or None
    """
    described = {c.site.masking_parameter for c in case.candidates}
    shared = [
        (n, k)
        for k, n in enumerate(case.nuisances)
        if n.owner is None and n.index is None and (n.can_mask or n.at) and n.name not in described
    ]
    if not shared:
        return None
    strained, variances = None, np.diag(fit.covariance)
    for nuisance, k in shared:
        variance_share = variances[k] / nuisance.sd**2  # of the prior
        if variance_share >= THRESHOLDS.uninformed_sd_share**2:
            continue
        deviation = abs(fit.values[nuisance.name] - nuisance.mean) / nuisance.sd
        determined = 1.0 - variance_share if nuisance.at else 1.0
        nats = float(0.5 * deviation**2 / determined - np.log(len(shared)))
        if nats > (threshold if strained is None else strained.nats):
            strained = StrainedValue(nuisance, float(deviation), nats)
    return strained
