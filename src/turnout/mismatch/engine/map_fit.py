"""Joint maximum a posteriori fit of nuisances and term parameters: damped Gauss-Newton steps within a trust region.

The result is a ``Fit``, with all that later steps of the diagnosis need.
"""

from dataclasses import dataclass, replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.levenberg_marquardt import FIRST, Steps, broyden


@dataclass(frozen=True)
class Fit:
    """Result of a joint fit.

    ``values`` of nuisances, ``psi`` (n_term,) of the terms. ``residuals`` list by observation, ``white`` the same
    whitened. ``jacobian`` whitened too; [] in a fit ``without_jacobian``, in single precision in an expensive case.
    ``scale`` noise scale by data type, at least 1. ``cost`` minus twice the log posterior up to a constant.
    ``covariance`` of nuisances and psi. ``level`` weighted mean square by data type, in units of ``sigma``.
    ``evidence`` log probability of the data by Laplace's approximation, up to a constant of the case. [nats]
    """

    values: dict
    candidates: tuple
    psi: np.ndarray
    predictions: list
    residuals: list
    jacobian: list
    scale: dict
    level: dict
    cost: float
    covariance: np.ndarray
    evaluations: int
    white: list
    evidence: float = 0.0

    @property
    def terms(self):
        """The terms with their fitted parameters."""
        return terms_of(self.candidates, self.psi)

    def light(self):
        """The same fit without its Jacobian, by far its largest item."""
        return replace(self, jacobian=[])

    def with_candidates(self, candidates):
        """The same fit with these candidates, which carry functions and are not stored on disk."""
        return replace(self, candidates=tuple(candidates))

    def part(self, candidate):
        """Slice of the parameters of ``candidate`` in ``psi``."""
        first = 0
        for known in self.candidates:
            last = first + len(known.parameters)
            if known.key == candidate.key:
                return slice(first, last)
            first = last
        raise KeyError(f"{candidate.key} is not in this fit")

    @property
    def psi_se(self):
        """(n_term,) standard errors of the terms' parameters; a size also errs by its ``model_error_share``."""
        found, first = np.sqrt(np.maximum(np.diag(self.covariance)[len(self.values) :], 0.0)), 0
        for candidate in self.candidates:
            if candidate.parameters:
                size = self.psi[first] - candidate.parameters[0].neutral
                found[first] = np.hypot(found[first], candidate.loose * size)
            first += len(candidate.parameters)
        return found


def terms_of(candidates, psi):
    """Terms of several candidates from their stacked parameters."""
    terms, first = [], 0
    for candidate in candidates:
        last = first + len(candidate.parameters)
        terms.append(candidate.term(psi[first:last]))
        first = last
    return tuple(terms)


TRUST_TERM = 0.35  # largest step of a term's parameter as a share of its bounds
DONE = 0.05  # nats; a smaller gain ends the iteration
CHEAP_STEPS = 60  # steps of a fit to cheap observations alone: some valleys are long
RENEWED = 4  # steps after which the Jacobian of an expensive case is computed anew
STALL = 5e-4  # of minus twice the log posterior per sample; a fit of an expensive case that gains less ends
FINE = 1e-4  # the same for fits on which the verdict rests


