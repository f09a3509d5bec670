"""Null bands: what models that have nothing to do with the section score on the same data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnout.passage.basis import wheel_basis
from turnout.passage.scores import Scores, score
from turnout.records import ModalModel


@dataclass(frozen=True)
class NullBand:
    """95 % quantile of each score over the null models, and their number. [%]"""

    fit: float
    forecast: float
    leave_one_out: float
    n: int

    @classmethod
    def of(cls, scores: list[Scores]) -> NullBand:
        """Quantiles over the finite scores; nan where there are none."""
        table = np.array([[s.fit, s.forecast, s.leave_one_out] for s in scores], dtype=float).reshape(-1, 3)
        quantiles = [np.quantile(c[np.isfinite(c)], 0.95) if np.isfinite(c).any() else np.nan for c in table.T]
        return cls(*(float(q) for q in quantiles), n=len(scores))


def random_models(n: int, order: int, low: float, high: float, rate: float, seed: int) -> tuple[ModalModel, ...]:
    """Models of ``order`` whose pole pairs are anywhere in the band: frequency log-uniform between ``low`` and
    ``high`` [Hz], damping log-uniform between 0.02 and 0.35, the range of the paper's tables widened a little.

    >>> [m.order for m in random_models(2, 4, 80.0, 800.0, 20000.0, seed=1)]
    [4, 4]
    """
    rng = np.random.default_rng(seed)
    models = []
    for _ in range(n):
        pairs = max(order // 2, 1)
        omega = 2 * np.pi * np.exp(rng.uniform(np.log(low), np.log(high), pairs))
        zeta = np.exp(rng.uniform(np.log(0.02), np.log(0.35), pairs))
        pole = np.exp((-zeta + 1j * np.sqrt(1 - zeta**2)) * omega / rate)
        a = np.zeros((2 * pairs, 2 * pairs))
        for i, z in enumerate(pole):
            a[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[z.real, z.imag], [-z.imag, z.real]]
        c = rng.standard_normal(2 * pairs)
        models.append(ModalModel(a, c * np.tile([1.0, -1.0], pairs), c, rate, ()))
    return tuple(models)


def null_bases(order: int, through, rate: float, settings) -> list:
    """Bases of the random models behind the same filter: the same for every passage, so made once."""
    models = random_models(settings.null_models, order, settings.band_low, settings.band_high, rate, settings.null_seed)
    return [wheel_basis(model, through, rate, longest=0.1) for model in models]


def null_scores(data, expected, bases, settings) -> list[Scores]:
    """Scores of every null model on the data of one sensor."""
    return [score(data, expected, basis, settings) for basis in bases]
