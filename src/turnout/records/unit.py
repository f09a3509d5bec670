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
    """Reason why data were rejected, with the facts as fields; ``detail`` states them in words, for people only.

    Parameters
    ----------
    reason : str
        Code of ``turnout.reasons.REASONS``.
    value : float, optional
        Number that led to the rejection. [unit of the reason]
    limit : float, optional
        Limit that ``value`` violates. [unit of ``value``]
    detail : str
        The facts in words. No part of the program reads them.
    channel : str, optional
        Channel that the reason concerns. A reason of ``turnout.errors.CHANNEL_REASONS`` has one wherever the names of
        the channels are known.
    other_channel : str, optional
        Channel that is exchanged with ``channel``, for "channels_swapped".
    record : int, optional
        Record of the file that the reason refers to, from 0. Of a "duplicate" it is the earlier record.
    time : float, optional
        Time from which the reason applies, from the first sample of the recording. [s]
    """

    reason: str
    value: float | None = None
    limit: float | None = None
    detail: str = ""
    channel: str | None = None
    other_channel: str | None = None
    record: int | None = None
    time: float | None = None

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that the reason concerns: none, one, or two that are exchanged."""
        return tuple(name for name in (self.channel, self.other_channel) if name is not None)
