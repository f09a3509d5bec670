"""One recording as the engine sees it: data, errors, conditions, and the cells its mismatch may be locked to."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np


@dataclass(frozen=True)
class Observation:
    """One recording under one condition, as a vector the simulator can predict.

    ``data``, ``sigma`` (n,) in the same unit: noise and materiality floor; ``effective`` share of the samples
    that are independent, 0 to 1. Folds leave out a ``condition``; ``kind`` shares one noise scale. ``cells`` (n,)
    numbers the time-frequency cell of each sample, -1 for none; ``labels`` frame -> (n_cell,) level of each cell.
    ``rows`` of equal length lie one behind the other, of sensors or of Re and Im: what one misses in a stretch, others
    may miss as well. ``modes`` (n, m) in the unit of the data are errors of this recording's own with unit variance
    each (roughness of its wheels, tolerance of a model that errs smoothly): they are integrated out, see ``whitened``;
    in single precision, where they are many, what is whitened is right to 1e-6 of its size.
    """

    name: str
    condition: str
    data: np.ndarray
    sigma: np.ndarray
    effective: float = 1.0
    kind: str = "response"
    covariates: Mapping[str, float] = field(default_factory=dict)
    cells: np.ndarray | None = None
    labels: Mapping[str, np.ndarray] = field(default_factory=dict)
    modes: np.ndarray | None = None
    rows: int = 1

    def __post_init__(self):
        data = np.asarray(self.data, dtype=float)
        sigma = np.broadcast_to(np.asarray(self.sigma, dtype=float), data.shape)
        if data.ndim != 1 or not np.all(np.isfinite(data)):
            raise ValueError(f"observation {self.name!r}: data must be one row of finite numbers")
        if data.size % self.rows:
            raise ValueError(f"observation {self.name!r}: {data.size} samples are no {self.rows} rows of equal length")
        if not np.all(sigma > 0.0) or not 0.0 < self.effective <= 1.0:
            raise ValueError(f"observation {self.name!r}: sigma must be above 0 and effective in 0 to 1")
        object.__setattr__(self, "data", data)
        object.__setattr__(self, "sigma", sigma)

    @cached_property
    def _subspace(self):
        """Orthonormal directions (n, m) of the modes over sigma, and how much each is shrunk (m,)."""
        if self.modes is None or not self.modes.shape[1]:
            return None
        scaled = self.modes / self.sigma[:, None]
        power, turn = np.linalg.eigh(scaled.T @ scaled)
        keep = power > 1e-4
        power = power[keep]
        along = (scaled @ turn[:, keep] / np.sqrt(power)).astype(self.modes.dtype)
        return along, 1.0 - 1.0 / np.sqrt(1.0 + power)

    def whitened(self, values):
        r"""``values`` (n,) or (n, k) over the standard deviation of all that is random: :math:`C^{-1/2} x`,
        :math:`C = \mathrm{diag}(\sigma^2) + M M^T` with M the ``modes``.

        >>> o = Observation("a", "a", np.zeros(3), 2.0, modes=np.array([[2.0], [2.0], [2.0]]))
        >>> [round(float(v), 3) for v in o.whitened(np.array([2.0, 2.0, 2.0]))]  # along the mode: over sqrt(1 + 3)
        [0.5, 0.5, 0.5]
        >>> [round(float(v), 3) for v in o.whitened(np.array([2.0, -2.0, 0.0]))]  # across it: over sigma alone
        [1.0, -1.0, 0.0]
        """
        if isinstance(values, Whitened):
            return np.asarray(values)
        scaled = values / (self.sigma if values.ndim == 1 else self.sigma[:, None])
        if self._subspace is None:
            return scaled
        along, shrunk = self._subspace
        inner = along.T @ scaled.astype(along.dtype)
        inner *= (shrunk if values.ndim == 1 else shrunk[:, None]).astype(along.dtype)
        return scaled - along @ inner

    @property
    def n_effective(self):
        """Number of independent samples."""
        return self.effective * self.data.size


class Whitened(np.ndarray):
    """Values of an observation that are whitened already."""

    def __new__(cls, values):
        return np.asarray(values, dtype=float).view(cls)