class Joint:
    """Least-squares problem of a case with some candidates: all that does not change between steps."""

    def __init__(self, case, candidates=(), observations=None, iterations=6, done=DONE, stall=STALL):
        self.case, self.candidates = case, tuple(candidates)
        self.observations = tuple(case.observations if observations is None else observations)
        self.parameters = [p for c in self.candidates for p in c.parameters]
        self.iterations, self.evaluations = iterations, 0
        size = sum(o.n_effective for o in self.observations)
        self.enough = max(2.0 * done, stall * size if case.frozen_jacobian else 0.0)
        priors = [(n.mean, n.sd) for n in case.nuisances] + [_prior(p) for p in self.parameters]
        self.mean, self.sd = (np.array(v, dtype=float) for v in zip(*priors)) if priors else (np.zeros(0),) * 2
        bounds = [n.bounds for n in case.nuisances] + [p.bounds for p in self.parameters]
        self.low, self.high = np.array(bounds, dtype=float).T if bounds else (np.zeros(0),) * 2
        self.n = len(case.nuisances)
        self.reach = np.array([n.trust * n.sd for n in case.nuisances] + [_reach(p) for p in self.parameters])

    def split(self, theta):
        """Nuisances by name, and the term parameters."""
        return {n.name: float(v) for n, v in zip(self.case.nuisances, theta)}, np.asarray(theta[self.n :])

    def predict(self, theta):
        """Predictions at ``theta``."""
        values, psi = self.split(theta)
        self.evaluations += 1
        return self.case.predict(values, terms_of(self.candidates, psi), self.observations)

    def tried(self, theta):
        """Predictions at ``theta``, None if the simulation fails."""
        try:
            return self.predict(theta)
        except SimulationError:
            return None

    def residuals(self, predictions):
        """Data minus prediction, whitened."""
        return [o.whitened(o.data - p) for o, p in zip(self.observations, predictions)]

    def level(self, residuals):
        """Mean square of whitened residuals, by data type."""
        total, count = {}, {}
        for o, r in zip(self.observations, residuals):
            total[o.kind] = total.get(o.kind, 0.0) + o.effective * float(np.sum(r**2))
            count[o.kind] = count.get(o.kind, 0.0) + o.n_effective
        return {kind: total[kind] / count[kind] for kind in total}

    def cost(self, theta, residuals):
        """Minus twice the log posterior with the noise scale at its best value, never below 1."""
        level, value = self.level(residuals), 0.0
        for kind, mean_square in level.items():
            n = sum(o.n_effective for o in self.observations if o.kind == kind)
            scale = max(1.0, mean_square)
            value += n * (np.log(scale) + mean_square / scale)
        return value + float(np.sum(((theta - self.mean) / self.sd) ** 2))

    def stacked(self, jacobian, residuals, scale):
        """Stacked weighted Jacobian (n, p) and residual (n,) from whitened ones."""
        rows, right = [], []
        for o, j, r in zip(self.observations, jacobian, residuals):
            weight = np.sqrt(o.effective / scale[o.kind])
            rows.append(weight * j)
            right.append(weight * r)
        return np.concatenate(rows), np.concatenate(right)

    def jacobian(self, theta, predictions, keep=None):
        """Whitened derivatives at ``theta``; those by nuisances from ``reused``, if given."""
        values, psi = self.split(theta)
        terms = terms_of(self.candidates, psi)
        if keep is None:
            base = self.case.nuisance_jacobian(values, terms, self.observations, predictions)
            base = [o.whitened(j) for o, j in zip(self.observations, base)]
        else:
            base = [j[:, : self.n] for j in keep]
        columns = [self._column(theta, k, predictions) for k in range(self.n, theta.size)]
        whole = [np.column_stack([j, *(c[i] for c in columns)]) if columns else np.array(j) for i, j in enumerate(base)]
        return [j.astype(np.float32) for j in whole] if self.case.frozen_jacobian else whole

    def renewed(self, theta, predictions, jacobian):
        """The Jacobian with new derivatives of cheap observations."""
        chosen = [i for i, o in enumerate(self.observations) if self.case.cheap(o)]
        if not chosen:
            return jacobian
        part = Joint(self.case, self.candidates, [self.observations[i] for i in chosen])
        new = part.jacobian(theta, [predictions[i] for i in chosen])
        found = list(jacobian)
        for i, j in zip(chosen, new):
            found[i] = j
        return found

    def _column(self, theta, k, predictions):
        p = self.parameters[k - self.n]
        step = 0.02 * min(p.bounds[1] - p.bounds[0], 10.0 * self.sd[k], max(abs(theta[k] - p.neutral), 0.1 * _reach(p)))
        step = -step if theta[k] + step > p.bounds[1] else step
        values, psi = self.split(theta)
        terms = terms_of(self.candidates, psi)
        for way in (step, -step):  # the simulation may fail on one side
            moved = np.array(psi)
            moved[k - self.n] += way
            self.evaluations += 1
            try:
                new = self.case.moved(values, terms, terms_of(self.candidates, moved), self.observations, predictions)
                break
            except SimulationError:
                continue
        else:
            raise SimulationError(f"{p.name} {theta[k]:.4g} {p.unit}: no derivative, the simulation fails beside it.")
        return [o.whitened((b - a) / way) for o, a, b in zip(self.observations, predictions, new)]


def _prior(p):
    low, high = p.bounds
    return p.prior if p.prior else (0.5 * (low + high), 0.6 * (high - low))


def _reach(p):
    return TRUST_TERM * (p.bounds[1] - p.bounds[0])


def cost_at(case, candidates, psi, values):
    """Minus twice the log posterior at these parameters and nuisances, without a fit."""
    joint = Joint(case, candidates)
    theta = np.concatenate([[values.get(n.name, n.mean) for n in case.nuisances], psi])
    return joint.cost(theta, joint.residuals(joint.predict(theta)))


