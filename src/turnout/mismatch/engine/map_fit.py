"""Joint maximum a posteriori fit of nuisances and term parameters: damped Gauss-Newton steps within a trust region.

The result is a ``Fit``, with all that later steps of the diagnosis need.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.levenberg_marquardt import DampedSteps, FitPoint, broyden_update
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case, Observation
    from turnout.physics import Parameter


@dataclass(frozen=True)
class Fit:
    """Result of a joint fit.

    ``values`` of nuisances, ``psi`` (n_term,) of the terms. ``residuals`` list by observation, ``white`` the same
    whitened. ``jacobian`` whitened too; [] in a fit ``without_jacobian``, in single precision in an expensive case.
    ``scale`` noise scale by data type, at least 1. ``cost`` minus twice the log posterior up to a constant.
    ``covariance`` of nuisances and psi. ``level`` weighted mean square by data type, in units of ``sigma``.
    ``evidence`` log probability of the data by Laplace's approximation, up to a constant of the case. [nats]
    """

    values: dict[str, float]
    candidates: tuple[Candidate, ...]
    psi: np.ndarray
    predictions: list[np.ndarray]
    residuals: list[np.ndarray]
    jacobian: list[np.ndarray]
    scale: dict[str, float]
    level: dict[str, float]
    cost: float
    covariance: np.ndarray
    evaluations: int
    white: list[np.ndarray]
    evidence: float = 0.0

    @property
    def terms(self) -> tuple[Any, ...]:
        """The terms with their fitted parameters."""
        return terms_of(self.candidates, self.psi)

    def without_jacobian(self) -> Fit:
        """The same fit without its Jacobian, by far its largest item."""
        return replace(self, jacobian=[])

    def with_candidates(self, candidates: Iterable[Candidate]) -> Fit:
        """The same fit with other candidates, which carry functions and are not stored on disk.

        Parameters
        ----------
        candidates : iterable of Candidate

        Returns
        -------
        Fit
        """
        return replace(self, candidates=tuple(candidates))

    def part(self, candidate: Candidate) -> slice:
        """Slice of the parameters of a candidate in ``psi``.

        Parameters
        ----------
        candidate : Candidate

        Returns
        -------
        slice

        Raises
        ------
        KeyError
            If the candidate is not in this fit.
        """
        first = 0
        for fitted in self.candidates:
            last = first + len(fitted.parameters)
            if fitted.key == candidate.key:
                return slice(first, last)
            first = last
        raise KeyError(f"{candidate.key} is not in this fit")

    @property
    def psi_se(self) -> np.ndarray:
        """(n_term,) standard errors of the terms' parameters; a size also errs by its ``model_error_share``."""
        errors, first = np.sqrt(np.maximum(np.diag(self.covariance)[len(self.values) :], 0.0)), 0
        for candidate in self.candidates:
            if candidate.parameters:
                size = self.psi[first] - candidate.parameters[0].neutral
                errors[first] = np.hypot(errors[first], candidate.effect.model_error_share * size)
            first += len(candidate.parameters)
        return errors


def terms_of(candidates: Sequence[Candidate], psi: np.ndarray) -> tuple[Any, ...]:
    """Terms of several candidates from their stacked parameters.

    Parameters
    ----------
    candidates : sequence of Candidate
    psi : (n_term,) array of float

    Returns
    -------
    tuple of terms
        As ``Case.predict`` takes them.
    """
    terms, first = [], 0
    for candidate in candidates:
        last = first + len(candidate.parameters)
        terms.append(candidate.term(psi[first:last]))
        first = last
    return tuple(terms)


