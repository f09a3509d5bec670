"""How far a change of adjacent supports reaches: 95 % intervals of its first and its last support."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from turnout.mismatch.calibrated.belief import StateParameter
from turnout.mismatch.calibrated.change import OnsetEvidence
from turnout.mismatch.calibrated.constants import CALIBRATION
from turnout.mismatch.calibrated.model_answer import StretchEnds, name_of

STRETCH_GROUPS = ("ballast", "pad")  # of which adjacent supports change together


def stretch_ends(
    alike: Sequence[OnsetEvidence], by_name: Mapping[str, StateParameter], probability: float | None = None
) -> StretchEnds | None:
    """Intervals of the ends of a change, over all single supports and stretches that have its name.

    Each candidate is equally probable before, so that its probability is its likelihood ratio over the sum of all. An
    interval is the shortest that contains the end with at least this probability.

    Parameters
    ----------
    alike : sequence of OnsetEvidence
        Candidates with the name and the sign of the change, at least one.
    by_name : mapping of str to StateParameter
        Parameters of the model.
    probability : float or None
        None: ``CALIBRATION.interval_probability``.

    Returns
    -------
    StretchEnds or None
        None if the change is not one of ballast or pads.
    """
    runs = [_run(e, by_name) for e in alike]
    if any(not run for run in runs):
        return None
    weights = np.exp(np.array([e.gain for e in alike]) - max(e.gain for e in alike))
    covered = CALIBRATION.interval_probability if probability is None else probability
    low, high = (_shortest(np.array([at(run) for run in runs]), weights, covered) for at in (min, max))
    longest = max((len(run) for run, w in zip(runs, weights) if w > (1.0 - covered) * weights.sum()), default=1)
    group = _group(alike[0], by_name)
    positions = [p.position for p in by_name.values() if p.may_change and p.group == group and p.position is not None]
    goes_on = longest >= CALIBRATION.max_stretch
    is_first_open, is_last_open = goes_on or low[0] <= min(positions), goes_on or high[1] >= max(positions)
    return StretchEnds((None if is_first_open else low[0], low[1]), (high[0], None if is_last_open else high[1]))


def changes_alike(
    evidence: Sequence[OnsetEvidence], leader: OnsetEvidence, by_name: Mapping[str, StateParameter]
) -> list[OnsetEvidence]:
    """Candidates with the name and the sign of a change, itself among them.

    Parameters
    ----------
    evidence : sequence of OnsetEvidence
        All candidates.
    leader : OnsetEvidence
        The change.
    by_name : mapping of str to StateParameter
        Parameters of the model.

    Returns
    -------
    list of OnsetEvidence
    """
    name, size = name_of(leader.effect, by_name), leader.size[0]
    return [e for e in evidence if name_of(e.effect, by_name) == name and e.size[0] * size > 0.0]


def _group(evidence: OnsetEvidence, by_name: Mapping[str, StateParameter]) -> str:
    return by_name[next(iter(evidence.effect.direction))].group


def _run(evidence: OnsetEvidence, by_name: Mapping[str, StateParameter]) -> list[float]:
    """Positions of the springs that change, [] if it is no change of supports."""
    group = _group(evidence, by_name)
    changed = [by_name[name] for name in evidence.effect.direction]
    positions = [p.position for p in changed if p.group == group and p.position is not None]
    return sorted(positions) if group in STRETCH_GROUPS else []


def _shortest(positions: np.ndarray, weights: np.ndarray, probability: float) -> tuple[float, float]:
    """Shortest range of positions that has at least this share of the weights."""
    values, index = np.unique(positions, return_inverse=True)
    total = np.concatenate([[0.0], np.cumsum(np.bincount(index, weights) / weights.sum())])
    n = values.size
    ranges = [(i, j) for i in range(n) for j in range(i, n) if total[j + 1] - total[i] >= probability - 1e-12]
    i, j = min(ranges, key=lambda r: (values[r[1]] - values[r[0]], total[r[0]] - total[r[1] + 1]))
    return float(values[i]), float(values[j])
