"""Verification on reserved recordings: fit of base, named effect, best rival and a decoy of as many parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.cross_validation import weighted_mean_square
from turnout.mismatch.engine.fit_quality import fit_percent, gain_error, lost_evidence
from turnout.mismatch.engine.reserved_data import reserved_fit
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.search import Search


def predict_with_decoy(
    observations: Sequence[Observation],
    predictions: Sequence[np.ndarray],
    reserved: Sequence[Observation],
    reserved_predictions: Sequence[np.ndarray],
    n: int,
) -> list[np.ndarray]:
    """Predictions of reserved recordings by the base model and a filter of free taps behind it.

    The taps (on the prediction delayed and advanced) are fitted to the observations of the reserved data types. They
    show what any such free numbers gain.

    Parameters
    ----------
    observations : sequence of Observation
        Those that were fitted.
    predictions : sequence of (n,) array of float
        Of these.
    reserved : sequence of Observation
    reserved_predictions : sequence of (n,) array of float
        Of these.
    n : int
        Number of taps.

    Returns
    -------
    list of (n,) array of float
    """
    kinds = {o.data_type for o in reserved}
    fitted = [(o, p, np.sqrt(o.effective) / o.sigma) for o, p in zip(observations, predictions) if o.data_type in kinds]
    if not fitted:
        return list(reserved_predictions)

    def columns(p: np.ndarray) -> np.ndarray:
        shifts = [s for k in range(1, n + 1) for s in (k, -k)][:n]
        return np.column_stack([np.roll(p, s) for s in shifts])

    rows = np.concatenate([columns(p) * weight[:, None] for _, p, weight in fitted])
    target = np.concatenate([(o.data - p) * weight for o, p, weight in fitted])
    taps = np.linalg.lstsq(rows, target, rcond=None)[0]
    return [p + columns(p) @ taps for p in reserved_predictions]


@dataclass(frozen=True)
class Verification:
    """Fit [%] of ``n`` reserved recordings: ``before``, ``after`` with the named term, with ``rival`` and with
    ``decoy``.

    ``error`` is the standard error of ``after`` less ``before`` with the two models as they are. ``error_of_fitted`` is
    its other part, which comes from the fitted recordings (``reserved_error``). ``reserved_excess`` is the weighted
    mean square without a term over the control level. ``lost_evidence`` is the fall of the logarithm of the likelihood
    of these recordings [nats], below 0 where the named model predicts them better.
    """

    n: int
    before: float
    after: float | None = None
    rival: float | None = None
    decoy: float | None = None
    error: float | None = None
    reserved_excess: float = 0.0
    lost_evidence: float = 0.0
    error_of_fitted: float = 0.0

    @property
    def total_error(self) -> float | None:
        """Standard error of ``after`` less ``before`` among other recordings, fitted and reserved. [points of fit]"""
        return None if self.error is None else float(np.hypot(self.error, self.error_of_fitted))

    @property
    def is_worse(self) -> bool:
        """Whether the named model predicts the reserved recordings worse, by more than the standard error."""
        return self.error is not None and self.after is not None and self.after < self.before - self.error

    def falls_by(self, points: float) -> bool:
        """Whether the fit of the reserved recordings falls by some points and two standard errors with the named model.

        A name may change the reserved recordings by so little that its error there is smaller than that of the model.

        Parameters
        ----------
        points : float
            Loss of fit that is allowed. [%]

        Returns
        -------
        bool
        """
        if self.error is None or self.after is None:
            return False
        fall = self.before - self.after
        return fall > points and fall >= THRESHOLDS.loss_errors * self.error


def verify(search: Search, base: Fit, fit: Fit, rival: Score | None) -> Verification:
    """Verification of ``fit`` on the reserved recordings, beside the base fit, a rival and a decoy.

    Parameters
    ----------
    search : Search
    base, fit : Fit
        Without any effect, and with those that have a name. The same fit if there are none.
    rival : Score or None
        Best rival of the first name.

    Returns
    -------
    Verification
        With ``before`` nan if there are no reserved recordings, or the base model cannot be simulated there.
    """
    case = search.case
    if not case.reserved:
        return Verification(0, float("nan"))
    n, (before, before_percent) = len(case.reserved), reserved_fit(case, base)
    if before is None or before_percent is None:
        return Verification(n, float("nan"))
    excess = reserved_excess_ratio(search, before)
    if fit is base:
        return Verification(n, before_percent, reserved_excess=excess)
    decoy = predict_with_decoy(case.observations, base.predictions, case.reserved, before, fit.psi.size)
    rival_percent = reserved_fit(case, rival.fit)[1] if rival else None
    after, after_percent = reserved_fit(case, fit)
    error = None if after is None else gain_error(case.reserved, before, after)
    lost = 0.0 if after is None else lost_evidence(case.reserved, before, after)
    decoy_percent = fit_percent(case.reserved, decoy)
    return Verification(n, before_percent, after_percent, rival_percent, decoy_percent, error, excess, lost)


def reserved_excess_ratio(search: Search, predictions: list[np.ndarray]) -> float:
    """Weighted mean square of the reserved recordings over the control level, the largest of the data types.

    Parameters
    ----------
    search : Search
    predictions : list of (n,) array of float
        Of each reserved recording.

    Returns
    -------
    float
        0 if there are no reserved recordings.
    """
    reserved, ratios = search.case.reserved, [0.0]
    for data_type in {o.data_type for o in reserved}:
        pairs = [(o, p) for o, p in zip(reserved, predictions) if o.data_type == data_type]
        ratios.append(weighted_mean_square(*zip(*pairs)) / search.control_level(data_type))
    return max(ratios)
