"""The unit of work of the workflow, and the reason for which a record or a result was rejected."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Unit:
    """One unit of work: the files of one section and campaign, or one passage file. It is computed once.

    ``label`` is unique within the turnout and kind ("A7/2024-05-13"). ``files`` are (path relative to the raw
    root, size, mtime_ns), sorted. ``campaign`` is the ISO date of a hammer campaign. ``config_hash`` is the
    hash of the turnout's merged configuration.
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
    """Reason of a rejection: a code of ``turnout.errors.REASONS``, the value and the limit it violates."""

    reason: str
    value: float | None = None
    limit: float | None = None
    detail: str = ""
