"""Two effects at once: which of the two remain.

The residual of the first effect, or an error in it, may be the second. A name that is rejected alone is therefore
tested again with a second effect in the model.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.cross_validation import held_out_score
from turnout.mismatch.engine.decision import PAIR_RULES, judge
from turnout.mismatch.engine.evidence import (
    assess,
    excess_ratio,
    explained_share,
    predicts_reserved,
    residual_structure,
    worst_excess,
)
from turnout.mismatch.engine.findings import Findings
from turnout.mismatch.engine.fit_quality import gain_error
from turnout.mismatch.engine.reserved_data import reserved_fit
from turnout.mismatch.engine.rule import first_applicable
from turnout.mismatch.engine.second_effect import EvidenceBesideFirst
from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.verdict import Verdict


@dataclass(frozen=True)
class PairEvidence(EvidenceBesideFirst):
    """What decides which of two effects remain (``decision.PAIR_RULES``), computed when a rule asks for it."""

    @property
    def second(self) -> Verdict:
        """Verdict on the second effect."""
        return self.findings.verdicts[1]

    @property
    def second_text(self) -> str:
        """Name of the second effect with its position, sensor or wheelset, in words."""
        return self.second.scores[0].candidate.in_words

    @property
    def is_choice(self) -> bool:
        """Whether the first effect was a choice of two that may both be present."""
        return self.findings.choice is not None

    @property
    def first_is_unknown(self) -> bool:
        """Whether the first effect got no name alone."""
        return self.findings.is_unknown

    @property
    def is_pair(self) -> bool:
        """Whether there are two verdicts, each of which states one effect."""
        return self.findings.is_pair

    @property
    def both_stand(self) -> bool:
        """Whether there are two effects, of which neither is redundant."""
        return self.is_pair and not self.first_is_redundant and not self.second_fails_reserved

    @cached_property
    def second_alone(self) -> Fit | None:
        """The fit with the second effect alone, None if it cannot be simulated.

        The first effect is worth what the pair gains over it.
        """
        fit = self.findings.fit
        second = fit.candidates[1]
        try:
            return self.search.fit((second,), fit.psi[fit.part(second)], fit.values)
        except SimulationError:
            return None

    @cached_property
    def converged_second(self) -> Fit | None:
        """The fit with the second effect alone, converged."""
        return None if self.second_alone is None else self.search.converge(self.second_alone)

    @cached_property
    def first_beside_second(self) -> Verdict | None:
        """Verdict on the first effect and its close rivals, each with the second effect in the model.

        None if there is no second effect, if it cannot be simulated alone, or if the two do not confirm one another.
        """
        verdicts, base = self.findings.verdicts, self.findings.base
        if len(verdicts) < 2 or self.second_alone is None:
            return None
        if not self.first.scores[0].is_independent_of(self.second.scores[0]):
            return None
        pairs = sorted(self._scores_beside_second(self.second_alone), key=lambda s: (not s.is_reportable, -s.gain))
        pair_fit, case = pairs[0].fit, self.search.case
        return judge(
            pairs,
            worst_excess(self.search, base),
            self.search.settings,
            consistent=predicts_reserved(self.search, base, pairs[0]),
            structure=residual_structure(case, pair_fit),
            residual_excess=excess_ratio(self.search, pair_fit),
            disturbed=bool(case.disturbed_recordings),
        )

    @property
    def first_passes_beside_second(self) -> bool:
        """Whether the first effect, or a close rival, passes with the second in the model."""
        verdict = self.first_beside_second
        return verdict is not None and verdict.answer in ("named", "a_or_b")

    @cached_property
    def first_is_redundant(self) -> bool:
        """Whether the first of a pair gets no name beside the second: it had absorbed the second effect."""
        if not self.is_pair or self.converged_second is None:
            return False
        gain = _evidence_gain(self.findings.fit, self.converged_second, self.first.scores[0].candidate)
        return gain <= self.search.settings.threshold

    @cached_property
    def second_score(self) -> Score:
        """Score of the second effect without the first."""
        second, fit, base = self.second.scores[0], self.converged_second, self.findings.base
        assert fit is not None
        gain = _evidence_gain(fit, base, second.candidate)
        explained = explained_share(self.search, base, fit)
        return replace(second, fit=fit, gain=gain, explained=explained, unmasked_gain=0.0)

    @property
    def second_explains_too_little(self) -> bool:
        """Whether the second effect without the first explains too little of the excess."""
        excess, settings = worst_excess(self.search, self.findings.base), self.search.settings
        return self.second_score.explains_too_little(excess, settings) and not self.second_score.exemption_reason(
            settings
        )

    @cached_property
    def second_without_first(self) -> Verdict | None:
        """Verdict on the second effect as if the first, which has no name alone, were not in the library.

        None if it cannot be simulated alone, or if the two do not confirm one another.
        """
        if len(self.findings.verdicts) < 2 or self.converged_second is None:
            return None
        leader, second = self.first.scores[0], self.second_score
        if not leader.is_independent_of(second):
            return None
        others = (s for s in self.first.scores[1:] if s.family != second.family and leader.is_independent_of(s))
        return assess(self.search, self.findings.base, (second, *others))[0]

    @property
    def second_passes_without_first(self) -> bool:
        """Whether the second effect has a name where the first one is not in the library."""
        verdict = self.second_without_first
        return verdict is not None and verdict.answer == "named" and verdict.names[:1] == self.second.names[:1]

    @cached_property
    def converged_first(self) -> Fit:
        """The fit with the first effect alone, converged."""
        return self.search.converge(self.first.scores[0].fit)

    @cached_property
    def second_predicts_worse(self) -> bool:
        """Whether the pair predicts the reserved recordings worse than the first effect alone.

        Worse means by more than ``max_fit_loss`` points and the standard error of the difference.
        """
        if not self.is_pair or not self.search.case.reserved:
            return False
        return self._predicts_worse_than(self.first.scores[0].fit) and self._predicts_worse_than(self.converged_first)

    @cached_property
    def second_improves_nothing(self) -> bool:
        """Whether the reserved recordings show the second effect, and the pair predicts them no better than the first.

        They show it if its part of the prediction is large enough for the evidence that a name needs.
        """
        if not self.is_pair or not self.search.case.reserved:
            return False
        return self._improves_nothing_over(self.first.scores[0].fit) and self._improves_nothing_over(
            self.converged_first
        )

    @property
    def second_fails_reserved(self) -> bool:
        """Whether the reserved recordings withdraw the second effect."""
        return self.second_predicts_worse or self.second_improves_nothing

    def _improves_nothing_over(self, first_alone: Fit) -> bool:
        comparison = self._reserved_comparison(first_alone)
        if comparison is None:
            return False
        lost_percent, before, after = comparison
        changes = zip(self.search.case.reserved, before, after)
        evidence = 0.5 * sum(o.effective * float(np.sum(o.whiten(a - b) ** 2)) for o, b, a in changes)
        return evidence >= self.search.settings.threshold and lost_percent >= 0.0

    def _predicts_worse_than(self, first_alone: Fit) -> bool:
        comparison = self._reserved_comparison(first_alone)
        if comparison is None:
            return False
        lost_percent, before, after = comparison
        return lost_percent > max(THRESHOLDS.max_fit_loss, gain_error(self.search.case.reserved, before, after))

    def _reserved_comparison(self, first_alone: Fit) -> tuple[float, list[np.ndarray], list[np.ndarray]] | None:
        """Points of fit of reserved recordings that the second effect loses, and predictions before and after.

        None where a prediction is not possible.
        """
        (before, before_percent), (after, after_percent) = (
            reserved_fit(self.search.case, fit) for fit in (first_alone, self.findings.fit)
        )
        if before is None or after is None or before_percent is None or after_percent is None:
            return None
        return before_percent - after_percent, before, after

    def _scores_beside_second(self, second_alone: Fit) -> Iterator[Score]:
        """The first effect's leader and its close rivals, each with its gain beside the second effect."""
        settings, fit, scores = self.search.settings, self.findings.fit, self.first.scores
        leader, second = scores[0], fit.candidates[1]
        yield self._score_beside_second(fit, second_alone, leader)
        close = leader.gain - max(settings.margin, THRESHOLDS.max_loss_share * leader.gain)
        for rival in [s for s in scores[1:] if s.gain > max(close, settings.threshold)][: THRESHOLDS.max_rivals]:
            psi = np.concatenate([rival.fit.psi, fit.psi[fit.part(second)]])
            try:
                pair_fit = self.search.fit((rival.candidate, second), psi, fit.values)
            except SimulationError:
                continue
            yield self._score_beside_second(pair_fit, second_alone, rival)

    def _score_beside_second(self, pair_fit: Fit, second_alone: Fit, score: Score) -> Score:
        """Score of a first effect by the gain of the pair over the second alone. Its explained share is the pair's."""
        case = self.search.case
        with_first, without_first = held_out_score(case, pair_fit), held_out_score(case, second_alone)
        by_condition = {c: with_first[c] - without_first[c] for c in without_first}
        gain = _evidence_gain(pair_fit, second_alone, score.candidate)
        explained = explained_share(self.search, self.findings.base, pair_fit)
        worst = min(by_condition.values(), default=0.0)
        return replace(score, gain=gain, fit=pair_fit, explained=explained, worst_gain=worst, by_condition=by_condition)