class JointProblem:
    """Least-squares problem of a case with some candidates: all that does not change between steps."""

    def __init__(
        self,
        case: Case,
        candidates: Iterable[Candidate] = (),
        observations: Iterable[Observation] | None = None,
        iterations: int = THRESHOLDS.n_steps,
        min_gain: float = THRESHOLDS.min_gain,
        stall: float = THRESHOLDS.stall,
    ) -> None:
        self.case, self.candidates = case, tuple(candidates)
        self.observations = tuple(case.observations if observations is None else observations)
        self.parameters = [p for c in self.candidates for p in c.parameters]
        self.iterations, self.evaluations = iterations, 0
        size = sum(o.n_effective for o in self.observations)
        self.min_decrease = max(2.0 * min_gain, stall * size if case.expensive else 0.0)
        priors = [(n.mean, n.sd) for n in case.nuisances] + [_prior(p) for p in self.parameters]
        self.mean, self.sd = np.array(priors, dtype=float).reshape(-1, 2).T.copy()
        bounds = [n.bounds for n in case.nuisances] + [p.bounds for p in self.parameters]
        self.low, self.high = np.array(bounds, dtype=float).reshape(-1, 2).T
        self.n = len(case.nuisances)
        self.reach = np.array([n.max_step_sd * n.sd for n in case.nuisances] + [_max_step(p) for p in self.parameters])

    def split(self, theta: np.ndarray) -> tuple[dict[str, float], np.ndarray]:
        """Parameters of the fit, taken apart.

        Parameters
        ----------
        theta : (n,) array of float
            Nuisances, then parameters of the effects.

        Returns
        -------
        values : dict
            Nuisance parameter -> value.
        psi : (n_term,) array of float
            Parameters of the effects.
        """
        return {n.name: float(v) for n, v in zip(self.case.nuisances, theta)}, np.asarray(theta[self.n :])

    def predict(self, theta: np.ndarray) -> list[np.ndarray]:
        """Predictions with these parameters.

        Parameters
        ----------
        theta : (n,) array of float
            Nuisances, then parameters of the effects.

        Returns
        -------
        list of (n,) array of float
            By observation.

        Raises
        ------
        SimulationError
            If the model cannot be simulated there.
        """
        values, psi = self.split(theta)
        self.evaluations += 1
        return self.case.predict(values, terms_of(self.candidates, psi), self.observations)

    def predict_or_none(self, theta: np.ndarray) -> list[np.ndarray] | None:
        """Predictions with these parameters.

        Parameters
        ----------
        theta : (n,) array of float
            Nuisances, then parameters of the effects.

        Returns
        -------
        list of (n,) array of float, or None
            None if the simulation fails.
        """
        try:
            return self.predict(theta)
        except SimulationError:
            return None

    def residuals(self, predictions: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Data minus prediction, whitened.

        Parameters
        ----------
        predictions : sequence of (n,) array of float
            By observation.

        Returns
        -------
        list of (n,) array of float
        """
        return [o.whiten(o.data - p) for o, p in zip(self.observations, predictions)]

    def level(self, residuals: Sequence[np.ndarray]) -> dict[str, float]:
        """Mean square of whitened residuals.

        Parameters
        ----------
        residuals : sequence of (n,) array of float
            By observation.

        Returns
        -------
        dict
            Data type -> weighted mean square.
        """
        total: dict[str, float] = {}
        count: dict[str, float] = {}
        for o, r in zip(self.observations, residuals):
            total[o.data_type] = total.get(o.data_type, 0.0) + o.effective * float(np.sum(r**2))
            count[o.data_type] = count.get(o.data_type, 0.0) + o.n_effective
        return {data_type: total[data_type] / count[data_type] for data_type in total}

    def cost(self, theta: np.ndarray, residuals: Sequence[np.ndarray]) -> float:
        """Minus twice the log posterior with the noise scale at its best value, never below 1.

        Parameters
        ----------
        theta : (n,) array of float
            Nuisances, then parameters of the effects.
        residuals : sequence of array
            Whitened residuals at ``theta``, by observation.

        Returns
        -------
        float
        """
        level, value = self.level(residuals), 0.0
        for data_type, mean_square in level.items():
            n = sum(o.n_effective for o in self.observations if o.data_type == data_type)
            scale = max(1.0, mean_square)
            value += n * (np.log(scale) + mean_square / scale)
        return value + float(np.sum(((theta - self.mean) / self.sd) ** 2))

    def stack(
        self, jacobian: Sequence[np.ndarray], residuals: Sequence[np.ndarray], scale: Mapping[str, float]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Weighted Jacobian and residual of all observations, one below the other.

        Parameters
        ----------
        jacobian : sequence of (n, p) array of float
            Whitened, by observation.
        residuals : sequence of (n,) array of float
            Whitened, by observation.
        scale : mapping
            Noise scale by data type.

        Returns
        -------
        rows : (n, p) array of float
        right : (n,) array of float
        """
        rows, right = [], []
        for o, j, r in zip(self.observations, jacobian, residuals):
            weight = np.sqrt(o.effective / scale[o.data_type])
            rows.append(weight * j)
            right.append(weight * r)
        return np.concatenate(rows), np.concatenate(right)

    def jacobian(
        self, theta: np.ndarray, predictions: Sequence[np.ndarray], reused: Sequence[np.ndarray] | None = None
    ) -> list[np.ndarray]:
        """Whitened derivatives at ``theta``.

        Parameters
        ----------
        theta : (p,) array of float
        predictions : sequence of array
            Those at ``theta``.
        reused : sequence of array or None
            An earlier Jacobian, from which the columns of the nuisances are taken.

        Returns
        -------
        list of (n, p) array of float
            By observation; in single precision in an expensive case.

        Raises
        ------
        SimulationError
            If the model cannot be simulated on either side of a parameter.
        """
        values, psi = self.split(theta)
        terms = terms_of(self.candidates, psi)
        if reused is None:
            base = self.case.nuisance_jacobian(values, terms, self.observations, predictions)
            base = [o.whiten(j) for o, j in zip(self.observations, base)]
        else:
            base = [j[:, : self.n] for j in reused]
        columns = [self._column(theta, k, predictions) for k in range(self.n, theta.size)]
        full = [np.column_stack([j, *(c[i] for c in columns)]) if columns else np.array(j) for i, j in enumerate(base)]
        return [j.astype(np.float32) for j in full] if self.case.expensive else full

    def with_new_cheap_columns(
        self, theta: np.ndarray, predictions: Sequence[np.ndarray], jacobian: list[np.ndarray]
    ) -> list[np.ndarray]:
        """The Jacobian with new derivatives of cheap observations.

        Parameters
        ----------
        theta : (n,) array of float
            Nuisances, then parameters of the effects.
        predictions : sequence of (n,) array of float
            Those at ``theta``.
        jacobian : list of (n, p) array of float
            By observation.

        Returns
        -------
        list of (n, p) array of float

        Raises
        ------
        SimulationError
            If the model cannot be simulated on either side of a parameter.
        """
        chosen = [i for i, o in enumerate(self.observations) if self.case.is_cheap(o)]
        if not chosen:
            return jacobian
        cheap_problem = JointProblem(self.case, self.candidates, [self.observations[i] for i in chosen])
        cheap_jacobian = cheap_problem.jacobian(theta, [predictions[i] for i in chosen])
        updated = list(jacobian)
        for i, j in zip(chosen, cheap_jacobian):
            updated[i] = j
        return updated

    def _column(self, theta: np.ndarray, k: int, predictions: Sequence[np.ndarray]) -> list[np.ndarray]:
        p = self.parameters[k - self.n]
        size = max(abs(theta[k] - p.neutral), THRESHOLDS.min_derivative_size * _max_step(p))
        scales = p.bounds[1] - p.bounds[0], THRESHOLDS.derivative_sds * self.sd[k], size
        step = THRESHOLDS.derivative_step * min(scales)
        step = -step if theta[k] + step > p.bounds[1] else step
        values, psi = self.split(theta)
        terms = terms_of(self.candidates, psi)
        for increment in (step, -step):  # the simulation may fail on one side
            shifted = np.array(psi)
            shifted[k - self.n] += increment
            self.evaluations += 1
            try:
                shifted_predictions = self.case.predict_near(
                    values, terms, terms_of(self.candidates, shifted), self.observations, predictions
                )
                break
            except SimulationError:
                continue
        else:
            raise SimulationError(f"{p.name} {theta[k]:.4g} {p.unit}: no derivative, the simulation fails beside it.")
        return [o.whiten((b - a) / increment) for o, a, b in zip(self.observations, predictions, shifted_predictions)]


def _prior(p: Parameter) -> tuple[float, float]:
    low, high = p.bounds
    return p.prior if p.prior else (0.5 * (low + high), THRESHOLDS.default_prior_sd * (high - low))


def _max_step(p: Parameter) -> float:
    return THRESHOLDS.max_term_step * (p.bounds[1] - p.bounds[0])


def cost_at(case: Case, candidates: Iterable[Candidate], psi: np.ndarray, values: Mapping[str, float]) -> float:
    """Minus twice the log posterior at these parameters and nuisances, without a fit.

    Parameters
    ----------
    case : Case
    candidates : iterable of Candidate
    psi : (n_term,) array of float
        Their parameters.
    values : mapping
        Nuisance parameter -> value; others are at their prior mean.

    Returns
    -------
    float

    Raises
    ------
    SimulationError
        If the model cannot be simulated there.
    """
    joint = JointProblem(case, candidates)
    theta = np.concatenate([[values.get(n.name, n.mean) for n in case.nuisances], psi])
    return joint.cost(theta, joint.residuals(joint.predict(theta)))


def fit_jointly(
    case: Case,
    candidates: Iterable[Candidate] = (),
    start: ArrayLike | None = None,
    values: Mapping[str, float] | None = None,
    reused_jacobian: Sequence[np.ndarray] | None = None,
    observations: Iterable[Observation] | None = None,
    iterations: int = THRESHOLDS.n_steps,
    min_gain: float = THRESHOLDS.min_gain,
    stall: float = THRESHOLDS.stall,
) -> Fit:
    r"""Maximum of the posterior of nuisances and term parameters together.

    .. math:: \min_{\eta,\psi} \sum_k n_k \left[\ln s_k^2 + \overline{r^2}_k / s_k^2\right]
              + \sum (\eta - \mu)^2 / \sigma_\eta^2, \quad s_k \ge 1

    Damped Gauss-Newton steps (Levenberg and Marquardt).

    Parameters
    ----------
    case : Case
    candidates : iterable of Candidate
        Effects in the model.
    start : (n_term,) array of float or None
        Parameters of the effects where the fit starts; None: neutral.
    values : mapping or None
        Nuisance parameters where the fit starts; others start where the case says, or at their prior mean.
    reused_jacobian : sequence of array or None
        Its nuisance columns are used instead of new ones, and updated by Broyden's formula.
    observations : iterable of Observation or None
        Those that are fitted; None: all of the case.
    iterations : int
        Largest number of steps.
    min_gain : float
        A step that gains less is the last. [nats]
    stall : float
        The same for an expensive case, as a share of the cost per sample.

    Returns
    -------
    Fit

    Raises
    ------
    SimulationError
        If the model cannot be simulated at the start, or beside a point at which derivatives are needed.
    """
    joint = JointProblem(case, candidates, observations, iterations, min_gain, stall)
    psi = np.array([p.neutral for p in joint.parameters]) if start is None else np.asarray(start, dtype=float)
    start_values = {**case.start_values, **(values or {})}
    theta = np.concatenate([[start_values.get(n.name, n.mean) for n in case.nuisances], psi])
    predictions = joint.predict(theta)
    residuals = joint.residuals(predictions)
    point = FitPoint(theta, predictions, residuals, joint.cost(theta, residuals))
    if not theta.size:
        return _fit_result(joint, point, [np.zeros((o.data.size, 0)) for o in joint.observations])
    jacobian = joint.jacobian(theta, predictions, reused_jacobian)
    if reused_jacobian is not None:
        jacobian = joint.with_new_cheap_columns(theta, predictions, jacobian)
    refresh_steps = THRESHOLDS.n_refresh_steps if reused_jacobian is None else 0
    return _fit_result(joint, *_iterate(joint, point, jacobian, refresh_steps))


def _iterate(
    joint: JointProblem, point: FitPoint, jacobian: list[np.ndarray], refresh_steps: int
) -> tuple[FitPoint, list[np.ndarray]]:
    """Steps until nothing is gained.

    The Jacobian of an expensive case is updated. It is recomputed after every ``refresh_steps`` steps (0: never) and
    before the last one, since after many updates its directions are wrong.
    """
    expensive = joint.case.expensive
    min_decrease, n_since_refresh, damping = joint.min_decrease, 0, 0.0
    for _ in range(joint.iterations):
        steps = DampedSteps(joint, point.theta, point.residuals, jacobian)
        is_updated = expensive and refresh_steps > 0 and n_since_refresh > 0
        improvement, damping = steps.first_improvement(point.cost, damping, 1 if is_updated else None)
        if is_updated and not improvement:  # new derivatives before smaller steps
            jacobian, n_since_refresh = _refreshed_jacobian(joint, point, jacobian), 0
            steps = DampedSteps(joint, point.theta, point.residuals, jacobian)
            improvement, damping = steps.first_improvement(point.cost, damping)
        gain = point.cost - improvement.cost if improvement else 0.0
        if improvement:
            if expensive:
                jacobian = _updated_jacobian(joint, jacobian, point, improvement)
            point = improvement
        n_since_refresh += 1
        if (
            gain < min_decrease
            and not (improvement and damping > THRESHOLDS.first_damping)
            and (n_since_refresh == 1 or not (expensive and refresh_steps))
        ):
            break
        if not expensive or 0 < refresh_steps <= n_since_refresh or (refresh_steps and gain < min_decrease):
            jacobian, n_since_refresh = _refreshed_jacobian(joint, point, jacobian), 0
    else:
        if refresh_steps and n_since_refresh:
            jacobian = _refreshed_jacobian(joint, point, jacobian)
    return point, jacobian


def _updated_jacobian(
    joint: JointProblem, jacobian: list[np.ndarray], before: FitPoint, after: FitPoint
) -> list[np.ndarray]:
    """The Jacobian after a step, updated; new for the cheap observations."""
    step = after.theta - before.theta
    jacobian = broyden_update(jacobian, step / joint.sd**2, step, before.residuals, after.residuals)
    return joint.with_new_cheap_columns(after.theta, after.predictions, jacobian)


def _refreshed_jacobian(joint: JointProblem, point: FitPoint, updated: list[np.ndarray]) -> list[np.ndarray]:
    """A new Jacobian. In an expensive case the ``updated`` one if the simulation fails close to the point."""
    try:
        return joint.jacobian(point.theta, point.predictions)
    except SimulationError:
        if joint.case.expensive:
            return updated
        raise


def _fit_result(joint: JointProblem, point: FitPoint, jacobian: list[np.ndarray]) -> Fit:
    """The fit that ends at this point, with its covariance and evidence."""
    level, n = joint.level(point.residuals), point.theta.size
    scale = {data_type: max(1.0, v) for data_type, v in level.items()}
    covariance: np.ndarray = np.zeros((n, n))
    evidence = -0.5 * point.cost
    if n:
        normal = np.eye(n)
        for o, j in zip(joint.observations, jacobian):
            scaled = np.sqrt(o.effective / scale[o.data_type]) * j * joint.sd
            normal += scaled.T @ scaled
        covariance = np.linalg.inv(normal) * np.outer(joint.sd, joint.sd)
        evidence -= 0.5 * float(np.linalg.slogdet(normal)[1])
    values, psi = joint.split(point.theta)
    plain = [o.data - p for o, p in zip(joint.observations, point.predictions)]
    return Fit(
        values, joint.candidates, psi, point.predictions, plain, jacobian, scale, level, point.cost, covariance,
        joint.evaluations, point.residuals, evidence,
    )  # fmt: skip
