"""Missing force without a model: against displacement, velocity, position, time and temperature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True)
class LatentForce:
    """Missing force as a free function of covariates.

    ``r2`` covariate -> share of the force's variance that a free law explains on held-out samples. ``curves`` covariate
    -> (centres, mean force, its standard error). ``unit`` of the force.
    """

    r2: dict[str, float]
    curves: dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]
    unit: str = "N"

    @property
    def best_covariate(self) -> str:
        """Covariate that explains most, "" if none explains anything."""
        name = max(self.r2, key=lambda n: self.r2[n], default="")
        return name if name and self.r2[name] > 0.0 else ""


def latent_law(
    force: ArrayLike, covariates: Mapping[str, ArrayLike], unit: str = "N", blocks: int = THRESHOLDS.n_held_out_blocks
) -> LatentForce:
    r"""Free law of a missing force for each covariate, tested on held-out blocks of time.

    A piecewise constant law over equally filled classes; :math:`R^2 = 1 - \overline{(f - \hat f_{-b})^2} /
    \overline{(f - \bar f)^2}` with law and mean from the other blocks.

    Parameters
    ----------
    force : (n,) array of float
        In ``unit``; samples that are not finite are left out.
    covariates : mapping
        Name -> (n,) values.
    unit : str
        Unit of the force.
    blocks : int
        Number of blocks of time.

    Returns
    -------
    LatentForce

    Examples
    --------
    >>> x = np.sin(np.arange(4000) * 0.1)
    >>> law = latent_law(x**3, {"displacement": x, "time": np.arange(4000.0)})
    >>> law.best_covariate, law.r2["displacement"] > 0.95, law.r2["time"] < 0.3
    ('displacement', True, True)
    """
    force = np.asarray(force, dtype=float)
    block = np.arange(force.size) * blocks // force.size
    r2, curves = {}, {}
    for name, x in covariates.items():
        x = np.asarray(x, dtype=float)
        good = np.isfinite(x) & np.isfinite(force)
        levels = int(
            min(THRESHOLDS.max_pieces, np.unique(x[good]).size, good.sum() // THRESHOLDS.min_samples_per_piece)
        )
        if levels < 2:
            continue
        edges = np.quantile(x[good], np.linspace(0.0, 1.0, levels + 1)[1:-1])
        code = np.searchsorted(edges, x[good], side="right")
        r2[name] = _left_out_r2(force[good], code, block[good], levels)
        curves[name] = _curve(force[good], x[good], code, levels)
    return LatentForce(r2, curves, unit)


def _left_out_r2(force: np.ndarray, code: np.ndarray, block: np.ndarray, levels: int) -> float:
    """Share of the variance on held-out blocks. Sums by block make every held-out mean a subtraction."""
    n_block = int(block.max()) + 1
    flat = block * levels + code
    count = np.bincount(flat, minlength=n_block * levels).reshape(n_block, levels)
    total = np.bincount(flat, force, minlength=n_block * levels).reshape(n_block, levels)
    count_out, total_out = count.sum(0) - count, total.sum(0) - total
    overall = total_out.sum(1) / np.maximum(count_out.sum(1), 1)
    law = np.where(count_out > 0, total_out / np.maximum(count_out, 1), overall[:, None])
    missed = np.sum((force - law[block, code]) ** 2)
    spread = np.sum((force - overall[block]) ** 2)
    return float(1.0 - missed / spread) if spread > 0.0 else 0.0


def _curve(
    force: np.ndarray, x: np.ndarray, code: np.ndarray, levels: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    count = np.maximum(np.bincount(code, minlength=levels), 1)
    centre, mean = np.bincount(code, x, levels) / count, np.bincount(code, force, levels) / count
    square = np.bincount(code, force**2, levels) / count
    return centre, mean, np.sqrt(np.maximum(square - mean**2, 0.0) / count)
