"""Observations: one recording with its data, errors, condition and time-frequency cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import CaseError
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Observation:
    """One recording under one condition, as a vector that the simulator can predict.

    ``data``, ``sigma`` (n,) in the same unit: noise and materiality floor. ``effective`` is the share of independent
    samples, 0 to 1. Folds leave out a ``condition``. Observations of one ``data_type`` share a noise scale.

    ``cells`` (n,) numbers the time-frequency cell of each sample, -1 for none. ``labels`` frame -> (n_cell,) level of
    each cell. ``rows`` of equal length follow one another, of sensors or of Re and Im. Errors in one stretch may appear
    in all rows at once.

    ``modes`` (n, m) in the unit of the data are errors of this recording with unit variance each, for example roughness
    of its wheels. They are integrated out, see ``whiten``. In single precision, the result is right to 1e-6 of its
    size.
    """

    name: str
    condition: str
    data: np.ndarray
    sigma: np.ndarray
    effective: float = 1.0
    data_type: str = "response"
    covariates: Mapping[str, float] = field(default_factory=dict)
    cells: np.ndarray | None = None
    labels: Mapping[str, np.ndarray] = field(default_factory=dict)
    modes: np.ndarray | None = None
    rows: int = 1

    def __post_init__(self) -> None:
        data = np.asarray(self.data, dtype=float)
        sigma = np.broadcast_to(np.asarray(self.sigma, dtype=float), data.shape)
        if data.ndim != 1 or not np.all(np.isfinite(data)):
            raise CaseError(f"observation {self.name!r}: data must be one row of finite numbers")
        if data.size % self.rows:
            raise CaseError(f"observation {self.name!r}: {data.size} samples are no {self.rows} rows of equal length")
        if not data.size:
            raise CaseError(f"observation {self.name!r} has no samples")
        if not np.all((sigma > 0.0) & np.isfinite(sigma)):
            raise CaseError(
                f"observation {self.name!r}: sigma must be finite and above 0. A share of the rms is 0 where all data "
                "are equal: state the noise of the sensor"
            )
        if not 0.0 < self.effective <= 1.0:
            raise CaseError(f"observation {self.name!r}: effective is {self.effective}; it must be above 0, at most 1")
        object.__setattr__(self, "data", data)
        object.__setattr__(self, "sigma", sigma)

    @cached_property
    def _subspace(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Orthonormal directions (n, m) of the modes over sigma, and the shrinkage of each (m,)."""
        if self.modes is None or not self.modes.shape[1]:
            return None
        scaled = self.modes / self.sigma[:, None]
        eigenvalues, eigenvectors = np.linalg.eigh(scaled.T @ scaled)
        keep = eigenvalues > THRESHOLDS.min_mode_energy
        eigenvalues = eigenvalues[keep]
        directions = (scaled @ eigenvectors[:, keep] / np.sqrt(eigenvalues)).astype(self.modes.dtype)
        return directions, 1.0 - 1.0 / np.sqrt(1.0 + eigenvalues)

    @cached_property
    def _small_operator(self) -> np.ndarray | None:
        """(n, n) matrix of ``whiten`` of an observation with modes; None if one product with it is not faster."""
        if self._subspace is None or self.data.size > THRESHOLDS.max_dense_size:
            return None
        directions, shrinkage = self._subspace
        return (np.eye(self.data.size) - (directions * shrinkage) @ directions.T) / self.sigma

    def whiten(self, values: np.ndarray) -> np.ndarray:
        r"""Values over the standard deviation of all random errors: :math:`C^{-1/2} x`.

        :math:`C = \mathrm{diag}(\sigma^2) + M M^T` with M the ``modes``.

        Parameters
        ----------
        values : (n,) or (n, k) array of float
            In the unit of the data. ``Whitened`` values are returned as they are.

        Returns
        -------
        (n,) or (n, k) array of float
            Of the shape of ``values``. [-]

        Examples
        --------
        >>> o = Observation("a", "a", np.zeros(3), 2.0, modes=np.array([[2.0], [2.0], [2.0]]))
        >>> [round(float(v), 3) for v in o.whiten(np.array([2.0, 2.0, 2.0]))]  # along the mode: over sqrt(1 + 3)
        [0.5, 0.5, 0.5]
        >>> [round(float(v), 3) for v in o.whiten(np.array([2.0, -2.0, 0.0]))]  # across it: over sigma alone
        [1.0, -1.0, 0.0]
        """
        if isinstance(values, Whitened):
            return np.asarray(values)
        if self._small_operator is not None:
            return self._small_operator @ values
        scaled = values / (self.sigma if values.ndim == 1 else self.sigma[:, None])
        if self._subspace is None:
            return scaled
        directions, shrinkage = self._subspace
        projection = directions.T @ scaled.astype(directions.dtype)
        projection *= (shrinkage if values.ndim == 1 else shrinkage[:, None]).astype(directions.dtype)
        return scaled - directions @ projection

    def with_errors(self, errors: np.ndarray, n_alike: int = 1) -> Observation:
        r"""The observation with further error modes, which several observations have in common.

        The mean of ``n_alike`` observations with one error errs by it as one of them does. As errors of observations
        are independent, each has :math:`\sqrt n` times its size.

        Parameters
        ----------
        errors : (n, m) array of float
            In the unit of the data.
        n_alike : int
            Observations with this error, this one included.

        Returns
        -------
        Observation
        """
        known = () if self.modes is None else (self.modes,)
        return replace(self, modes=np.column_stack([*known, np.sqrt(n_alike) * errors]))

    @property
    def n_effective(self) -> float:
        """Number of independent samples."""
        return self.effective * self.data.size


class Whitened(np.ndarray):
    """Values of an observation that are already whitened."""

    def __new__(cls, values: ArrayLike) -> Whitened:
        return np.asarray(values, dtype=float).view(cls)
