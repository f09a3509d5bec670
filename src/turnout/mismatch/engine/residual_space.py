"""Columns in which an unnamed cause would show, as a case gives them to the localization."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class ResidualSpace:
    """Columns on some observations, and the subspaces of them.

    ``names`` of the observations. ``columns`` (n, k) on them one behind the other, in the unit of the data.
    ``combinations`` (frame, level) -> (k, m) combinations of the columns, (m,) indices of columns, or None for all of
    them. A level of "place" is a position [m], or the first and last position of a stretch.

    ``law`` of a cause that is the same for several recordings: of such laws the one with the most evidence counts. It
    is "" where the cause is free in each recording.
    """

    names: tuple[str, ...]
    columns: np.ndarray
    combinations: Mapping[tuple[str, Any], np.ndarray | None]
    law: str = ""
