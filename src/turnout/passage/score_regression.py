"""Estimate the effect of train type, speed and axle load on a score, each with the others held fixed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

REQUIRED_COLUMNS = ("train_type", "speed_kmh", "axle_load_t")


@dataclass(frozen=True)
class Effect:
    """``change`` of the score [points] per ``per`` of ``factor``, with standard error and 95 % interval.

    ``adjusted``: the other factors are held fixed; otherwise the groups are compared as they are. ``n`` passages.
    """

    factor: str
    per: str
    change: float
    se: float
    low: float
    high: float
    n: int
    adjusted: bool


def effects(rows: Sequence[Mapping], score: str = "fit_pct") -> tuple[Effect, ...]:
    r"""Raw and adjusted effects of axle load, speed and type on a score of one section.

    .. math:: y = \mu_{type} + \beta_v (v - \bar v) + \beta_P (P - \bar P) + e

    Least squares with standard errors that allow a different variance for every passage (HC3). A factor that the others
    determine has no adjusted effect; for example, where every type has its own load.

    Parameters
    ----------
    rows : sequence of mappings
        With train_type, speed_kmh, axle_load_t and the score; rows without any of them are left out.
    score : str
        Name of the score.

    Returns
    -------
    tuple of Effect
        Empty with fewer than eight complete rows.
    """
    complete = [r for r in rows if all(r.get(k) is not None for k in (*REQUIRED_COLUMNS, score))]
    if len(complete) < 8:
        return ()
    y = np.array([r[score] for r in complete], dtype=float)
    speed = np.array([r["speed_kmh"] for r in complete], dtype=float)
    load = np.array([r["axle_load_t"] for r in complete], dtype=float)
    types = sorted({r["train_type"] for r in complete})
    is_type = np.array([[r["train_type"] == t for t in types] for r in complete], dtype=float)
    slopes = {("axle load", "tonne"): load - load.mean(), ("speed", "10 km/h"): (speed - speed.mean()) / 10}
    results = []
    for (factor, per), x in slopes.items():
        results += _column_effects(y, np.column_stack([np.ones(len(y)), x]), [1], factor, [per], False)
    results += _type_effects(y, is_type, types, np.zeros((len(y), 0)), False)
    design = np.column_stack([is_type, *slopes.values()])
    n_type = len(types)
    for k, (factor, per) in enumerate(slopes):
        results += _column_effects(y, design, [n_type + k], factor, [per], True)
    results += _type_effects(y, is_type, types, np.column_stack(list(slopes.values())), True)
    return tuple(results)


def _type_effects(
    y: np.ndarray, is_type: np.ndarray, types: Sequence[str], covariates: np.ndarray, adjusted: bool
) -> list[Effect]:
    """Effects of each further type against the most frequent one."""
    reference = int(np.argmax(is_type.sum(axis=0)))
    compared = [k for k in range(len(types)) if k != reference]
    design = np.column_stack([np.ones(len(y)), is_type[:, compared], covariates])
    names = [f"{types[k]} instead of {types[reference]}" for k in compared]
    return _column_effects(y, design, list(range(1, 1 + len(compared))), "train type", names, adjusted)


def _column_effects(
    y: np.ndarray, design: np.ndarray, columns: Sequence[int], factor: str, names: Sequence[str], adjusted: bool
) -> list[Effect]:
    """Effects of some columns of a design; columns that the others determine to 99 % are left out."""
    results: list[Effect] = []
    n, p = design.shape
    if n <= p + 2:
        return results
    inverse = np.linalg.pinv(design.T @ design)
    solution = inverse @ design.T @ y
    leverage = np.clip(np.einsum("ij,jk,ik->i", design, inverse, design), 0, 0.999)
    weight = ((y - design @ solution) / (1 - leverage)) ** 2
    covariance = inverse @ (design * weight[:, None]).T @ design @ inverse
    t = scipy.stats.t.ppf(0.975, n - p)
    for column, name in zip(columns, names):
        if _is_determined(design, column):
            continue
        change, se = float(solution[column]), float(np.sqrt(covariance[column, column]))
        results.append(Effect(factor, name, change, se, change - t * se, change + t * se, n, adjusted))
    return results


def _is_determined(design: np.ndarray, column: int) -> bool:
    """Whether the other columns explain this one to 99 % of its variance."""
    other_columns = np.delete(design, column, axis=1)
    x = design[:, column]
    residual = x - other_columns @ np.linalg.lstsq(other_columns, x, rcond=None)[0]
    spread = np.sum((x - x.mean()) ** 2)
    return bool(spread == 0 or np.sum(residual**2) < 0.01 * spread)