def settle_pair(findings: Findings) -> Findings:
    """The findings with those effects that remain of a pair, by the first of ``PAIR_RULES`` that applies.

    A first effect that was rejected alone passes if it does so beside the second. If it does not, the second has a name
    where it would have one without the first. A first name is dropped if it adds
    too little to the second, and a second one if reserved recordings are predicted worse with it. A choice of two
    rivals stays one unless both stand as a pair.

    Parameters
    ----------
    findings : Findings
        With a verdict for each effect that was sought.

    Returns
    -------
    Findings
    """
    evidence = PairEvidence(findings)
    rule = first_applicable(PAIR_RULES, evidence)
    verdicts, base = findings.verdicts, findings.base
    if rule.answer == "choice":
        assert findings.choice is not None
        return findings.choice.after(rule)
    if rule.answer == "both again":
        first = evidence.first_beside_second
        assert first is not None
        first = replace(first, trail=(*evidence.first.trail, *first.trail))
        return findings.after(rule, verdicts=(first, *verdicts[1:]), fit=first.scores[0].fit)
    if rule.answer == "second without first":
        second = evidence.second_without_first
        assert second is not None
        trail = (*evidence.first.trail, *second.trail)
        second = replace(second, reason=rule.reason_for(evidence), trail=trail)
        return findings.after(rule, verdicts=(second,), fit=second.scores[0].fit)
    if rule.answer == "unknown first":
        return findings.after(rule, verdicts=verdicts[:1], fit=base)
    if rule.answer == "first":
        first = replace(evidence.first, reason=rule.reason_for(evidence))
        return findings.after(rule, verdicts=(first,), fit=evidence.converged_first)
    if rule.answer in ("second", "unknown second"):
        score, second = evidence.second_score, evidence.second
        second = replace(second, scores=(score, *second.scores[1:]))
        if rule.answer == "second":
            return findings.after(rule, verdicts=(second,), fit=score.fit)
        second = second.as_unknown(rule.reason_for(evidence), findings.search.settings)
        return findings.after(rule, verdicts=(second,), fit=base)
    return findings.after(rule)


def _evidence_gain(fit: Fit, without: Fit, candidate: Candidate) -> float:
    """Evidence for a candidate by the fits with and without it. [nats]"""
    return fit.evidence - without.evidence + candidate.naming.external_evidence - np.log(candidate.site.n_scanned)
