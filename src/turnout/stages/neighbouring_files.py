"""Find the passage files beside one, whose trains may have a row of the train data in its place."""

from __future__ import annotations

import os
from functools import lru_cache
from typing import TYPE_CHECKING

from turnout.passage.timetable import OtherPassage
from turnout.workflow.notes import start_of, starts_near
from turnout.workflow.scan import is_ignored

if TYPE_CHECKING:
    from datetime import datetime
    from pathlib import Path


def passages_beside(path: str, raw_root: str | Path, moment: datetime, tolerance: float) -> list[OtherPassage]:
    """Trains of the other files in the folder of a passage file, by the times in their names.

    Parameters
    ----------
    path : str
        Path of the file below ``raw_root``.
    raw_root : str or Path
        Folder that the path starts from.
    moment : datetime
        When its train passed, naive UTC. The others are taken to pass as long after the start of their files.
    tolerance : float
        Largest difference in time between a passage and its row of the train data. [s]

    Returns
    -------
    list of OtherPassage
        Their numbers of axles are not known. Empty where the name of the file has no time.
    """
    start, folder = start_of(os.path.basename(path)), os.path.dirname(os.path.join(raw_root, path))
    if start is None or not os.path.isdir(folder):
        return []
    starts = _starts_in(folder, os.stat(folder).st_mtime_ns)
    return [OtherPassage(moment + (s - start)) for s in starts_near(start, starts, tolerance)]


@lru_cache(maxsize=8)
def _starts_in(folder: str, changed_at: int) -> list[datetime]:
    """Times in the names of the recordings of a folder, in order; ``changed_at`` [ns] tells its states apart."""
    times = (start_of(name) for name in os.listdir(folder) if not is_ignored(name))
    return sorted(time for time in times if time is not None)
