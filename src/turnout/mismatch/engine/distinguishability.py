"""Effects that a planned campaign can distinguish: expected loss of log evidence if one is explained by another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.joint_problem import JointProblem
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.case import Case


@dataclass(frozen=True)
class Distinguishability:
    """Expected evidence between effects.

    ``names`` (n,) effects. ``loss`` (n, n) nats lost if the effect of the row is explained by the best amplitude of the
    effect of the column. ``detectability`` (n,) nats lost if it is explained by nuisances alone.
    """

    names: tuple[str, ...]
    loss: np.ndarray
    detectability: np.ndarray

    def confused_with(self, name: str) -> list[str]:
        """Effects that cannot be distinguished from one of them.

        Parameters
        ----------
        name : str
            The effect.

        Returns
        -------
        list of str
            With "none" first if the effect cannot be detected at all.

        Raises
        ------
        ValueError
            If the effect is not among ``names``.
        """
        row = self.names.index(name)
        confused_names = [] if self.detectability[row] >= THRESHOLDS.min_evidence else ["none"]
        return confused_names + [
            n for k, n in enumerate(self.names) if k != row and self.loss[row, k] < THRESHOLDS.min_evidence
        ]

    def can_be_named(self, name: str, threshold: float, margin: float) -> bool:
        """Whether an effect of this size is expected to have enough evidence for a name.

        Parameters
        ----------
        name : str
            The effect.
        threshold : float
            Evidence against the base model that a name needs. [nats]
        margin : float
            Evidence against each other effect that a name needs. [nats]

        Returns
        -------
        bool
        """
        row = self.names.index(name)
        leads = np.delete(self.loss[row], row)
        return bool(self.detectability[row] >= threshold and np.all(leads >= margin))

    def __str__(self) -> str:
        title = "evidence [nats]"
        width = max(len(title), *(len(n) + 3 for n in self.names))
        lines = [f"{title:<{width}}     none " + " ".join(f"{k:>8}" for k in range(1, len(self.names) + 1))]
        for k, (name, nats, row) in enumerate(zip(self.names, self.detectability, self.loss), 1):
            label = f"{k:>2} {name}"
            lines.append(f"{label:<{width}} {nats:>8.0f} " + " ".join(f"{min(v, 1e7):>8.0f}" for v in row))
        return "\n".join(lines)


def distinguishability(case: Case, strengths: Mapping[str, ArrayLike] | None = None) -> Distinguishability:
    r"""Expected evidence between the effects of a case. No data are needed, only predictions of recordings.

    .. math:: L_{AB} = \tfrac12 \min_a (c_A - a c_B)^T P (c_A - a c_B)

    with c the change by an effect. P projects out the nuisances under their priors.

    Parameters
    ----------
    case : Case
        Its data may be its own predictions.
    strengths : mapping or None
        Key of a candidate -> its parameters; by default each candidate's first start. One candidate of each family is
        taken, the first with a strength, else the one at the middle site.

    Returns
    -------
    Distinguishability

    Raises
    ------
    SimulationError
        If the base model cannot be simulated. Effects that cannot be simulated are left out.
    """
    fit = fit_jointly(case, iterations=0)
    joint = JointProblem(case)
    unit = dict.fromkeys(fit.scale, 1.0)
    rows, _ = joint.stack(fit.jacobian, fit.white, unit)
    scaled = rows * joint.sd
    normal = np.linalg.inv(scaled.T @ scaled + np.eye(scaled.shape[1]))
    names, columns = [], []
    for candidate in _one_per_family(case.candidates, strengths or {}):
        start = np.asarray((strengths or {}).get(candidate.key, candidate.starts[0]), dtype=float)
        share = 1.0 if getattr(candidate.term(start), "effect_type", "port") == "port" else THRESHOLDS.linear_share
        values = candidate.neutral + share * (start - candidate.neutral)
        try:
            new = case.predict(fit.values, (candidate.term(values),), case.observations)
        except SimulationError:
            continue
        change = [o.whiten(a - b) for o, a, b in zip(case.observations, new, fit.predictions)]
        _, column = joint.stack(fit.jacobian, change, unit)
        names.append(candidate.family)
        columns.append(column / share)
    c = np.array(columns)
    across = c @ scaled
    gram = c @ c.T - across @ normal @ across.T
    size = np.maximum(np.diag(gram), 0.0)
    explained = np.where(size > 1e-9, gram**2 / np.maximum(size, 1e-9), 0.0)
    loss = 0.5 * np.maximum(size[:, None] - explained, 0.0)
    np.fill_diagonal(loss, 0.0)
    return Distinguishability(tuple(names), loss, 0.5 * size)


def _one_per_family(candidates: Iterable[Candidate], strengths: Mapping[str, ArrayLike]) -> Iterator[Candidate]:
    """The candidates with given strengths, and the middle site of every other family."""
    by_family: dict[str, list[Candidate]] = {}
    for candidate in candidates:
        by_family.setdefault(candidate.family, []).append(candidate)
    for members in by_family.values():
        chosen = [m for m in members if m.key in strengths]
        yield chosen[0] if chosen else members[len(members) // 2]


def best_addition(
    base: Distinguishability,
    additions: Mapping[str, tuple[float, Distinguishability]],
) -> tuple[str, int, float]:
    """The addition to a plan that resolves most pairs of effects; of several, the one with the least effort.

    Parameters
    ----------
    base : Distinguishability
        Of the plan as it is.
    additions : mapping
        Name -> (effort [h], Distinguishability of the plan with it).

    Returns
    -------
    name : str
    resolved : int
        Number of pairs that it resolves.
    gained : float
        Evidence that it adds. [nats]
    """
    ranked, most = [], THRESHOLDS.max_useful_evidence
    for name, (effort, extended) in additions.items():
        common = [n for n in base.names if n in extended.names]
        gained = resolved = 0.0
        for a in common:
            for b in common:
                if a == b:
                    continue
                before = base.loss[base.names.index(a), base.names.index(b)]
                after = extended.loss[extended.names.index(a), extended.names.index(b)]
                resolved += before < THRESHOLDS.min_evidence <= after
                gained += max(0.0, min(after, most) - min(before, most))
            before, after = base.detectability[base.names.index(a)], extended.detectability[extended.names.index(a)]
            resolved += before < THRESHOLDS.min_evidence <= after
        ranked.append((-resolved, effort, name, gained))
    resolved, _, name, gained = min(ranked)
    return name, int(-resolved), float(gained)
