"""Why something was not used."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rejection:
    """Why something was not used: a code of ``turnout.errors.REASONS`` and the number behind it."""

    reason: str
    value: float | None = None
    limit: float | None = None
    detail: str = ""
