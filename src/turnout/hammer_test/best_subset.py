"""Of more impacts than needed, the subset that agrees best by its pairwise coherence.

An impact beside the axis of the rail excites a twist as well. It may agree with the others well enough to pass every
limit, and bias their mean. A test with spare impacts can do without it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnout.hammer_test.agreement import mean_pairwise_coherence, spectra_of
from turnout.records import Rejection

if TYPE_CHECKING:
    from collections.abc import Sequence

    from turnout.config.settings.receptance import ReceptanceSettings
    from turnout.records import Impact


def best_subset(coherence: np.ndarray, n: int) -> list[int]:
    """The ``n`` impacts with the largest mean coherence of all their pairs, by removal and exchange.

    The impact whose pairs agree least is removed until ``n`` are left. Then single impacts are exchanged as long as
    the mean rises.

    Parameters
    ----------
    coherence : (n_impact, n_impact) array of float
        Of every two impacts; symmetric.
    n : int
        Number of impacts to select, at least 2.

    Returns
    -------
    list of int
        Indices of the selected impacts, rising; all of them if there are no more than ``n``.

    Examples
    --------
    >>> pairs = np.array([[1, 0.9, 0.8, 0.99], [0.9, 1, 0.8, 0.9], [0.8, 0.8, 1, 0.8], [0.99, 0.9, 0.8, 1]])
    >>> best_subset(pairs, 3), best_subset(pairs, 2)
    ([0, 1, 3], [0, 3])
    """
    pairs = np.array(coherence, dtype=float)
    np.fill_diagonal(pairs, 0.0)
    selected = list(range(len(pairs)))
    while len(selected) > n:
        selected.pop(int(np.argmin(pairs[np.ix_(selected, selected)].sum(axis=1))))
    while True:
        outside = [k for k in range(len(pairs)) if k not in selected]
        exchanges = [
            (pairs[k, selected].sum() - pairs[k, i] - pairs[i, selected].sum(), i, k) for i in selected for k in outside
        ]
        rise, removed, added = max(exchanges, default=(0.0, 0, 0))
        if rise <= 1e-12:
            return selected
        selected = sorted({*selected, added} - {removed})


def select_best(impacts: Sequence[Impact], settings: ReceptanceSettings) -> tuple[Impact, ...]:
    """Reject the accepted impacts of one test that are not among the ``best_impacts`` that agree best.

    Parameters
    ----------
    impacts : sequence of Impact
        The impacts of one test. Those of each sampling rate are compared with each other.
    settings : ReceptanceSettings
        With ``best_impacts``, raised to ``minimum_impacts``; 0 uses all that are accepted.

    Returns
    -------
    tuple of Impact
        In the order given, those that are not selected with a rejection.
    """
    selected_impacts = list(impacts)
    n = max(settings.best_impacts, settings.minimum_impacts) if settings.best_impacts else len(impacts)
    for rate in {impact.rate for impact in impacts}:
        index = [k for k, impact in enumerate(impacts) if impact.accepted and impact.rate == rate]
        if len(index) <= n:
            continue
        coherence = mean_pairwise_coherence(*spectra_of([impacts[k] for k in index], settings))
        selected = best_subset(coherence, n)
        agreement = [float(np.mean(np.delete(coherence[i, selected], selected.index(i)))) for i in selected]
        for i, k in enumerate(index):
            if i not in selected:
                value = float(np.mean(coherence[i, selected]))
                detail = (
                    f"its mean coherence with the {n} selected is {value:.4f}, theirs at least {min(agreement):.4f}"
                )
                rejection = Rejection("not_selected", value, min(agreement), detail)
                selected_impacts[k] = replace(impacts[k], rejections=(*impacts[k].rejections, rejection))
    return tuple(selected_impacts)