def fit_jointly(
    case, candidates=(), start=None, values=None, keep=None, observations=None, iterations=6, done=DONE, stall=STALL
):
    r"""Maximum of the posterior of nuisances and term parameters together.

    .. math:: \min_{\eta,\psi} \sum_k n_k \left[\ln s_k^2 + \overline{r^2}_k / s_k^2\right]
              + \sum (\eta - \mu)^2 / \sigma_\eta^2, \quad s_k \ge 1

    Damped Gauss-Newton steps (Levenberg and Marquardt), until a step gains less than ``min_gain`` nats, or in an
    expensive case ``stall`` of the cost per sample. ``start`` (n_term,) of psi. ``values`` of the nuisances. The
    nuisance columns of ``reused_jacobian`` are used instead of new ones, and updated by Broyden's formula.
    """
    joint = Joint(case, candidates, observations, iterations, done, stall)
    psi = np.array([p.neutral for p in joint.parameters]) if start is None else np.asarray(start, dtype=float)
    known = {**case.start_values, **(values or {})}
    first = [known.get(n.name, n.mean) for n in case.nuisances]
    theta = np.concatenate([first, psi])
    predictions = joint.predict(theta)
    residuals = joint.residuals(predictions)
    cost, jacobian = joint.cost(theta, residuals), None
    if theta.size:
        jacobian = joint.jacobian(theta, predictions, keep)
        if keep is not None:
            jacobian = joint.renewed(theta, predictions, jacobian)
        theta, predictions, residuals, jacobian, cost = _iterate(
            joint, theta, predictions, residuals, jacobian, cost, RENEWED if keep is None else 0
        )
    return _finished(joint, theta, predictions, residuals, jacobian, cost)


def _iterate(joint, theta, predictions, residuals, jacobian, cost, renew):
    """Steps until nothing is gained.

    The Jacobian of an expensive case is updated. It is computed anew after every ``refresh_steps`` steps (0: never) and
    before the last one, since after many updates its directions are wrong.
    """
    frozen = joint.case.frozen_jacobian
    enough, since, damping = joint.enough, 0, 0.0
    for _ in range(joint.iterations):
        found, damping = Steps(joint, theta, residuals, jacobian).taken(cost, damping)
        gain = cost - found[3] if found else 0.0
        if found:
            tried, new = found[0], found[1]
            if frozen:
                moved = tried - theta
                jacobian = broyden(jacobian, moved / joint.sd**2, moved, residuals, found[2])
                jacobian = joint.renewed(tried, new, jacobian)
            theta, predictions, residuals, cost = found
        since += 1
        if gain < enough and not (found and damping > FIRST) and (since == 1 or not (frozen and renew)):
            break
        if not frozen or 0 < renew <= since or (renew and gain < enough):
            jacobian, since = _anew(joint, theta, predictions, jacobian), 0
    else:
        jacobian = _anew(joint, theta, predictions, jacobian) if renew and since else jacobian
    return theta, predictions, residuals, jacobian, cost


def _anew(joint, theta, predictions, updated):
    """A new Jacobian. In an expensive case the ``updated`` one if the simulation fails close to ``theta``."""
    try:
        return joint.jacobian(theta, predictions)
    except SimulationError:
        if joint.case.frozen_jacobian:
            return updated
        raise


def _finished(joint, theta, predictions, residuals, jacobian, cost):
    level = joint.level(residuals)
    scale = {kind: max(1.0, v) for kind, v in level.items()}
    covariance, evidence = np.zeros((theta.size, theta.size)), -0.5 * cost
    if theta.size:
        normal = np.eye(theta.size)
        for o, j in zip(joint.observations, jacobian):
            scaled = np.sqrt(o.effective / scale[o.kind]) * j * joint.sd
            normal += scaled.T @ scaled
        covariance = np.linalg.inv(normal) * np.outer(joint.sd, joint.sd)
        evidence -= 0.5 * float(np.linalg.slogdet(normal)[1])
    else:
        jacobian = [np.zeros((o.data.size, 0)) for o in joint.observations]
    values, psi = joint.split(theta)
    plain = [o.data - p for o, p in zip(joint.observations, predictions)]
    return Fit(
        values, joint.candidates, psi, predictions, plain, jacobian, scale, level, cost, covariance,
        joint.evaluations, residuals, evidence,
    )  # fmt: skip
