"""Cases: observations, nuisance parameters, candidate effects and a simulator. The engine knows nothing else.

An observation is one recording with its data, errors, condition and time-frequency cells.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from turnout.mismatch.engine.candidate import Candidate
from turnout.mismatch.engine.thresholds import THRESHOLDS


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
        """Orthonormal directions (n, m) of the modes over sigma, and the shrinkage of each (m,)."""
        if self.modes is None or not self.modes.shape[1]:
            return None
        scaled = self.modes / self.sigma[:, None]
        eigenvalues, eigenvectors = np.linalg.eigh(scaled.T @ scaled)
        keep = eigenvalues > THRESHOLDS.min_mode_energy
        eigenvalues = eigenvalues[keep]
        directions = (scaled @ eigenvectors[:, keep] / np.sqrt(eigenvalues)).astype(self.modes.dtype)
        return directions, 1.0 - 1.0 / np.sqrt(1.0 + eigenvalues)

    def whiten(self, values):
        r"""``values`` (n,) or (n, k) over the standard deviation of all random errors: :math:`C^{-1/2} x`,
        :math:`C = \mathrm{diag}(\sigma^2) + M M^T` with M the ``modes``.

        >>> o = Observation("a", "a", np.zeros(3), 2.0, modes=np.array([[2.0], [2.0], [2.0]]))
        >>> [round(float(v), 3) for v in o.whiten(np.array([2.0, 2.0, 2.0]))]  # along the mode: over sqrt(1 + 3)
        [0.5, 0.5, 0.5]
        >>> [round(float(v), 3) for v in o.whiten(np.array([2.0, -2.0, 0.0]))]  # across it: over sigma alone
        [1.0, -1.0, 0.0]
        """
        if isinstance(values, Whitened):
            return np.asarray(values)
        scaled = values / (self.sigma if values.ndim == 1 else self.sigma[:, None])
        if self._subspace is None:
            return scaled
        directions, shrinkage = self._subspace
        projection = directions.T @ scaled.astype(directions.dtype)
        projection *= (shrinkage if values.ndim == 1 else shrinkage[:, None]).astype(directions.dtype)
        return scaled - directions @ projection

    @property
    def n_effective(self):
        """Number of independent samples."""
        return self.effective * self.data.size


class Whitened(np.ndarray):
    """Values of an observation that are already whitened."""

    def __new__(cls, values):
        return np.asarray(values, dtype=float).view(cls)


@dataclass(frozen=True)
class Nuisance:
    """A parameter of the base model that is not exactly known, free under a normal prior.

    ``mean`` and ``sd`` of the prior in ``unit``. ``owner`` is the observation that it belongs to, None if shared.
    ``max_step_sd`` is the largest step of a fit in prior standard deviations. ``can_mask``: the base fit may have
    changed it to hide an effect. ``group`` is the property that it describes, for example the stiffness of single
    railpads. ``index`` is the number of its component among those of the group that are alike, else None.
    """

    name: str
    unit: str
    mean: float
    sd: float
    owner: str | None = None
    bounds: tuple[float, float] = (-np.inf, np.inf)
    meaning: str = ""
    max_step_sd: float = 3.0
    can_mask: bool = True
    group: str = ""
    index: int | None = None


class Case:
    """Base of all cases: give it observations, nuisances, candidates, and override ``predict``.

    Attributes
    ----------
    observations : tuple of Observation
        Those that are fitted.
    reserved : tuple of Observation
        Those that no fit uses. They may withdraw a name, and verify it.
    nuisances : tuple of Nuisance
    candidates : tuple of Candidate
    expensive : bool
        Predictions are expensive. Derivatives of the nuisances are then kept and updated by Broyden's formula, except
        for the observations for which ``is_cheap`` holds.
    start_values : mapping
        Values of nuisances where fits start, else their means.
    control_level : mapping
        Data type -> weighted mean square that controls, cases without an effect, reach. Else that of the settings.
    cell_level : mapping
        Data type -> the same for one channel of one recording.
    disturbed_recordings : tuple
        Recordings that are not used, since a source other than the known inputs shows in them.
    mismatched_trains : tuple of str
        Trains, most recordings of which do not agree with their vehicle file.
    measured_range : (float, float)
        First and last measured position. [m]
    """

    observations: tuple[Observation, ...] = ()
    reserved: tuple[Observation, ...] = ()
    nuisances: tuple[Nuisance, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    expensive = False
    start_values: Mapping[str, float] = {}
    control_level: Mapping[str, float] = {}
    cell_level: Mapping[str, float] = {}
    disturbed_recordings: tuple = ()
    mismatched_trains: tuple = ()
    measured_range = (-np.inf, np.inf)

    def is_cheap(self, observation):
        """Whether derivatives of this observation cost next to nothing."""
        return False

    def predict(self, values, terms, observations):
        """List of (n,) predictions, one per observation; ``values`` are nuisances, ``terms`` the effects."""
        raise NotImplementedError

    def predict_near(self, values, terms, new, observations, predictions):
        """Predictions with ``new`` terms, a small step from ``terms`` with known ``predictions``, for derivatives."""
        return self.predict(values, new, observations)

    def nuisance_jacobian(self, values, terms, observations, base):
        """List of (n, n_nuisance) derivatives, by forward differences unless a case overrides this.

        Nuisances of different owners are shifted together: one prediction serves them all.
        """
        groups, last_rank = {}, {}
        for k, nuisance in enumerate(self.nuisances):
            if nuisance.owner is None:
                groups[nuisance.name] = [k]
            else:
                rank = last_rank[nuisance.owner] = last_rank.get(nuisance.owner, -1) + 1
                groups.setdefault(("own", rank), []).append(k)
        jacobians = [np.zeros((o.data.size, len(self.nuisances))) for o in observations]
        for members in groups.values():
            shifted = dict(values)
            for k in members:
                shifted[self.nuisances[k].name] += THRESHOLDS.nuisance_step * self.nuisances[k].sd
            predicted = self.predict(shifted, terms, observations)
            for k in members:
                nuisance = self.nuisances[k]
                for o, new, old, jacobian in zip(observations, predicted, base, jacobians):
                    if nuisance.owner in (None, o.name):
                        jacobian[:, k] = (new - old) / (THRESHOLDS.nuisance_step * nuisance.sd)
        return jacobians

    def own_jacobian(self, values, terms, observation, predicted, names):
        """(n, n_name) derivatives of an observation by the nuisances that it owns."""
        full = self.nuisance_jacobian(values, terms, [observation], [predicted])[0]
        order = [n.name for n in self.nuisances]
        return full[:, [order.index(name) for name in names]]

    def screen(self, fit):
        """Columns of candidates at their starts, (key, start) -> list of (n,) per observation. Others are predicted."""
        return {}

    def residual_candidates(self, fit):
        """Candidates that only the residual of ``fit`` suggests."""
        return ()

    def distant_starts(self, fit):
        """(candidate, start) too far from neutral for a column: predicted, with the masking parameter at its mean."""
        return ()

    def with_broad_errors(self):
        """The same case with large independent errors: its optimum has a wide basin."""
        return self

    def hammer_positions(self):
        """Condition -> position of the impacts [m], for hammer tests."""
        return {}

    def with_updated_errors(self, fit):
        """The same case with errors of its observations as the model of ``fit`` gives them. Itself if unchanged."""
        return self

    def cheap_case(self):
        """A case of the cheap observations alone, with the same shared nuisances. None if there are none."""
        return None

    def residual_spaces(self, fit):
        """``ResidualSpace`` objects: subspaces of the observations to which a cause may be fixed. None by default."""
        return ()

    def latent_covariates(self, fit):
        """Covariates of the latent force: name -> (n,), with "force". None if the case has no such view."""
        return None

    def numerical_error(self, fit):
        """Numerical error of each observation's prediction, list of (n,), or None if it is exact."""
        return None
