"""Compare stated probabilities with the share of right answers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout_blind.score.matching import CaseResult

MIN_GROUP_SIZE = 5  # smallest group of stated probabilities that is compared with its bar [cases]
N_CHANCE = 2000  # repetitions of a set with exact probabilities; a quantile of 0.025 then rests on 50 of them
CHANCE_SEED = 1
ONE_NAME = "one name"
ANSWER_KINDS = {"none": "none", "unknown": "unknown", "a_or_b": "a or b", ONE_NAME: ONE_NAME}


def _stated_probabilities(results: Sequence[CaseResult]) -> tuple[np.ndarray, np.ndarray]:
    """Stated probability of the cases that have one, ascending, and 1.0 where the answer is right."""
    stated = sorted((j.probability, j.is_answer_right) for j in results if j.probability is not None)
    p, right = np.array(stated, dtype=float).reshape(-1, 2).T
    return p, right


def _fifths(p: np.ndarray) -> np.ndarray:
    """(n_group, n) membership of five groups of equal size, except that equal probabilities stay together."""
    edges = np.unique(np.quantile(p, np.arange(1, 5) / 5.0, method="inverted_cdf"))
    group = np.searchsorted(edges, p)
    return np.unique(group)[:, None] == group


def reliability(results: Sequence[CaseResult]) -> list[tuple[float, float, int]]:
    """Stated and observed probability of five groups of equal size, except that ties stay together.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.

    Returns
    -------
    list of (float, float, int)
        Mean stated probability, share right and number of cases.
    """
    p, right = _stated_probabilities(results)
    return [(float(p[g].mean()), float(right[g].mean()), int(g.sum())) for g in _fifths(p)] if p.size else []


def worst_difference(results: Sequence[CaseResult]) -> tuple[float | None, tuple[float, float] | None]:
    """Largest difference between stated and observed probability of the fifths, and its range by chance.

    In a small set exact probabilities differ from the observed shares too. The range holds 95 % of the differences
    of sets in which each answer is right with the probability that it states.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.

    Returns
    -------
    (float, (float, float)) or (None, None)
        Difference, and its 2.5 and 97.5 % points by chance; None without a group of ``MIN_GROUP_SIZE``.
    """
    p, right = _stated_probabilities(results)
    groups = _fifths(p) if p.size else np.zeros((0, 0), dtype=bool)
    groups = groups[groups.sum(axis=1) >= MIN_GROUP_SIZE]
    if not len(groups):
        return None, None
    weights = groups / groups.sum(axis=1, keepdims=True)
    drawn = np.random.default_rng(CHANCE_SEED).random((N_CHANCE, p.size)) < p
    by_chance = np.abs((drawn - p) @ weights.T).max(axis=1)
    low, high = np.quantile(by_chance, [0.025, 0.975])
    return float(np.abs(weights @ (right - p)).max()), (float(low), float(high))


def by_answer(results: Sequence[CaseResult]) -> dict[str, tuple[float, int, int]]:
    """Mean stated probability, number right and number of cases by kind of the first answer.

    Parameters
    ----------
    results : sequence of CaseResult
        Results of the cases.

    Returns
    -------
    dict of (float, int, int)
        By "none", "unknown", "a or b" and "one name", those that occur.
    """
    table = {}
    for kind in ANSWER_KINDS.values():
        of_kind = [j for j in results if ANSWER_KINDS.get(j.first_answer, ONE_NAME) == kind]
        p, right = _stated_probabilities(of_kind)
        if p.size:
            table[kind] = float(p.mean()), int(right.sum()), p.size
    return table
