"""Which candidates are refitted jointly, and from where: scores order the queue, they never speak the verdict."""

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.joint import Joint


def shortlist(case, fit, settings):
    """(candidate, start) pairs in order of promise.

    Places of a family are ranked by the score of their linear columns; the best are then predicted at every start
    of their own, which does not depend on the base fit, and scored with that secant, nuisances free. A case whose
    predictions are cheap has every family refitted from every start; a dear one the ``refits`` most promising
    families.
    """
    projector = Projector(case, fit)
    columns = case.screen(fit)
    families = {}
    for candidate in case.candidates:
        if candidate.key not in {c.key for c in fit.candidates}:
            families.setdefault(candidate.family, []).append(candidate)
    plan = []
    for members in families.values():
        ranked = sorted(members, key=lambda c: -projector.score(columns.get(c.key), c, 0)[0])
        plan += _starts(case, fit, projector, ranked[: settings.joint_starts] if columns else ranked)
    plan.sort(key=lambda entry: -entry[0])
    if case.frozen_jacobian:
        plan = _promising(plan, settings.refits)
    return [(candidate, start) for _, candidate, start in plan]


def _starts(case, fit, projector, candidates):
    found = []
    for candidate in candidates:
        for k, start in enumerate(candidate.starts):
            start = np.asarray(start, dtype=float)
            if not case.frozen_jacobian:
                found.append((0.0, candidate, start))
                continue
            try:
                new = case.predict(fit.values, (*fit.terms, candidate.term(start)), case.observations)
            except SimulationError:  # this effect cannot be simulated at this strength here
                continue
            gain, share = projector.score([a - b for a, b in zip(new, fit.predictions)], candidate, k)
            found.append((gain, candidate, candidate.neutral + share * (start - candidate.neutral)))
    return found


def _promising(plan, refits):
    """The best start of each of the first ``refits`` families, and the runner-up of the first one."""
    chosen, seen = [], {}
    for entry in plan:
        family = entry[1].family
        limit = 2 if family == plan[0][1].family else 1
        if seen.get(family, 0) < limit and (family in seen or len(seen) < refits):
            seen[family] = seen.get(family, 0) + 1
            chosen.append(entry)
    return chosen


class Projector:
    """Scores columns against the residual of ``fit`` with its nuisances projected out."""

    def __init__(self, case, fit):
        self.joint, self.fit = Joint(case, fit.candidates), fit
        rows, self.right = self.joint.whitened(fit.jacobian, fit.residuals, fit.scale)
        self.scaled = rows * self.joint.sd
        self.normal = np.linalg.inv(self.scaled.T @ self.scaled + np.eye(self.scaled.shape[1]))
        theta = np.concatenate([[fit.values[n.name] for n in case.nuisances], fit.psi])
        self.pull = (self.joint.mean - theta) / self.joint.sd

    def score(self, parts, candidate, start):
        r"""(gain, share): best gain in chi-squared along a column, and how much of it, within the bounds.

        .. math:: g = \max_a\, 2a\,c^T P r - a^2 c^T P c, \quad P = I - J (J^T J + I)^{-1} J^T

        with the nuisances' distance from their priors taken along. A column that nuisances imitate scores low.
        """
        if parts is None:
            return 0.0, 1.0
        _, column = self.joint.whitened(self.fit.jacobian, parts, self.fit.scale)
        across = self.scaled.T @ column
        size = float(column @ column - across @ self.normal @ across)
        slope = float(column @ self.right - across @ self.normal @ (self.scaled.T @ self.right + self.pull))
        if size <= 1e-12 * float(column @ column) or size <= 0.0:
            return 0.0, 1.0
        share = float(np.clip(slope / size, 0.1, _furthest(candidate, candidate.starts[start])))
        return 2.0 * share * slope - share**2 * size, share


def _furthest(candidate, start):
    """Largest multiple of the way from neutral to ``start`` within the bounds, at most 3."""
    reach = 3.0
    for p, s in zip(candidate.parameters, start):
        way = s - p.neutral
        if way:
            limit = p.bounds[1] if way > 0 else p.bounds[0]
            reach = min(reach, abs(limit - p.neutral) / abs(way))
    return max(reach, 0.1)
