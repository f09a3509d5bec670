"""A fit: what the joint fit of a case ended at, with all that is asked of it afterwards."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Fit:
    """``values`` of nuisances, ``psi`` (n_term,) of the terms; ``residuals`` a list by observation, ``white`` the same
    whitened, ``jacobian`` whitened too, [] in one that is ``light``; that of a dear case is in single precision.

    ``scale`` noise scale by kind, at least 1; ``cost`` minus twice the log posterior up to a constant;
    ``covariance`` of nuisances and psi; ``level`` weighted mean square by kind, in units of ``sigma``;
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
        """The same fit without its Jacobian, by far the largest part of it."""
        return replace(self, jacobian=[])

    def with_candidates(self, candidates):
        """The same fit with these candidates, which carry functions and are not kept on disk."""
        return replace(self, candidates=tuple(candidates))

    def part(self, candidate):
        """Where the parameters of ``candidate`` are in ``psi``, a slice."""
        first = 0
        for known in self.candidates:
            last = first + len(known.parameters)
            if known.key == candidate.key:
                return slice(first, last)
            first = last
        raise KeyError(f"{candidate.key} is not in this fit")

    @property
    def psi_se(self):
        """(n_term,) standard errors of the terms' parameters; a size errs by the ``loose`` share of it as well."""
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
