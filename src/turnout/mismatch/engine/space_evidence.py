r"""Evidence that a residual lies in a subspace, with the nuisances integrated out.

With an unknown amplitude, what a cause adds to the data along the columns B of a subspace is a random effect,

.. math:: y \sim N(m,\; \nu C + a^2 B B^T)

with C the covariance of errors and nuisances. Its evidence over :math:`N(m, \nu C)` follows in closed form from the
eigenvalues of :math:`B^T C^{-1} B`, with ν and a at their best values, ν not below the level of intact recordings.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.projector import Projector
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.case import Case
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.observation import Observation
    from turnout.mismatch.engine.residual_space import ResidualSpace

# (frame, level) -> data type -> law -> name of the space -> evidence [nats]
_ByLevel = dict[tuple[str, Any], dict[str, dict[str, dict[str, float]]]]

AMPLITUDES = np.concatenate(
    [[0.0], np.geomspace(THRESHOLDS.min_amplitude, THRESHOLDS.max_amplitude, THRESHOLDS.n_amplitudes)]
)
NOISE_FACTORS = np.geomspace(1.0, THRESHOLDS.max_noise_factor, THRESHOLDS.n_noise_factors)


@dataclass(frozen=True)
class SpaceEvidence:
    """Evidence [nats] that the residual is fixed to ``level`` of ``frame``; ``by_space`` nats by name of the space.

    ``by_common_law`` has those of the best law that is the same for several recordings.
    """

    frame: str
    level: Any
    nats: float
    by_space: dict[str, float] = field(default_factory=dict)
    by_common_law: dict[str, float] = field(default_factory=dict)


def subspace_evidence(gram: np.ndarray, inner: np.ndarray, square: float, n: int, floor: float) -> float:
    r"""Gain in log likelihood of a residual by a random effect in a subspace.

    With eigenvalues λ of :math:`B^T B` scaled to mean 1 and u the residual along the eigenvectors,

    .. math:: -\tfrac12\left[(n-k)\ln\nu + \frac{r^2 - u^2}{\nu}
              + \sum_i \ln(\nu + a^2\lambda_i) + \frac{u_i^2}{\nu + a^2\lambda_i}\right]

    maximised over a and ν ≥ ``floor``, less its maximum over ν with a = 0.

    Parameters
    ----------
    gram : (k, k) array of float
        :math:`B^T B`.
    inner : (k,) array of float
        :math:`B^T r`.
    square : float
        :math:`r^T r`.
    n : int
        Number of samples of the residual.
    floor : float
        Mean square of intact recordings.

    Returns
    -------
    float
        At least 0. [nats]
    """
    eigenvalues, eigenvectors = np.linalg.eigh(gram)
    keep = eigenvalues > 1e-9 * max(eigenvalues[-1], 1e-300)
    eigenvalues = eigenvalues[keep]
    squared_projections = (eigenvectors[:, keep].T @ inner) ** 2 / eigenvalues
    outside, k = max(square - float(squared_projections.sum()), 0.0), eigenvalues.size
    eigenvalues = eigenvalues / eigenvalues.mean()
    noise = floor * NOISE_FACTORS
    variance = noise[:, None, None] + AMPLITUDES[:, None] * eigenvalues
    inside = np.sum(np.log(variance) + squared_projections / variance, axis=2)
    log_likelihood = -0.5 * ((n - k) * np.log(noise) + outside / noise + inside.T)
    return max(0.0, float(log_likelihood.max() - log_likelihood[0].max()))


def weigh_spaces(case: Case, fit: Fit, floor: Mapping[str, float], frame: str = "") -> list[SpaceEvidence]:
    """Evidence for each level of each frame, for the residual of a fit.

    Columns are whitened. The nuisances are projected out of them under their priors, as they are out of the residual.

    Parameters
    ----------
    case : Case
    fit : Fit
        With its Jacobian.
    floor : mapping
        Data type -> least mean square of the noise.
    frame : str
        The only frame whose levels are weighed; "" for all.

    Returns
    -------
    list of SpaceEvidence
        The largest first.
    """
    marginal, n_samples = _Marginal(Projector(case, fit)), 0
    offsets: dict[str, tuple[int, int]] = {}
    for k, o in enumerate(case.observations):
        offsets[o.name] = k, n_samples
        n_samples += o.data.size
    by_level: _ByLevel = {}
    for space in case.residual_spaces(fit):
        if frame:
            space = replace(space, combinations={k: c for k, c in space.combinations.items() if k[0] == frame})
        if not space.combinations:
            continue
        members = [(case.observations[offsets[name][0]], offsets[name][1]) for name in space.names]
        first_member = members[0][0]
        products = marginal.products(space.columns, members)
        for key, nats in _level_evidence(space, *products, floor[first_member.data_type]):
            by_law = by_level.setdefault(key, {}).setdefault(first_member.data_type, {})
            by_law.setdefault(space.law, {})[space.names[0]] = first_member.effective * nats
    ranked = [_combined_evidence(key, by_level) for key in by_level]
    return sorted(ranked, key=lambda w: -w.nats)


def _combined_evidence(key: tuple[str, Any], by_level: _ByLevel) -> SpaceEvidence:
    """Evidence for one level of all observations, free in each of them or, if no space is, with the best common law.

    An observation that has spaces of positions, but none of the stretch, counts with the best position in it.
    """
    frame, level = key
    by_type = {data_type: dict(by_law) for data_type, by_law in by_level[key].items()}
    if frame == "place" and isinstance(level, tuple):
        for (level_frame, position), position_types in by_level.items():
            if level_frame == "place" and not isinstance(position, tuple) and level[0] <= position <= level[1]:
                for data_type, laws in position_types.items():
                    for name, nats in laws.get("", {}).items():
                        by_name = by_type.setdefault(data_type, {}).setdefault("", {})
                        by_name[name] = max(nats, by_name.get(name, 0.0))
    by_space, by_common_law = dict[str, float](), dict[str, float]()
    for by_law in by_type.values():
        common_laws = {law: evidence for law, evidence in by_law.items() if law}
        likeliest = max(common_laws, key=lambda law: _total(common_laws[law]), default="")
        by_space |= by_law.get("") or common_laws[likeliest]
        by_common_law |= common_laws.get(likeliest, {})
    return SpaceEvidence(frame, level, _total(by_space), by_space, by_common_law)


def _total(by_space: Mapping[str, float]) -> float:
    return sum(by_space.values())


class _Marginal:
    r"""Products of columns and residual in the metric of the errors with the nuisances integrated out.

    On the rows J of some observations, whose nuisances the other observations leave with information A,
    the covariance of the data is :math:`C = I + J A^{-1} J^T`, in units of their errors. Its inverse is
    :math:`I - J N J^T` with :math:`N = (A + J^T J)^{-1}`, and the residual of the fit is :math:`r = C^{-1} y`.
    So :math:`B^T C^{-1} B = B^T B - B^T J N J^T B`, :math:`B^T C^{-1} y = B^T r`, and
    :math:`y^T C^{-1} y = r^T C r = r^T r + r^T J A^{-1} J^T r`. The last term is the prior cost of nuisances that
    imitate a cause.
    """

    def __init__(self, projector: Projector) -> None:
        self.projector = projector
        self.information = projector.scaled.T @ projector.scaled + np.eye(projector.scaled.shape[1])
        # the residual of the fit, with the last step that is linear: r = C^-1 y holds at the optimum alone
        self.residual = projector.right - projector.scaled @ projector.shift

    def products(
        self, columns: np.ndarray, members: Sequence[tuple[Observation, int]]
    ) -> tuple[np.ndarray, np.ndarray, float, int]:
        """Gram matrix, inner products with the residual, its square, and the number of samples.

        Parameters
        ----------
        columns : (n, k) array of float
            On the members, one behind the other, in the unit of the data.
        members : sequence of (Observation, int)
            Each with its first row in the Jacobian.
        """
        white_parts, row_parts, residual_parts, first = [], [], [], 0
        for o, start in members:
            size = o.data.size
            white_parts.append(o.whiten(columns[first : first + size]))
            row_parts.append(self.projector.scaled[start : start + size])
            weight = np.sqrt(o.effective / self.projector.fit.scale[o.data_type])
            residual_parts.append(self.residual[start : start + size] / weight)
            first += size
        white, rows, residual = (np.concatenate(p) for p in (white_parts, row_parts, residual_parts))
        across, pull = rows.T @ white, rows.T @ residual
        gram = white.T @ white - across.T @ (self.projector.normal @ across)
        square = residual @ residual + pull @ np.linalg.solve(self.information - rows.T @ rows, pull)
        return gram, white.T @ residual, float(square), residual.size


def _level_evidence(
    space: ResidualSpace, gram: np.ndarray, inner: np.ndarray, square: float, n: int, floor: float
) -> Iterator[tuple[tuple[str, Any], float]]:
    for key, combination in space.combinations.items():
        if combination is None:
            yield key, subspace_evidence(gram, inner, square, n, floor)
        elif combination.ndim == 1:
            block = gram[np.ix_(combination, combination)]
            yield key, subspace_evidence(block, inner[combination], square, n, floor)
        else:
            reduced = combination.T @ gram @ combination
            yield key, subspace_evidence(reduced, combination.T @ inner, square, n, floor)
