"""Faults of a channel in the hammer tests alone, or in the passages alone: they are recorded with different loggers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

from turnout.physics.hypothesis import ChannelSite, Hypothesis, Masking
from turnout.physics.requirement import IMPACTS, PASSAGES, Requirement
from turnout.physics.term import PhysicsTerm


class OneRecordingType(PhysicsTerm):
    """What these effects have in common: recordings of the other type tell them from the same fault in all."""

    requirements: ClassVar[tuple[Requirement, ...]] = (PASSAGES, IMPACTS)

    @classmethod
    def hypotheses(cls, site: ChannelSite) -> Iterator[Hypothesis]:
        """The starts of the same fault in all recordings; nothing masks it, and the other type shows none."""
        if site.has_passages and site.hammer_pairs:
            for hypothesis in super().hypotheses(site):
                yield replace(hypothesis, masking=Masking(), must_not_oppose=())
