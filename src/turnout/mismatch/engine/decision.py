"""Decision of a diagnosis: none, named, a or b, unknown or numerics, as tables of rules.

Each step of the decision has one table, and the first of its rules that applies decides. ``NUMERICS_RULES``: whether
the simulation is accurate enough. ``EFFECT_RULES``: the answer on one effect. ``SECOND_RULES``: whether a second effect
stands beside the first. ``PAIR_RULES``: which of the two remain. ``NAME_RULES``: the grade of a name.
``RESERVED_RULES``: whether reserved recordings confirm the answer. ``Verdict.trail`` names the rules that applied.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.engine.verdict import Verdict, calibrate, posterior, swap_with_unknown

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.map_fit import Fit
    from turnout.mismatch.engine.reserved_data import Verification
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.two_effects import PairEvidence, SecondEvidence


Facts = TypeVar("Facts")


@dataclass(frozen=True)
class Rule(Generic[Facts]):
    """One line of a table of the decision.

    Attributes
    ----------
    name : str
        Entry of ``Verdict.trail``.
    applies : callable
        Facts of the step -> whether the rule applies.
    answer : str
        Answer of the verdict, or which of two verdicts remain.
    reason : str
        Reason in words, a format string with the facts as ``e``.
    page : str
        Page below ``docs`` that gives the reason for the rule.
    cause : str
        "clock" or "train" if the answer rests on recordings that were not fitted, else "".
    """

    name: str
    applies: Callable[[Facts], Any]
    answer: str
    reason: str
    page: str
    cause: str = ""

    def reason_for(self, evidence: Facts) -> str:
        """Reason in words for these facts."""
        return self.reason.format(e=evidence)


def first_applicable(rules: Sequence[Rule[Facts]], evidence: Facts) -> Rule[Facts]:
    """First of the rules that applies to the evidence. The last rule of a table always applies."""
    return next(rule for rule in rules if rule.applies(evidence))


HOW, PAIRS = "mismatch.md", "decisions/two-effects.md"
LOCATED, ENDS = "decisions/residual-localization.md", "decisions/joint-fit-convergence.md"


def _always(_: Any) -> bool:
    return True


# fmt: off
NUMERICS_RULES: tuple[Rule[NumericalError], ...] = (
    Rule("own_error_is_material", lambda e: e.is_material and e.exceeds_limit, "numerics",
         "own numerical error is {e.share:.0%} of the mismatch: refine mesh and step first", HOW),
    Rule("simulation_is_accurate", _always, "", "", HOW),
)  # the answer of one effect is sought if no error is material

EFFECT_RULES: tuple[Rule[EffectEvidence], ...] = (
    Rule("explains_too_little", lambda e: e.has_leader and e.explains_too_little and not e.exemption, "unknown",
         "the best candidate explains {e.leader.explained:.0%} of the excess", HOW),
    Rule("leaves_too_much", lambda e: e.has_leader and e.residual_excess > e.settings.leftover, "unknown",
         "{e.leader.family} leaves {e.residual_excess:.0f} times the level of controls", HOW),
    Rule("excess_without_candidate", lambda e: e.shows_nothing and e.excess > 1.0, "unknown",
         "above the level of controls, and no candidate helps", HOW),
    Rule("sensors_shake_without_wheel", lambda e: e.shows_nothing and e.disturbed, "unknown",
         "something shakes all sensors while no wheel is near", LOCATED, cause="clock"),
    Rule("train_unlike_its_file", lambda e: e.shows_nothing and e.mismatched_trains, "unknown",
         "most passages of {e.train_names} do not look like its vehicle file", LOCATED, cause="train"),
    Rule("no_candidate_passes", lambda e: not e.has_leader, "none", "nothing above the thresholds", HOW),
    Rule("weak_and_contradicted", lambda e: e.shows_nothing, "none",
         "nothing above the thresholds but {e.leader.family}, which does not hold elsewhere", ENDS),
    Rule("reserved_not_predicted", lambda e: not e.consistent, "unknown",
         "{e.leader.family} does not hold on conditions it was not fitted to", HOW),
    Rule("residual_has_structure", lambda e: e.structure > e.settings.structure_left and e.residual_excess > 1.0,
         "unknown", "a free law still explains {e.structure:.0%} of what {e.leader.family} leaves", HOW),
    Rule("single_witness", lambda e: e.leader.single_witness, "unknown",
         "{e.leader.family} hangs on {e.leader.single_witness} alone, which others do not confirm", ENDS),
    Rule("condition_contradicts", lambda e: e.contradicted, "unknown",
         "{e.leader.family} makes one condition worse by {e.largest_loss:.0f} nats", ENDS),
    Rule("size_at_limit", lambda e: e.limit_forms, "a_or_b", "{e.leader.family} is at its limit", PAIRS),
    Rule("rival_within_margin", lambda e: e.rivals, "a_or_b", "within the margin of each other", HOW),
    Rule("exempt_from_explaining", lambda e: e.explains_too_little, "named",
         "{e.exemption}; it explains {e.leader.explained:.0%} of the excess", PAIRS),
    Rule("passes", _always, "named", "", HOW),
)

SECOND_RULES: tuple[Rule[SecondEvidence], ...] = (
    Rule("unnamed_beside_name", lambda e: e.first.answer == "named" and e.second.answer == "unknown", "first",
         "something else shows beside it: {e.second.reason}", PAIRS),
    Rule("second_is_no_single_effect", lambda e: not e.second.is_single_effect, "first", "", PAIRS),
    Rule("second_may_be_shape_of_first", lambda e: e.gain < e.shape_error_evidence, "first", "", PAIRS),
    Rule("rivals_stay_a_choice", lambda e: e.is_choice and not e.split_first.is_single_effect, "first", "", PAIRS),
    Rule("second_has_no_derivatives", lambda e: not e.continued.jacobian, "split first", "", ENDS),
    Rule("second_stands", _always, "both", "", PAIRS),
)

PAIR_RULES: tuple[Rule[PairEvidence], ...] = (
    Rule("choice_not_decided", lambda e: e.is_choice and not e.both_stand, "choice", "", PAIRS),
    Rule("first_passes_beside_second", lambda e: e.first_is_unknown and e.first_passes_beside_second, "both anew",
         "", PAIRS),
    Rule("first_stays_unknown", lambda e: e.first_is_unknown, "unknown first", "", PAIRS),
    Rule("no_pair", lambda e: not e.is_pair, "all", "", PAIRS),
    Rule("second_left_alone_explains_too_little", lambda e: e.first_is_redundant and e.second_explains_too_little,
         "unknown second", "the best candidate explains {e.second_score.explained:.0%} of the excess", PAIRS),
    Rule("first_adds_too_little", lambda e: e.first_is_redundant, "second", "", PAIRS),
    Rule("second_predicts_reserved_worse", lambda e: e.second_predicts_worse, "first",
         "something else shows beside it: {e.second.names[0]}, which foretells recordings never used worse", PAIRS),
    Rule("both_stand", _always, "all", "", PAIRS),
)

NAME_RULES: tuple[Rule[NameEvidence], ...] = (
    Rule("size_known_from_below", lambda e: e.score.is_unbounded, "a_or_b",
         "the size of {e.score.family} is known from below alone", PAIRS),
    Rule("reaches_control_level", lambda e: e.excess <= 1.0, "A", "", HOW),
    Rule("must_reach_control_level", lambda e: e.score.candidate.naming.must_reach_control_level, "unknown",
         "{e.score.family} would leave nothing, and more is left than in sound turnouts", LOCATED),
    Rule("leaves_some_residual", _always, "B", "", HOW),
)

RESERVED_RULES: tuple[Rule[ReservedEvidence], ...] = (
    Rule("reserved_predicted_worse", lambda e: e.is_single_name_of_grade_b and e.verification.is_worse, "unknown",
         "{e.verdict.names[0]} leaves more than sound turnouts do and foretells recordings never used worse", ENDS),
    Rule("reserved_not_explained",
         lambda e: e.verdict.answer == "none" and e.verification.reserved_excess > THRESHOLDS.max_reserved_excess,
         "unknown", "recordings that were never used are not foretold as in sound turnouts", HOW),
    Rule("not_contradicted", _always, "", "", HOW),
)
# fmt: on

RULES = (*NUMERICS_RULES, *EFFECT_RULES, *SECOND_RULES, *PAIR_RULES, *NAME_RULES, *RESERVED_RULES)


def is_contradicted(worst_gain: float, gain: float, settings: MismatchSettings) -> bool:
    """Whether a held-out condition, with gain ``worst_gain``, contradicts a name that gains ``gain`` in all."""
    return worst_gain < -max(THRESHOLDS.contradiction_threshold * settings.threshold, THRESHOLDS.max_loss_share * gain)


def likeliest(scores: Sequence[Score], excess: float, settings: MismatchSettings) -> Score:
    """The likeliest of ``scores``. If it explains too little, the likeliest that other data support, if any."""
    ranked = sorted(scores, key=lambda s: -s.gain)
    supported = [s for s in ranked if s.exemption_reason(settings)]
    return supported[0] if supported and ranked[0].explains_too_little(excess, settings) else ranked[0]


@dataclass(frozen=True)
class EffectEvidence:
    """What the answer on one effect rests on.

    Attributes
    ----------
    scores : sequence of Score
        Best of each family, any order.
    excess : float
        Weighted mean square of the base model over the control level.
    settings : MismatchSettings
    consistent : bool
        The best candidate predicts reserved conditions about as well as those it was fitted to.
    structure : float
        Share of the residual of the best candidate that a free force law of the state still explains.
    residual_excess : float
        Weighted mean square of the residual of the best candidate over the control level.
    disturbed : bool
        Another source than a train shakes the sensors in some recordings. These are not among those fitted.
    mismatched_trains : tuple of str
        Trains, most recordings of which are not among those fitted, since they do not agree with the vehicle file.
    """

    scores: Sequence[Score]
    excess: float
    settings: MismatchSettings
    consistent: bool = True
    structure: float = 0.0
    residual_excess: float = 1.0
    disturbed: bool = False
    mismatched_trains: tuple[str, ...] = ()

    @cached_property
    def passing(self) -> list[Score]:
        """Reportable candidates with enough evidence for a name, the largest gain first."""
        ranked = sorted(self.scores, key=lambda s: -s.gain)
        return [s for s in ranked if s.gain > self.settings.threshold and s.is_reportable]

    @property
    def has_leader(self) -> bool:
        """Whether any candidate has enough evidence for a name."""
        return bool(self.passing)

    @cached_property
    def leader(self) -> Score:
        """The likeliest of the passing candidates."""
        return likeliest(self.passing, self.excess, self.settings)

    @cached_property
    def ranked(self) -> tuple[Score, ...]:
        """All scores: the leader, if there is one, and the rest by gain."""
        ranked = sorted(self.scores, key=lambda s: -s.gain)
        return (self.leader, *(s for s in ranked if s is not self.leader)) if self.has_leader else tuple(ranked)

    @cached_property
    def explains_too_little(self) -> bool:
        """Whether the leader explains too little of the excess to be its cause."""
        return self.leader.explains_too_little(self.excess, self.settings)

    @cached_property
    def exemption(self) -> str:
        """Reason why the residual does not count against the leader, "" if there is none."""
        return self.leader.exemption_reason(self.settings)

    @cached_property
    def contradicted(self) -> bool:
        """Whether held-out conditions contradict the leader."""
        return bool(self.leader.single_witness) or is_contradicted(
            self.leader.worst_gain, self.leader.gain, self.settings
        )

    @cached_property
    def shows_nothing(self) -> bool:
        """Whether no candidate passes, or only a weak one that other conditions contradict, without any excess."""
        if not self.has_leader:
            return True
        is_weak = self.leader.gain < THRESHOLDS.weak_gain * self.settings.threshold
        return (self.contradicted or not self.consistent) and is_weak and self.excess <= 1.0

    @property
    def train_names(self) -> str:
        """Trains that do not agree with their vehicle file, in one string."""
        return ", ".join(self.mismatched_trains)

    @property
    def largest_loss(self) -> float:
        """Loss of the condition that loses most by the leader. [nats]"""
        return -self.leader.worst_gain

    @cached_property
    def limit_forms(self) -> list[Score]:
        """Passing candidates that the leader equals at its limit. Ballast without stiffness is a hanging sleeper."""
        return [s for s in self.passing if s.is_limit_of(self.leader) and s.explained >= self.settings.explained]

    @cached_property
    def rivals(self) -> list[Score]:
        """Reportable candidates within the margin of the leader, less those of which it is a simpler form."""
        leads = ((s, self.leader.gain - s.gain) for s in self.ranked[1:] if s.is_reportable)
        close = [(s, lead) for s, lead in leads if lead < self.settings.margin]
        min_lead = THRESHOLDS.simpler_form_lead
        return [s for s, lead in close if not (self.leader.is_simpler_form_of(s) and lead > min_lead)]

    def names(self, answer: str) -> tuple[str, ...]:
        """Families that an answer names."""
        if answer == "a_or_b":
            return self.leader.family, (self.limit_forms or self.rivals)[0].family
        return (self.leader.family,) if answer == "named" else ()


def judge(scores: Sequence[Score], excess: float, settings: MismatchSettings, **facts: Any) -> Verdict:
    """Verdict on scored candidates, by the first of ``EFFECT_RULES`` that applies.

    Parameters
    ----------
    scores : sequence of Score
        Best of each family, any order.
    excess : float
        Weighted mean square of the base model over the control level.
    settings : MismatchSettings
    **facts
        Further fields of ``EffectEvidence``.

    Returns
    -------
    Verdict
    """
    evidence = EffectEvidence(scores, excess, settings, **facts)
    rule = first_applicable(EFFECT_RULES, evidence)
    probabilities = posterior(scores, excess, settings)
    if rule.answer == "unknown":
        swap_with_unknown(probabilities)
    names = evidence.names(rule.answer)
    certainty = settings.certainty(rule.answer, rule.cause == "clock")
    probability = calibrate(probabilities, names or (rule.answer,), certainty, settings)
    grade = ("A" if evidence.residual_excess <= 1.0 else "B") if rule.answer == "named" else ""
    return Verdict(
        rule.answer, names, grade, probability, probabilities, evidence.ranked, rule.reason_for(evidence), rule.cause,
        (rule.name,),
    )  # fmt: skip


@dataclass(frozen=True)
class NumericalError:
    """Weighted sums of squares of the simulation's own error and of the mismatch, of ``n`` independent samples.

    ``limit`` is the largest share of the mismatch at which a cause may be named.
    """

    own: float
    mismatch: float
    n: float
    limit: float

    @property
    def is_material(self) -> bool:
        """Whether the own error exceeds a third of the tolerated error."""
        return self.own / self.n > THRESHOLDS.max_numerical_error

    @property
    def exceeds_limit(self) -> bool:
        """Whether the own error is too large a share of the mismatch."""
        return self.own > self.limit**2 * self.mismatch

    @property
    def share(self) -> float:
        """Own error as a share of the mismatch."""
        return float(np.sqrt(self.own / self.mismatch))


@dataclass(frozen=True)
class NameEvidence:
    """What the grade of a name rests on: its ``score`` in the last fit, and the largest excess ratio of that fit."""

    score: Score
    excess: float


def grade_name(
    verdict: Verdict, fit: Fit, excess: float, settings: MismatchSettings
) -> tuple[Verdict, Rule[NameEvidence], str]:
    """A name with its grade by the last fit, by the first of ``NAME_RULES`` that applies.

    A name whose size has no upper limit becomes "a or b" with the form that looks the same there. Example: a gap that
    no train closes looks like a sleeper without ballast.

    Parameters
    ----------
    verdict : Verdict
        Its answer is "named".
    fit : Fit
        The last fit, of all effects.
    excess : float
        Largest excess ratio of that fit, of a data type or of one channel of one recording.
    settings : MismatchSettings

    Returns
    -------
    verdict : Verdict
        Of grade B if the rule rejects the name.
    rule : Rule
        Its answer is "A", "B", "a_or_b", or "unknown" if it rejects the name.
    reason : str
        Reason of the rule in words.
    """
    score = replace(verdict.scores[0], fit=fit)
    evidence = NameEvidence(score, excess)
    rule = first_applicable(NAME_RULES, evidence)
    reason = rule.reason_for(evidence)
    graded = replace(verdict, grade="A" if rule.answer == "A" else "B", scores=(score, *verdict.scores[1:]))
    if rule.answer == "a_or_b":
        graded = graded.as_choice(reason, settings)
    return graded.after(rule), rule, reason


@dataclass(frozen=True)
class ReservedEvidence:
    """The verdicts, and how well the last fit predicts the reserved recordings."""

    verdicts: tuple[Verdict, ...]
    verification: Verification

    @property
    def verdict(self) -> Verdict:
        """Verdict on the first effect."""
        return self.verdicts[0]

    @property
    def is_single_name_of_grade_b(self) -> bool:
        """Whether there is one effect alone, named with grade B."""
        return len(self.verdicts) == 1 and self.verdict.answer == "named" and self.verdict.grade == "B"


def confirm(
    verdicts: tuple[Verdict, ...], verification: Verification, settings: MismatchSettings
) -> tuple[Verdict, ...]:
    """The verdicts, the first of them "unknown" if reserved recordings contradict it, by ``RESERVED_RULES``."""
    evidence = ReservedEvidence(verdicts, verification)
    rule = first_applicable(RESERVED_RULES, evidence)
    first, *further = verdicts
    if rule.answer == "unknown":
        first = first.as_unknown(rule.reason_for(evidence), settings)
    return (first.after(rule), *further)
