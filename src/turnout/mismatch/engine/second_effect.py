"""A second effect beside the first: whether it stands, by the residual of the first effect."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from turnout.mismatch.engine.channel_levels import is_lone_excess
from turnout.mismatch.engine.cross_validation import signature_overlap
from turnout.mismatch.engine.decision import SECOND_RULES
from turnout.mismatch.engine.evidence import assess, excess_ratio
from turnout.mismatch.engine.findings import Findings
from turnout.mismatch.engine.localization import locate
from turnout.mismatch.engine.rule import first_applicable
from turnout.mismatch.engine.search import Search
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.verdict import Verdict


@dataclass(frozen=True)
class EvidenceBesideFirst:
    """What decides about effects beside the first of ``findings``."""

    findings: Findings

    @property
    def search(self) -> Search:
        """The search that goes on."""
        return self.findings.search

    @property
    def first(self) -> Verdict:
        """Verdict on the first effect."""
        return self.findings.verdicts[0]


@dataclass(frozen=True)
class SecondEvidence(EvidenceBesideFirst):
    """What decides whether a second effect stands beside the first (``decision.SECOND_RULES``).

    ``findings`` of the first effect, with the scores of the second. ``second`` is the verdict on these, and
    ``score`` the one that it names, or None.
    """

    second: Verdict
    score: Score | None

    @property
    def named(self) -> Score:
        """Score of the second effect, which has a name."""
        assert self.score is not None
        return self.score

    @property
    def gain(self) -> float:
        """Gain of the second effect. [nats]"""
        return self.named.gain

    @cached_property
    def location(self) -> str:
        """Where the first effect leaves a residual, in words after a space, "" if nothing locates it."""
        leader = next((s for s in self.second.scores[:1] if s.gain > self.search.settings.threshold), None)
        location = locate(self.search.case, self.findings.fit, leader, self.second.cause)
        return "" if location is None else f" {location}"

    @property
    def alternative(self) -> str:
        """Other explanation of what the first effect leaves, "" if the residual has a location of its own."""
        return "" if self.location else f", or {self.first.scores[0].in_words} is only similar to the true effect"

    @property
    def is_choice(self) -> bool:
        """Whether the first effect is a choice of two that may both be present."""
        return self.findings.choice is not None

    @cached_property
    def shape_error_evidence(self) -> float:
        """Evidence that an error in the shape of the first effect may leave to another name. [nats]"""
        first, second = self.first.scores[0], self.named
        if first.candidate.effect.exact or second.gain >= THRESHOLDS.shape_error_share * first.gain:
            return 0.0
        overlap = signature_overlap(self.search.case, second.fit, first.candidate, second.candidate)
        return THRESHOLDS.shape_error_share * first.gain * overlap

    @cached_property
    def is_excess_of_one_recording(self) -> bool:
        """Whether nothing but an excess in one channel of one recording speaks for a second effect."""
        fit = self.findings.fit
        if self.second.trail[-1:] != ("excess_without_candidate",) or excess_ratio(self.search, fit) > 1.0:
            return False
        return is_lone_excess(self.search.case, fit)

    @cached_property
    def split_first(self) -> Verdict:
        """The verdict on the first of two rivals if the second effect, found on top of it, is the other one.

        Their gains alone are similar by chance, and they explain different things. Other scores that keep their gain on
        top of the first are left out as well. The verdict as it is if the second effect is another one.
        """
        rival = self.first.independent_rival
        if not self.is_choice or rival is None or self.second.names[:1] != (rival.family,):
            return self.first
        on_top = {s.candidate.key: s.gain for s in self.second.scores}
        rivals = [
            s
            for s in self.first.scores
            if s is not rival and on_top.get(s.candidate.key, 0.0) < THRESHOLDS.min_kept_gain_share * s.gain
        ]
        retested, _ = assess(self.search, self.findings.base, tuple(rivals))
        return (
            replace(retested, trail=(*self.first.trail, *retested.trail)) if retested.answer == "named" else self.first
        )

    @cached_property
    def continued(self) -> Fit:
        """Fit of both effects, with derivatives unless the simulation fails close to it."""
        return self.search.with_jacobian(self.named.fit)


def add_second(findings: Findings, second: Verdict, score: Score | None) -> tuple[Findings, bool]:
    """The findings after a second effect was sought, and whether it stands beside the first.

    Parameters
    ----------
    findings : Findings
        Those of the first effect, with the scores of the second.
    second : Verdict
        Verdict on these scores.
    score : Score or None
        The one that the verdict names or would name.

    Returns
    -------
    findings : Findings
        The first verdict has the reason of a second one without a name: the reader must know that a residual remains.
    stands : bool
    """
    evidence = SecondEvidence(findings, second, score)
    rule = first_applicable(SECOND_RULES, evidence)
    first, *further = findings.verdicts
    if rule.answer == "first":
        first = replace(first, reason=rule.reason_for(evidence)) if rule.reason else first
        return findings.after(rule, verdicts=(first, *further)), False
    verdicts = (evidence.split_first, *further)
    if rule.answer == "split first":
        return findings.after(rule, verdicts=verdicts), False
    return findings.after(rule, verdicts=(*verdicts, second), fit=evidence.continued), True
