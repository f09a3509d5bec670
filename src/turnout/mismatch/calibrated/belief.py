"""The belief in the parameters of one turnout: mean and covariance, and the test of a visit before it is used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import stats

from turnout.mismatch.calibrated.constants import CALIBRATION

ACCEPTED_EFFECT = "accepted effect"  # group of the parameters of effects in the track file, in their own units


@dataclass(frozen=True)
class StateParameter:
    """One parameter of the calibrated model.

    ``mean`` and ``sd`` are those of the file, in ``unit``. ``walk_sd`` is the standard deviation of its random walk
    after one year, ``visit_sd`` that of what each visit adds of its own: another train of the type comes, for example.
    Parameters of one ``group`` are alike, at different ``position`` [m] along the track; ``index`` numbers adjacent
    ones. ``may_change``: whether a change of it may be stated; not of supports that absorb what lies beyond them.
    ``is_beyond_sensors``: a support beyond the outer sensors and impacts, where the error of the model is larger.
    Components are adjacent on one ``route`` alone. A wave describes the stretch from ``start`` to ``end`` [m].
    """

    name: str
    mean: float
    sd: float
    walk_sd: float = 0.0
    group: str = ""
    index: int | None = None
    position: float | None = None
    unit: str = "-"
    visit_sd: float = 0.0
    may_change: bool = True
    is_beyond_sensors: bool = False
    route: str = "main"
    start: float | None = None
    end: float | None = None

    def __post_init__(self) -> None:
        if not (self.sd > 0.0 and self.walk_sd >= 0.0 and self.visit_sd >= 0.0 and np.isfinite(self.mean)):
            raise ValueError(f"parameter {self.name!r}: sd must be above 0, walk_sd and visit_sd at least 0")


def scatter_sd(parameter: StateParameter, parameters: Sequence[StateParameter]) -> float:
    """Standard deviation of a value in the file where the file is sure of it.

    Of a numbered component it is that of the value that is known best in its group. Supports are alike: where the file
    is unsure, as between two sections, a value is less certain, but no larger change is more probable.

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
    if parameter.index is None:
        return parameter.sd
    return min([parameter.sd, *(p.sd for p in parameters if p.group == parameter.group and p.index is not None)])


@dataclass(frozen=True)
class Innovation:
    """How far a visit is from what the belief predicts.

    ``statistic`` is chi-squared with ``n_directions`` degrees of freedom, ``chance`` its tail probability.
    ``parameter`` is the one whose jump would explain most, ``deviates`` the number of standard deviations of that jump.
    """

    statistic: float
    n_directions: int
    chance: float
    parameter: str
    deviates: float
    n_parameters: int

    @property
    def is_expected(self) -> bool:
        """Whether the visit agrees with the belief, in all and at each parameter."""
        return self.is_expected_at(1.0)

    def is_expected_at(self, level: float) -> bool:
        """Whether the visit agrees with the belief where errors of the model have this variance.

        Parameters
        ----------
        level : float
            Variance over the expected one: what intact visits have left.

        Returns
        -------
        bool
        """
        single = 2.0 * float(stats.norm.sf(abs(self.deviates) / np.sqrt(level))) * max(self.n_parameters, 1)
        chance = float(stats.chi2.sf(self.statistic / level, self.n_directions)) if self.n_directions else 1.0
        return min(chance, single) >= 0.5 * CALIBRATION.max_chance


