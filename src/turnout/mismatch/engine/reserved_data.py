"""Verification on reserved recordings: fit of base, named effect, best rival and a decoy of as many parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.cross_validation import weighted_mean_square
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.levenberg_marquardt import FitPoint
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.search import Search


def fit_percent(observations: Sequence[Observation], predictions: Sequence[np.ndarray], centre: bool = True) -> float:
    r"""Share of the recordings that is predicted, in units of sigma.

    .. math:: 100 (1 - \|y - \hat y\| / \|y - \bar y\|)

    Parameters
    ----------
    observations : sequence of Observation
    predictions : sequence of (n,) array of float
    centre : bool
        Whether the mean of each recording is subtracted from it.

    Returns
    -------
    float
        [%]

    Examples
    --------
    >>> from turnout.mismatch.engine.observation import Observation
    >>> y = np.array([1.0, -1.0, 1.0, -1.0])
    >>> fit_percent([Observation("a", "a", y, 1.0)], [0.9 * y])
    90.0
    """
    missed = total = 0.0
    for o, p in zip(observations, predictions):
        mean = float(np.mean(o.data)) if centre else 0.0
        missed += o.effective * float(np.sum(((o.data - p) / o.sigma) ** 2))
        total += o.effective * float(np.sum(((o.data - mean) / o.sigma) ** 2))
    return round(100.0 * (1.0 - float(np.sqrt(missed / total))), 4)


def reserved_fit(case: Case, fit: Fit) -> tuple[list[np.ndarray], float] | tuple[None, None]:
    """Predictions of the reserved recordings by a fitted model, and how well they fit.

    Parameters
    ----------
    case : Case
    fit : Fit

    Returns
    -------
    predictions : list of array or None
        None if the simulation fails.
    percent : float or None
        As ``fit_percent``. [%]
    """
    try:
        predictions = predict_reserved(case, fit, case.reserved)
    except SimulationError:
        return None, None
    return predictions, fit_percent(case.reserved, predictions)


def gain_error(observations: Sequence[Observation], before: Sequence[np.ndarray], after: Sequence[np.ndarray]) -> float:
    r"""Standard error of ``fit_percent`` of ``after`` less that of ``before``.

    Jackknife over stretches of each observation, each in all of its rows: with the gain :math:`d_i` of all stretches
    but one, :math:`\sqrt{(m - 1) / m \sum (d_i - \bar d)^2}`. Both fits lack the same roughness, and so do all sensors
    under one train. The gain is therefore more certain than either fit.

    Parameters
    ----------
    observations : sequence of Observation
    before, after : sequence of (n,) array of float
        Two predictions of each.

    Returns
    -------
    float
        In points of fit.

    References
    ----------
    Efron and Stein 1981, The jackknife estimate of variance.
    """
    sums = np.array([_block_squares(o, b, a) for o, b, a in zip(observations, before, after)]).transpose(1, 0, 2)
    missed_before, missed_after, total = (np.sum(s) - s.ravel() for s in sums)
    gain = 100.0 * (np.sqrt(missed_before / total) - np.sqrt(missed_after / total))
    return float(np.sqrt((gain.size - 1) * np.var(gain)))


def _block_squares(o: Observation, before: np.ndarray, after: np.ndarray) -> list[list[float]]:
    """(3, n_blocks) weighted sums of squares of the residuals ``before`` and ``after``, and of the recording."""
    residuals = (o.data - before, o.data - after, o.data - np.mean(o.data))
    return [_block_sums(o, (p / o.sigma) ** 2) for p in residuals]


def _block_sums(o: Observation, squares: np.ndarray) -> list[float]:
    """(n_blocks,) sums of ``squares`` (n,) over stretches of the observation, each in all of its rows."""
    per_sample = squares.reshape(o.rows, -1).sum(axis=0)
    return [o.effective * float(np.sum(b)) for b in np.array_split(per_sample, THRESHOLDS.n_blocks)]


def is_significantly_worse(
    observations: Sequence[Observation], before: Sequence[np.ndarray], after: Sequence[np.ndarray], points: float
) -> bool:
    """Whether a prediction fits worse by more than some points of fit and two standard errors.

    The standard error is that of the difference of weighted squares over stretches of each observation, each in all of
    its rows. One in six names that say nothing about these observations reaches one standard error.

    Parameters
    ----------
    observations : sequence of Observation
    before, after : sequence of (n,) array of float
        Two predictions of each.
    points : float
        Loss of ``fit_percent`` that is allowed.

    Returns
    -------
    bool
    """
    losses = (((o.data - a) ** 2 - (o.data - b) ** 2) / o.sigma**2 for o, b, a in zip(observations, before, after))
    block_losses = [block_loss for o, d in zip(observations, losses) for block_loss in _block_sums(o, d)]
    error = np.std(block_losses, ddof=1) * np.sqrt(len(block_losses))
    return (
        sum(block_losses) > THRESHOLDS.loss_errors * error
        and fit_percent(observations, after) < fit_percent(observations, before) - points
    )


def lost_evidence(
    observations: Sequence[Observation], before: Sequence[np.ndarray], after: Sequence[np.ndarray]
) -> float:
    """Fall of the logarithm of the likelihood of observations from one prediction to another [nats].

    Parameters
    ----------
    observations : sequence of Observation
    before, after : sequence of (n,) array of float
        Two predictions of each.

    Returns
    -------
    float
        Below 0 where ``after`` is the better one.
    """
    n = sum(o.n_effective for o in observations)
    return 0.5 * n * (weighted_mean_square(observations, after) - weighted_mean_square(observations, before))


def predict_reserved(case: Case, fit: Fit, observations: Sequence[Observation]) -> list[np.ndarray]:
    """Predictions by the fitted model; only nuisances that the observations own are fitted to them.

    Any model gets the same freedom (speed, time and load of a passage), so that models stay comparable.

    Parameters
    ----------
    case : Case
    fit : Fit
    observations : sequence of Observation
        Reserved ones.

    Returns
    -------
    list of (n,) array of float

    Raises
    ------
    SimulationError
        If the model cannot be simulated there.
    """
    return fit_reserved(case, fit, observations)[1]


def fit_reserved(case: Case, fit: Fit, observations: Sequence[Observation]) -> tuple[Fit, list[np.ndarray]]:
    """The fit with the nuisances that reserved observations own fitted to them, and its predictions.

    Parameters
    ----------
    case : Case
    fit : Fit
    observations : sequence of Observation
        Reserved ones.

    Returns
    -------
    fit : Fit
        With these values alone changed.
    predictions : list of (n,) array of float

    Raises
    ------
    SimulationError
        If the model cannot be simulated there.
    """
    joint = JointProblem(case, fit.candidates, observations)
    theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
    owners = {o.name for o in observations}
    is_owned = np.array([n.owner in owners for n in case.nuisances] + [False] * fit.psi.size, dtype=bool)
    predictions = joint.predict(theta)
    if not is_owned.any():
        return fit, predictions
    residuals = joint.residuals(predictions)
    cost = joint.cost(theta, residuals)
    for _ in range(THRESHOLDS.max_reserved_steps):
        step = _owned_step(case, joint, theta, fit.terms, predictions, residuals, is_owned)
        trials = (_try_step(joint, theta, is_owned, 0.5**h * step) for h in range(THRESHOLDS.n_step_trials))
        improvement = next((f for f in trials if f is not None and f.cost < cost), None)
        if improvement is None:
            break
        gain = cost - improvement.cost
        theta, predictions, residuals, cost = improvement
        if gain < THRESHOLDS.min_cost_decrease:
            break
    return replace(fit, values=joint.split(theta)[0]), predictions


def _owned_step(
    case: Case,
    joint: JointProblem,
    theta: np.ndarray,
    terms: tuple[Any, ...],
    predictions: Sequence[np.ndarray],
    residuals: Sequence[np.ndarray],
    is_owned: np.ndarray,
) -> np.ndarray:
    """Gauss-Newton step of the nuisances that the observations own, at most one prior standard deviation each."""
    white = _owned_columns(case, joint, theta, terms, predictions, is_owned)
    scale = {data_type: max(1.0, v) for data_type, v in joint.level(residuals).items()}
    rows, right = joint.stack(white, residuals, scale)
    scaled = rows * joint.sd[is_owned]
    pull = (joint.mean[is_owned] - theta[is_owned]) / joint.sd[is_owned]
    step = np.linalg.solve(scaled.T @ scaled + np.eye(int(is_owned.sum())), scaled.T @ right + pull)
    return joint.sd[is_owned] * np.clip(step, -1.0, 1.0)


def _try_step(joint: JointProblem, theta: np.ndarray, is_owned: np.ndarray, step: np.ndarray) -> FitPoint | None:
    trial = theta.copy()
    trial[is_owned] += step
    predictions = joint.predict_or_none(trial)
    if predictions is None:
        return None
    residuals = joint.residuals(predictions)
    return FitPoint(trial, predictions, residuals, joint.cost(trial, residuals))


def _owned_columns(
    case: Case,
    joint: JointProblem,
    theta: np.ndarray,
    terms: tuple[Any, ...],
    predictions: Sequence[np.ndarray],
    is_owned: np.ndarray,
) -> list[np.ndarray]:
    """Whitened derivatives by the owned nuisances, for each observation by its own alone."""
    values, jacobians = joint.split(theta)[0], []
    owned = [n for n, selected in zip(case.nuisances, is_owned) if selected]
    for o, p in zip(joint.observations, predictions):
        columns = np.zeros((o.data.size, len(owned)))
        selected = [k for k, n in enumerate(owned) if n.owner == o.name]
        if selected:
            columns[:, selected] = case.own_jacobian(values, terms, o, p, [owned[k].name for k in selected])
        jacobians.append(o.whiten(columns))
    return jacobians


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
    predictions : list of array
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
