"""Least-squares problem of nuisances and term parameters together: predictions, cost and derivatives at a point."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.case_check import checked_predictions
from turnout.mismatch.engine.fit import terms_of
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.observation import Observation
    from turnout.physics import Parameter


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
        self.min_decrease = max(2.0 * min_gain, stall * size if case.is_large else 0.0)
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
            If the model cannot be simulated there, or a parameter or prediction is not finite.
        CaseError
            If there is not one prediction for each observation, of the shape of its data.
        """
        if not np.all(np.isfinite(theta)):  # derivatives of an extreme model may overflow
            raise SimulationError("the parameters are not all finite")
        values, psi = self.split(theta)
        self.evaluations += 1
        predictions = self.case.predict(values, terms_of(self.candidates, psi), self.observations)
        return checked_predictions(self.observations, predictions)

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
        residuals : sequence of (n,) array of float
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
            Nuisances, then parameters of the effects.
        predictions : sequence of (n,) array of float
            Those at ``theta``, by observation.
        reused : sequence of (n, p) array of float or None
            An earlier Jacobian, from which the columns of the nuisances are taken.

        Returns
        -------
        list of (n, p) array of float
            By observation; in single precision in a large case.

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
        return [j.astype(np.float32) for j in full] if self.case.is_large else full

    def with_new_hammer_columns(
        self, theta: np.ndarray, predictions: Sequence[np.ndarray], jacobian: list[np.ndarray]
    ) -> list[np.ndarray]:
        """The Jacobian with new derivatives of hammer tests.

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
        chosen = [i for i, o in enumerate(self.observations) if self.case.is_hammer_test(o)]
        if not chosen:
            return jacobian
        hammer_problem = JointProblem(self.case, self.candidates, [self.observations[i] for i in chosen])
        hammer_jacobian = hammer_problem.jacobian(theta, [predictions[i] for i in chosen])
        updated = list(jacobian)
        for i, j in zip(chosen, hammer_jacobian):
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
                shifted_predictions = checked_predictions(self.observations, shifted_predictions)
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
