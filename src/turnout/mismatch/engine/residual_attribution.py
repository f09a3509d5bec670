r"""Attribution of residual energy to levels of frames (sensor, axle, passage ...), with the false discovery rate.

Cells of one sensor, axle or passage are alike. Sensors, bays and wheels of an intact turnout differ in level. So a
level stands out only by more than the other levels of its frame differ among themselves: Grubbs' test on their means,
valid for any dependence of the cells within a level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from turnout.mismatch.engine.observation import Observation


@dataclass(frozen=True)
class Attribution:
    """Residual energy of one frame.

    ``level`` stands out by ``effect`` [dB] over the others. ``p`` by Grubbs' test, ``q`` after Benjamini and Hochberg
    over all frames. ``share`` of the variance of log energy. ``n`` cells.
    """

    frame: str
    level: Any
    effect: float
    share: float
    p: float
    q: float
    n: int


def cell_energies(
    observations: Sequence[Observation], residuals: Sequence[np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Log mean square of the whitened residual of every cell, and the levels of each cell.

    Parameters
    ----------
    observations : sequence of Observation
        Those without cells are left out.
    residuals : sequence of (n,) array of float
        In the unit of the data.

    Returns
    -------
    energy : (n,) array of float
    labels : dict
        Frame -> (n,) levels; None where a cell has no such frame.
    """
    energy, names = [], sorted({k for o in observations for k in o.labels})
    labels: dict[str, list[np.ndarray]] = {}
    for o, r in zip(observations, residuals):
        if o.cells is None:
            continue
        inside = o.cells >= 0
        count = np.bincount(o.cells[inside])
        total = np.bincount(o.cells[inside], (o.whiten(r) ** 2)[inside])
        good = np.flatnonzero(count > 0)
        energy.append(np.log(np.maximum(total[good] / count[good], 1e-6)))
        for name in names:
            values = o.labels.get(name)
            labels.setdefault(name, []).append(
                np.full(good.size, None, dtype=object) if values is None else np.asarray(values, dtype=object)[good]
            )
    if not energy:
        return np.zeros(0), {}
    return np.concatenate(energy), {name: np.concatenate(v) for name, v in labels.items()}


def attribute(energy: ArrayLike, labels: Mapping[str, np.ndarray]) -> list[Attribution]:
    r"""Frames in order of evidence.

    The means of the other frames' levels are subtracted first (two-way). The largest of the means of L levels is then
    compared with the others, with their mean m and standard deviation s:

    .. math:: t = \frac{m_{max} - m}{s \sqrt{1 + 1/(L-1)}}, \qquad p = \min(1,\; L\, P(T_{L-2} > t))

    p is 1 if fewer than ``min_levels`` levels have enough cells to be compared.

    Parameters
    ----------
    energy : (n,) array of float
        Log energy of cells in units of sigma.
    labels : dict
        Frame -> (n,) levels; None where a cell has no such frame.

    Returns
    -------
    list of Frame

    References
    ----------
    Grubbs 1950, Sample criteria for testing outlying observations.
    """
    energy, attributions = np.asarray(energy, dtype=float), []
    codes = {name: np.unique(values.astype(str), return_inverse=True)[1] for name, values in labels.items()}
    for name, values in labels.items():
        keep = np.array([level is not None for level in values], dtype=bool)
        _, first, code = np.unique(values[keep].astype(str), return_index=True, return_inverse=True)
        if first.size < 2 or keep.sum() < THRESHOLDS.min_cells:
            continue
        e = _without_other_frames(energy[keep], name, {k: c[keep] for k, c in codes.items()})
        count = np.bincount(code)
        mean = np.bincount(code, e) / count
        comparable = np.flatnonzero(count >= THRESHOLDS.min_cell_share * np.median(count))
        top = comparable[int(np.argmax(mean[comparable]))]
        share = float(np.sum(count * (mean - e.mean()) ** 2) / max(np.sum((e - e.mean()) ** 2), 1e-12))
        effect = 10.0 / np.log(10.0) * (mean[top] - e[code != top].mean())
        p = outlier_p_value(mean[comparable])
        attributions.append(Attribution(name, values[keep][first[top]], float(effect), share, p, 1.0, int(keep.sum())))
    corrected = benjamini_hochberg([f.p for f in attributions])
    return sorted((replace(f, q=q) for f, q in zip(attributions, corrected)), key=lambda f: (f.q, -f.share))


def outlier_p_value(means: np.ndarray) -> float:
    """Probability that the largest of some means stands out as much, or more, if all are alike.

    Parameters
    ----------
    means : (n,) array of float

    Returns
    -------
    float
        1 for fewer means than can be compared.

    Examples
    --------
    >>> round(outlier_p_value(np.array([0.0, 0.1, -0.1, 3.0])), 3), outlier_p_value(np.array([0.0, 3.0]))
    (0.003, 1.0)
    """
    if means.size < THRESHOLDS.min_levels:
        return 1.0
    remaining = np.delete(means, int(np.argmax(means)))
    spread = max(float(np.std(remaining, ddof=1)), 1e-12) * np.sqrt(1.0 + 1.0 / remaining.size)
    return min(1.0, means.size * float(scipy.stats.t.sf((means.max() - remaining.mean()) / spread, remaining.size - 1)))


def _without_other_frames(e: np.ndarray, name: str, codes: Mapping[str, np.ndarray]) -> np.ndarray:
    """Log energy less the level means of all other frames, in two sweeps.

    A frame is skipped if each of its levels lies within one level of this frame, as axles within trains: it would
    absorb the difference.
    """
    e = e - e.mean()
    for _ in range(THRESHOLDS.n_sweeps):
        for other_name, code in codes.items():
            if other_name == name or _is_nested(code, codes[name]) or np.unique(code).size >= e.size // 2:
                continue
            count = np.bincount(code)
            e = e - (np.bincount(code, e) / np.maximum(count, 1))[code]
    return e


def _is_nested(inner: np.ndarray, outer: np.ndarray) -> bool:
    pairs = np.unique(inner.astype(np.int64) * (outer.max() + 1) + outer)
    return pairs.size == np.unique(inner).size


def benjamini_hochberg(p: ArrayLike) -> list[float]:
    """Corrected p values: expected share of wrong discoveries if all below are called.

    Parameters
    ----------
    p : (n,) sequence of float

    Returns
    -------
    list of float

    References
    ----------
    Benjamini and Hochberg 1995, Controlling the false discovery rate.

    Examples
    --------
    >>> [round(q, 3) for q in benjamini_hochberg([0.01, 0.04, 0.03])]
    [0.03, 0.04, 0.04]
    """
    p = np.asarray(p, dtype=float)
    if not p.size:
        return []
    order = np.argsort(p)
    ranked = p[order] * p.size / np.arange(1, p.size + 1)
    q = np.minimum(np.minimum.accumulate(ranked[::-1])[::-1], 1.0)
    out = np.empty_like(q)
    out[order] = q
    return [float(v) for v in out]
