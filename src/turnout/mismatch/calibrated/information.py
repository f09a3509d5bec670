r"""What one visit says of the parameters, as an information matrix and vector.

The log likelihood of a visit is :math:`-\frac12 x^T \Lambda x + \eta^T x` up to a constant, with the matrix
:math:`\Lambda = J^T W J` and the vector :math:`\eta = J^T W (y - f(x_0) + J x_0)` of a model that is linear about
:math:`x_0`. Information of independent recordings adds up.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np


def marginalize(
    matrix: np.ndarray, vector: np.ndarray, removed: Sequence[int], prior_precision: np.ndarray | float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    r"""Information on the remaining parameters, with those removed integrated out.

    .. math:: \Lambda_{aa} - \Lambda_{ab} (\Lambda_{bb} + S^{-1})^{-1} \Lambda_{ba}, \quad
              \eta_a - \Lambda_{ab} (\Lambda_{bb} + S^{-1})^{-1} \eta_b

    Parameters
    ----------
    matrix : (n, n) array of float
        Information matrix.
    vector : (n,) array of float
        Information vector.
    removed : sequence of int
        Indices b of the parameters that are integrated out.
    prior_precision : (n_removed,) array of float or float
        Inverse prior variances of these parameters, whose prior mean is 0. 0: nothing is known of them.

    Returns
    -------
    matrix : (n - n_removed, n - n_removed) array of float
        Symmetric.
    vector : (n - n_removed,) array of float

    Examples
    --------
    >>> matrix, vector = marginalize(np.array([[2.0, 1.0], [1.0, 0.0]]), np.array([1.0, 3.0]), [1], 1.0)
    >>> matrix.tolist(), vector.tolist()
    ([[1.0]], [-2.0])
    """
    b = np.asarray(removed, dtype=int)
    a = np.setdiff1d(np.arange(vector.size), b)
    inner = matrix[np.ix_(b, b)] + np.diag(np.broadcast_to(np.asarray(prior_precision, dtype=float), b.shape))
    cross = matrix[np.ix_(a, b)]
    weights = cross @ np.linalg.pinv(inner, hermitian=True)
    remaining = matrix[np.ix_(a, a)] - weights @ cross.T
    return 0.5 * (remaining + remaining.T), vector[a] - weights @ vector[b]


def with_visit_deviations(matrix: np.ndarray, vector: np.ndarray, sds: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    r"""Information of a visit on values to which it adds deviations of its own, which are integrated out.

    .. math:: \Lambda' = \Lambda - \Lambda S (1 + S \Lambda S)^{-1} S \Lambda, \quad
              \eta' = \eta - \Lambda S (1 + S \Lambda S)^{-1} S \eta

    with the diagonal matrix S of their standard deviations.

    Parameters
    ----------
    matrix : (n, n) array of float
        Information matrix.
    vector : (n,) array of float
        Information vector.
    sds : (n,) array of float
        0: the value is the same at all visits.

    Returns
    -------
    matrix : (n, n) array of float
    vector : (n,) array of float

    Examples
    --------
    >>> matrix, vector = with_visit_deviations(np.array([[4.0]]), np.array([8.0]), np.array([0.5]))
    >>> matrix.tolist(), vector.tolist()  # the variance 1/4 of the data and 1/4 of the visit add up
    ([[2.0]], [4.0])
    """
    own = np.flatnonzero(sds)
    if own.size == 0:
        return matrix, vector
    columns = matrix[:, own] * sds[own]  # (n, n_own)
    inner = np.eye(own.size) + sds[own, None] * columns[own]
    weights = np.linalg.solve(inner, columns.T)  # (n_own, n)
    remaining = matrix - columns @ weights
    return 0.5 * (remaining + remaining.T), vector - weights.T @ (sds[own] * vector[own])


@dataclass(frozen=True)
class GroupInformation:
    """Information of recordings that share the error of the model, as trains of one type at one speed do.

    ``group`` names the group, ``n_recordings`` counts its recordings, ``names`` (n,) are the parameters of ``matrix``
    (n, n) and ``vector`` (n,). Both are sums over the recordings, as if their errors were independent.
    """

    group: str
    n_recordings: int
    names: tuple[str, ...]
    matrix: np.ndarray
    vector: np.ndarray

    def __post_init__(self) -> None:
        n = len(self.names)
        if self.matrix.shape != (n, n) or self.vector.shape != (n,) or self.n_recordings < 1:
            raise ValueError(f"group {self.group!r}: {n} names, matrix {self.matrix.shape}, vector {self.vector.shape}")
        if not (np.all(np.isfinite(self.matrix)) and np.all(np.isfinite(self.vector))):
            raise ValueError(f"group {self.group!r}: information must be finite")

    def without(self, names: Iterable[str]) -> GroupInformation:
        """Information in which these parameters have an unknown value of this visit alone.

        Example: a sensor that has slipped. What other parameters can be distinguished from it stays.

        Parameters
        ----------
        names : iterable of str

        Returns
        -------
        GroupInformation
        """
        excluded = set(names)
        b = [k for k, name in enumerate(self.names) if name in excluded]
        if not b:
            return self
        matrix, vector = marginalize(self.matrix, self.vector, b)
        remaining = tuple(name for name in self.names if name not in excluded)
        return replace(self, names=remaining, matrix=matrix, vector=vector)


@dataclass(frozen=True)
class VisitInformation:
    """Information of one ``visit``, by group; ``time`` is that of the visit in years.

    ``own_sds``: parameter -> standard deviation of what this visit adds of its own, where it is not the ``visit_sd`` of
    the parameter. A support may be an outer one at a visit with fewer sensors, and absorb there what lies beyond.
    """

    visit: str
    time: float
    groups: tuple[GroupInformation, ...]
    own_sds: Mapping[str, float] = field(default_factory=dict)

    @property
    def n_recordings(self) -> int:
        """Number of recordings."""
        return sum(g.n_recordings for g in self.groups)

    def without(self, names: Iterable[str]) -> VisitInformation:
        """The visit with an unknown value of its own for these parameters, see ``GroupInformation.without``.

        The groups are summed first, since their recordings share the unknown value.

        Parameters
        ----------
        names : iterable of str

        Returns
        -------
        VisitInformation
        """
        all_names = tuple(sorted({name for g in self.groups for name in g.names}))
        matrix, vector = self.total(all_names)
        group = GroupInformation(self.visit, max(self.n_recordings, 1), all_names, matrix, vector)
        return replace(self, groups=(group.without(names),))

    def total(self, names: Sequence[str], weights: Mapping[str, float] | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Sum over the groups in the order of their names: the same bits in whatever order they arrived.

        Parameters
        ----------
        names : sequence of str
            Parameters of the result, all of those of the groups and others.
        weights : mapping or None
            Group -> factor on its information; None: 1.

        Returns
        -------
        matrix : (n, n) array of float
        vector : (n,) array of float

        Raises
        ------
        ValueError
            If a group has a parameter that is not among ``names``.
        """
        number = {name: k for k, name in enumerate(names)}
        matrix, vector = np.zeros((len(names), len(names))), np.zeros(len(names))
        for group in sorted(self.groups, key=_order):
            if unknown := [name for name in group.names if name not in number]:
                raise ValueError(f"visit {self.visit}: {unknown[0]!r} is no parameter of this model")
            index = np.array([number[name] for name in group.names], dtype=int)
            weight = 1.0 if weights is None else weights[group.group]
            matrix[np.ix_(index, index)] += weight * group.matrix
            vector[index] += weight * group.vector
        return matrix, vector


def _order(group: GroupInformation) -> tuple[str, bytes, bytes]:
    return group.group, group.vector.tobytes(), group.matrix.tobytes()


def repeated_error_weights(visits: Iterable[VisitInformation], share: float) -> dict[str, float]:
    r"""Factor on the information of each group, whose recordings share part of the error of the model.

    With ``n`` recordings, of whose error variance the share :math:`\rho` repeats, the random effect of the group leaves
    the information of :math:`n / (1 + \rho (n - 1))` recordings: with many, that of :math:`1 / \rho`.

    Parameters
    ----------
    visits : iterable of VisitInformation
        All in which the error repeats.
    share : float
        0 (independent errors) to 1 (all recordings of a group have the same error).

    Returns
    -------
    dict
        Group -> factor.

    References
    ----------
    Kish 1965, Survey sampling, chapter 5: the design effect of clusters.
    """
    count: dict[str, int] = {}
    for visit in visits:
        for group in visit.groups:
            count[group.group] = count.get(group.group, 0) + group.n_recordings
    return {group: 1.0 / (1.0 + share * (n - 1)) for group, n in count.items()}
