"""Second question: what has changed, and since when? Two tests: of the innovations, and of the drift of the belief."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from turnout.mismatch.calibrated.belief import StateParameter, scatter_sd
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.history import History, Step


@dataclass(frozen=True)
class ChangeEffect:
    """An effect that appears at an unknown visit.

    Attributes
    ----------
    name : str
    direction : mapping of str to float
        Parameter -> change per unit of size.
    sd : float
        Prior standard deviation of the size. For an effect that grows, that of the change at the last visit, so that
        growth and step differ in their course and not in their prior.
    grows : bool
        Whether the size is one per year.
    group, position : str, float or None
        Of an effect on several parameters of one group. An effect on one parameter has those of the parameter.
    not_before : float
        Time before which it cannot begin, because an accepted change explains what happened until then. [years]
    """

    name: str
    direction: Mapping[str, float]
    sd: float
    grows: bool = False
    group: str = ""
    position: float | None = None
    not_before: float = -np.inf


@dataclass(frozen=True)
class OnsetEvidence:
    """Evidence for one effect by the visit at which it appears.

    ``gains`` (n_visit - 1,): evidence of an onset before each visit from the second on, over no change. [nats]
    ``sizes`` and ``size_sds`` of the same shape: size of the effect with that onset. ``times`` (n_visit,) [years].
    ``from_first`` is the evidence of the effect in all visits, with the same size. [nats]
    """

    effect: ChangeEffect
    visits: tuple[str, ...]
    times: np.ndarray
    gains: np.ndarray
    sizes: np.ndarray
    size_sds: np.ndarray
    from_first: float = -np.inf

    @property
    def gain(self) -> float:
        """Evidence over all onsets, which are equally probable before. [nats]"""
        top = float(self.gains.max())
        return top + float(np.log(np.mean(np.exp(self.gains - top))))

    @property
    def posterior(self) -> np.ndarray:
        """(n_visit - 1,) probability of each onset, given that the effect appears."""
        weights = np.exp(self.gains - self.gains.max())
        return weights / weights.sum()

    @property
    def onset(self) -> str:
        """First visit with the effect, the most probable one."""
        return self.visits[1 + int(np.argmax(self.gains))]

    @property
    def size(self) -> tuple[float, float]:
        """Size, or growth per year, and its standard deviation over all onsets."""
        p = self.posterior
        mean = float(p @ self.sizes)
        return mean, float(np.sqrt(p @ (self.size_sds**2 + (self.sizes - mean) ** 2)))


def change_sd(parameter: StateParameter, parameters: Sequence[StateParameter]) -> float:
    """Prior standard deviation of a change of one parameter.

    ``CALIBRATION.change_sds`` times ``scatter_sd``: where the file is unsure of a value, a change is no larger.

    Parameters
    ----------
    parameter : StateParameter
    parameters : sequence of StateParameter
        All of the model.

    Returns
    -------
    float
        In the unit of the parameter.
    """
    return CALIBRATION.change_sds * scatter_sd(parameter, parameters)


def compare_onsets(history: History, effects: Sequence[ChangeEffect]) -> list[OnsetEvidence]:
    r"""Evidence of each effect and onset against no change but the random walk, the strongest effect first.

    With an effect of size a from visit j on, the innovation of visit v has the mean :math:`\Lambda_v e_v a`, where
    :math:`e_v = c_v f - u_v`, :math:`c_v` is 1 or the time since the onset, f the direction, and :math:`u_v` what the
    belief has already absorbed: :math:`u_{v+1} = u_v + P_v \Lambda_v e_v`. With the prior :math:`N(0, s^2)` of a (of
    growth: s is the prior standard deviation of the size at the last visit over the time since the onset)

    .. math:: g = \frac{b^2}{2 (A + s^{-2})} - \frac12 \ln(1 + s^2 A), \quad
              A = \sum_v e_v^T (\Lambda_v - \Lambda_v P_v \Lambda_v) e_v, \quad
              b = \sum_v e_v^T (\nu_v - \Lambda_v P_v \nu_v)

    which equals the logarithm of the ratio of the probabilities of all data with and without the effect. Growth that
    only the last visit shows is the step there, and counted as that.

    Parameters
    ----------
    history : History
        Its visits must all have been used (``accepted=None``), so that a change is not hidden by rejecting it, and
        errors of the model must count within visits alone (``repeats_between_visits=False``).
    effects : sequence of ChangeEffect

    Returns
    -------
    list of OnsetEvidence
        [] with fewer than two visits.

    Raises
    ------
    ValueError
        If an effect has a parameter that is not in the history.

    References
    ----------
    Willsky and Jones 1976, A generalized likelihood ratio approach to the detection and estimation of jumps.
    """
    steps = history.steps
    if len(steps) < 2 or not effects:
        return []
    directions = np.column_stack([direction_of(history, e) for e in effects])
    grows = np.array([e.grows for e in effects])
    information, score = (np.zeros((len(steps), len(effects))) for _ in range(2))
    for j in range(len(steps)):
        courses = [np.where(grows & (j > 0), step.time - steps[j - 1].time, 1.0) for step in steps[j:]]
        information[j], score[j] = information_and_score(steps[j:], directions, courses)
    times = np.array([s.time for s in steps])
    duration = np.where(grows, np.concatenate([[1.0], times[-1] - times[:-1]])[:, None], 1.0)  # (n_visit, n_effect)
    precision = (duration / np.array([e.sd for e in effects])) ** 2
    sizes = score / (information + precision)
    gains = 0.5 * score * sizes - 0.5 * np.log1p(information / precision)
    sds = 1.0 / np.sqrt(information + precision)
    visits = tuple(s.visit for s in steps)
    is_excluded = times[:-1, None] < np.array([e.not_before for e in effects])  # (n_visit - 1, n_effect)
    is_excluded[-1] |= grows
    gains[1:][is_excluded] = -np.inf
    evidence = [
        OnsetEvidence(e, visits, times, gains[1:, k], sizes[1:, k], sds[1:, k], float(gains[0, k]))
        for k, e in enumerate(effects)
        if not is_excluded[:, k].all()
    ]
    return sorted(evidence, key=lambda e: -e.gain)


def information_and_score(
    steps: Sequence[Step], directions: np.ndarray, courses: Sequence[np.ndarray | float]
) -> tuple[np.ndarray, np.ndarray]:
    """A and b of ``compare_onsets``, of effects that begin with the first of these steps.

    Parameters
    ----------
    steps : sequence of Step
    directions : (n_parameter, n_effect) array of float
    courses : sequence of (n_effect,) array of float, or of float
        Size at each step.

    Returns
    -------
    information, score : (n_effect,) array of float
    """
    information, score = np.zeros((2, directions.shape[1]))
    absorbed = np.zeros_like(directions)
    for step, course in zip(steps, courses, strict=True):
        missing = course * directions - absorbed
        seen = step.matrix @ missing
        nu = step.vector - step.matrix @ step.predicted.mean
        gained = (step.belief.covariance if step.is_used else _updated_covariance(step)) @ seen
        information += np.sum(missing * seen, axis=0) - np.sum(seen * gained, axis=0)
        score += nu @ missing - nu @ gained
        if step.is_used:
            absorbed = absorbed + gained
    return information, score


def _updated_covariance(step: Step) -> np.ndarray:
    return step.predicted.update(step.matrix, step.vector).covariance


def direction_of(history: History, effect: ChangeEffect) -> np.ndarray:
    """Change of all parameters of a history per unit of size of an effect.

    Parameters
    ----------
    history : History
    effect : ChangeEffect

    Returns
    -------
    (n_parameter,) array of float

    Raises
    ------
    ValueError
        If the effect has a parameter that is not in the history.
    """
    names = [p.name for p in history.parameters]
    if unknown := [name for name in effect.direction if name not in names]:
        raise ValueError(f"effect {effect.name!r}: {unknown[0]!r} is no parameter of this model")
    return np.array([effect.direction.get(name, 0.0) for name in names])


def drift_since(history: History, reference: str) -> tuple[np.ndarray, np.ndarray]:
    r"""Change of all parameters since a reference visit, by all visits up to the last.

    .. math:: d = m_v - m_{ref|v}, \quad \mathrm{cov}\, d = P_v + P_{ref|v} - C - C^T

    C is the covariance of the present parameters with those at the reference. Both are estimated from all visits.
    A slow change that the random walk follows leaves no innovation, but this drift. The drift lags behind the
    change, since the random walk expects less: the size of an effect that ``grows`` does not.

    Parameters
    ----------
    history : History
    reference : str
        A visit of the history at which the track was intact.

    Returns
    -------
    drift : (n,) array of float
    covariance : (n, n) array of float

    Raises
    ------
    ValueError
        If the reference is no visit of the history.
    """
    visits = [s.visit for s in history.steps]
    if reference not in visits:
        raise ValueError(f"{reference!r} is no visit of this history; there are {', '.join(visits) or 'none'}")
    first = visits.index(reference)
    start = history.steps[first].belief
    mean, covariance, cross = start.mean, start.covariance, start.covariance  # cross: present with reference
    for step in history.steps[first + 1 :]:
        if not step.is_used:
            continue
        nu, posterior = step.vector - step.matrix @ step.predicted.mean, step.belief.covariance
        mean = mean + cross.T @ (nu - step.matrix @ (posterior @ nu))
        covariance = covariance - cross.T @ (step.matrix - step.matrix @ posterior @ step.matrix) @ cross
        cross = cross - posterior @ (step.matrix @ cross)
    drift_covariance = history.belief.covariance + covariance - cross - cross.T
    return history.belief.mean - mean, 0.5 * (drift_covariance + drift_covariance.T)