@dataclass(frozen=True)
class Belief:
    """Normal distribution of the parameters ``names`` (n,): ``mean`` (n,) and ``covariance`` (n, n)."""

    names: tuple[str, ...]
    mean: np.ndarray
    covariance: np.ndarray

    @classmethod
    def of_file(cls, parameters: Sequence[StateParameter]) -> Belief:
        """Belief before any recording: independent values as the file gives them.

        Parameters
        ----------
        parameters : sequence of StateParameter

        Returns
        -------
        Belief

        Raises
        ------
        ValueError
            If two parameters have the same name.
        """
        names = tuple(p.name for p in parameters)
        if len(set(names)) < len(names):
            raise ValueError(f"parameter {next(n for n in names if names.count(n) > 1)!r} is given twice")
        return cls(names, np.array([p.mean for p in parameters]), np.diag([p.sd**2 for p in parameters]))

    @cached_property
    def sd(self) -> np.ndarray:
        """(n,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    def value(self, name: str) -> float:
        """Mean of one parameter.

        Parameters
        ----------
        name : str

        Returns
        -------
        float
        """
        return float(self.mean[self.names.index(name)])

    def with_noise(self, covariance: np.ndarray) -> Belief:
        """The belief after process noise: the mean stays.

        Parameters
        ----------
        covariance : (n, n) array of float
            What is added.

        Returns
        -------
        Belief
        """
        return Belief(self.names, self.mean, self.covariance + covariance)

    def with_constant_error(self, matrix: np.ndarray) -> Belief:
        r"""The belief in the values as all visits will show them: with an error of the model that they share.

        Recordings with the information :math:`\Lambda` and a constant error of their stated variance show
        :math:`x + b`, :math:`b \sim N(0, \Lambda^{-1})`. Where they know little, b is large and the first visit
        tells it. There the covariance added is ``1 / CALIBRATION.least_known_share`` times that of the belief.

        Parameters
        ----------
        matrix : (n, n) array of float
            Information matrix of the first visit, of any rank.

        Returns
        -------
        Belief

        References
        ----------
        Friedland 1969, Treatment of bias in recursive filtering, IEEE Transactions on Automatic Control 14.
        """
        factor = np.linalg.cholesky(self.covariance)
        scaled = factor.T @ matrix @ factor
        eigenvalues, directions = np.linalg.eigh(0.5 * (scaled + scaled.T))
        spread = factor @ directions
        return self.with_noise((spread / np.maximum(eigenvalues, CALIBRATION.least_known_share)) @ spread.T)

    def update(self, matrix: np.ndarray, vector: np.ndarray) -> Belief:
        r"""The belief after a visit with this information.

        .. math:: P' = L (1 + L^T \Lambda L)^{-1} L^T, \quad m' = m + P' (\eta - \Lambda m), \quad P = L L^T

        Parameters
        ----------
        matrix : (n, n) array of float
            Information matrix, of any rank.
        vector : (n,) array of float
            Information vector.

        Returns
        -------
        Belief

        References
        ----------
        Maybeck 1979, Stochastic models, estimation and control, volume 1, section 5.7.
        """
        factor = np.linalg.cholesky(self.covariance)
        inner = np.eye(len(self.names)) + factor.T @ matrix @ factor
        half = np.linalg.solve(np.linalg.cholesky(inner), factor.T)
        covariance = half.T @ half
        return Belief(self.names, self.mean + covariance @ (vector - matrix @ self.mean), covariance)

    def innovation(self, matrix: np.ndarray, vector: np.ndarray) -> Innovation:
        r"""Test of a visit before it is used: :math:`\nu = \eta - \Lambda m` with covariance
        :math:`\Lambda + \Lambda P \Lambda`.

        Parameters
        ----------
        matrix : (n, n) array of float
            Information matrix, of any rank.
        vector : (n,) array of float
            Information vector.

        Returns
        -------
        Innovation
        """
        factor = np.linalg.cholesky(self.covariance)
        scaled = factor.T @ matrix @ factor
        eigenvalues, directions = np.linalg.eigh(0.5 * (scaled + scaled.T))
        informed = eigenvalues > len(self.names) * np.finfo(float).eps * max(float(eigenvalues.max(initial=0.0)), 1.0)
        d = eigenvalues[informed]
        nu = vector - matrix @ self.mean
        components = directions[:, informed].T @ (factor.T @ nu)
        statistic, n = float(np.sum(components**2 / (d + d**2))), int(informed.sum())
        chance = float(stats.chi2.sf(statistic, n)) if n else 1.0
        posterior = self.update(matrix, vector).covariance
        jump_score = nu - matrix @ (posterior @ nu)
        jump_information = np.diag(matrix - matrix @ posterior @ matrix)
        visible = jump_information * np.diag(self.covariance) > CALIBRATION.min_prior_share
        deviates = np.where(visible, jump_score / np.sqrt(np.where(visible, jump_information, 1.0)), 0.0)
        k = int(np.argmax(np.abs(deviates)))
        return Innovation(statistic, n, chance, self.names[k], float(deviates[k]), int(visible.sum()))
