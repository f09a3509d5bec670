"""Channels that a visit leaves unlike the other visits of the turnout: a fault of the logger, or a change beside them.

A channel that no value of the model describes is fitted badly. It then counts little, and the answer of the calibrated
model does not show it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from turnout.stages.stored_visits import StoredVisit

MIN_OTHER_VISITS = 2  # with which the level of a channel is compared: one alone does not tell which is right
# Of the mean square that a fit leaves, over the median of the other visits: docs/decisions/mistakes-in-campaigns.md
MAX_RATIO = 3.0


def notes_on_channels(turnout_id: str, stored: Iterable[StoredVisit]) -> list[str]:
    """A sentence on each visit that is unlike the others, with the channel that differs most.

    Parameters
    ----------
    turnout_id : str
    stored : iterable of StoredVisit
        All visits.

    Returns
    -------
    list of str
        In the order of the visits.
    """
    return [
        f"visit {visit}: {channel} differs from the fitted simulation {ratio:.2g} times as much as at the other visits "
        f"(mean square, {n} visits): turnout diagnose --turnout {turnout_id} --visit {visit} examines it"
        for (visit, _), of_visit in sorted(_unlike_channels(stored).items())
        for ratio, channel, n in [max(of_visit)]
    ]


def unlike_visits(stored: Iterable[StoredVisit]) -> set[str]:
    """Visits whose fits leave more of a channel than those of the other visits.

    Parameters
    ----------
    stored : iterable of StoredVisit
        All visits.

    Returns
    -------
    set of str
    """
    return {visit for visit, _ in _unlike_channels(stored)}


def _unlike_channels(stored: Iterable[StoredVisit]) -> dict[tuple[str, str], list[tuple[float, str, int]]]:
    """Visit and sections -> ratio of a level to that of the other visits, channel, and number of these visits."""
    levels: dict[tuple[str, str], dict[str, float]] = {}
    for s in stored:
        for channel, level in s.levels.items():
            levels.setdefault((s.sections, channel), {})[s.visit] = level
    unlike: dict[tuple[str, str], list[tuple[float, str, int]]] = {}
    for (sections, channel), by_visit in levels.items():
        for visit, level in by_visit.items():
            others = [other for v, other in by_visit.items() if v != visit]
            if len(others) >= MIN_OTHER_VISITS and level > MAX_RATIO * float(np.median(others)):
                ratio = level / float(np.median(others))
                unlike.setdefault((visit, sections), []).append((ratio, channel, len(others)))
    return unlike
