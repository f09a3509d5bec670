"""The unit of work: what is computed once.

Why something was not used.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """One thing to compute once: the files of one section and campaign, or one passage file.

    ``label`` is unique within the turnout and kind ("A7/2024-05-13"). ``files`` are (path relative to the raw
    root, size, mtime_ns), sorted. ``campaign`` is the ISO date of a hammer campaign. ``config_hash`` is that
    of the turnout's merged configuration.
    """

    turnout: str
    kind: str
    label: str
    files: tuple[tuple[str, int, int], ...]
    config_hash: str
    section: str | None = None
    campaign: str | None = None


@dataclass(frozen=True)
class Rejection:
    """Why something was not used: a code of ``turnout.errors.REASONS`` and the number behind it."""

    reason: str
    value: float | None = None
    limit: float | None = None
    detail: str = ""
