"""Result of a joint fit, with all that later steps of the diagnosis need."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.constants import Z95
from turnout.number_text import value_with_half_width

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate


@dataclass(frozen=True)
class Fit:
    """Result of a joint fit.

    ``values`` of nuisances, ``psi`` (n_term,) of the terms. ``residuals`` list by observation, ``white`` the same
    whitened. ``jacobian`` whitened too; [] in a fit ``without_jacobian``, in single precision in a large case.
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

    def values_beside(self, fixed: Mapping[str, float]) -> dict[str, float]:
        r"""Values of all nuisances where some are held at other values and the rest is fitted again, to first order.

        The cost is :math:`(\theta - \hat\theta)^T C^{-1} (\theta - \hat\theta)` about its minimum. Its minimum with
        the part f held at :math:`\theta_f` is at
        :math:`\theta_r = \hat\theta_r + C_{rf} C_{ff}^{-1} (\theta_f - \hat\theta_f)`.

        Parameters
        ----------
        fixed : mapping of str to float
            Nuisance -> value.

        Returns
        -------
        dict
            In the order of ``values``.

        Raises
        ------
        KeyError
            If there is no nuisance of such a name.
        """
        names = list(self.values)
        if unknown := [name for name in fixed if name not in self.values]:
            raise KeyError(unknown[0])
        at = [names.index(name) for name in fixed]
        moved = np.array([value - self.values[name] for name, value in fixed.items()])
        nuisances = self.covariance[: len(names), : len(names)]
        shift = nuisances[:, at] @ np.linalg.solve(nuisances[np.ix_(at, at)], moved) if at else np.zeros(len(names))
        return {name: value + float(d) for (name, value), d in zip(self.values.items(), shift)} | dict(fixed)

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
        """(n_term,) standard errors of the terms' parameters, with the errors of the models of their effects."""
        errors, first = np.sqrt(np.maximum(np.diag(self.covariance)[len(self.values) :], 0.0)), 0
        for candidate in self.candidates:
            for k, p in enumerate(candidate.parameters, first):
                share, neutral = (
                    (p.model_error_share, 0.0) if k > first else (candidate.effect.model_error_share, p.neutral)
                )
                errors[k] = np.hypot(errors[k], share * (self.psi[k] - neutral))
            first += len(candidate.parameters)
        return errors

    @property
    def estimates(self) -> tuple[str, ...]:
        """(n_term,) name and value of each parameter of the effects, with its 95 % interval, as text."""
        parameters = (p for c in self.candidates for p in c.parameters)
        return tuple(
            f"{p.name} {value_with_half_width(float(value), Z95 * float(se), p.unit)}"
            for p, value, se in zip(parameters, self.psi, self.psi_se)
        )


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
