"""Decision of a diagnosis: none, named, a or b, unknown or numerics, as tables of rules.

Each step of the decision has one table, and the first of its rules that applies decides. ``NUMERICS_RULES``: whether
the simulation is accurate enough. ``EFFECT_RULES``: the answer on one effect. ``SECOND_RULES``: whether a second effect
stands beside the first. ``PAIR_RULES``: which of the two remain. ``NAME_RULES``: the grade of a name.
``TOLERATED_RULES``: whether an effect that the base model tolerates has a name.
``LIMIT_RULES``: what a search that is not finished says.
``UNPROVEN_RULES``: whether names are withheld, as this kind of diagnosis is not proven on concealed data.
``RESERVED_RULES``: whether reserved recordings confirm the answer. ``Verdict.trail`` names the rules that applied.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from turnout.mismatch.engine.decision_facts import (
    EffectEvidence,
    NameEvidence,
    NumericalError,
    ReservedEvidence,
    ToleratedEvidence,
    UnprovenEvidence,
)
from turnout.mismatch.engine.rule import Rule, first_applicable
from turnout.mismatch.engine.search_limit import SearchLimit
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.mismatch.engine.verdict import AMBIGUOUS, Verdict, calibrate, posterior, swap_with_unknown

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.fit import Fit
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.second_effect import SecondEvidence
    from turnout.mismatch.engine.two_effects import PairEvidence
    from turnout.mismatch.engine.verification import Verification

HOW, PAIRS, SURFACES = "mismatch.md", "decisions/two-effects.md", "decisions/running-surface-priors.md"
COMPONENT_DIFFERS, COMPONENT_UNUSUAL = "component_differs_under_trains", "component_unlike_its_kind"
LEAVES_FORCE = "leaves_force_at_its_position"
LOCATED, ENDS = "decisions/residual-localization.md", "decisions/joint-fit-convergence.md"
MISTAKES = "decisions/mistakes-in-campaigns.md"


def _always(_: Any) -> bool:
    return True


# fmt: off
NUMERICS_RULES: tuple[Rule[NumericalError], ...] = (
    Rule("own_error_is_material", lambda e: e.is_material and e.exceeds_limit, "numerics",
         "the numerical error of the simulation is {e.share:.0%} of the difference from the recordings: use a finer "
         "mesh and a shorter time step first", HOW),
    Rule("simulation_is_accurate", _always, "", "", HOW),
)  # the answer of one effect is sought if no error is material

EFFECT_RULES: tuple[Rule[EffectEvidence], ...] = (
    Rule("explains_too_little", lambda e: e.has_leader and e.explains_too_little and not e.exemption, "unknown",
         "the best candidate effect explains only {e.leader.explained:z.0%} of the residual in excess of the intact "
         "state", HOW),
    Rule("leaves_too_much", lambda e: e.has_leader and e.residual_excess > e.settings.leftover, "unknown",
         "with {e.leader.in_words}, the residual is still {e.residual_excess:.0f} times that of the intact state", HOW),
    Rule("excess_without_candidate", lambda e: e.shows_nothing and e.excess > 1.0, "unknown",
         "the residual is larger than in the intact state, and no effect of the catalogue explains it", HOW),
    Rule("sensors_shake_without_wheel", lambda e: e.shows_nothing and e.disturbed, "unknown",
         "all sensors vibrate while no wheel is near", LOCATED, cause="clock"),
    Rule("train_unlike_its_file", lambda e: e.shows_nothing and e.mismatched_trains, "unknown",
         "most passages of {e.train_names} do not agree with the vehicle file", LOCATED, cause="train"),
    Rule("no_train_matches", lambda e: e.shows_nothing and e.no_train_matches, "unknown",
         "no passage resembles the simulation of its train: a large fault of the track, or wrong vehicle files or "
         "positions of sensors", LOCATED, cause="all trains"),
    Rule("no_tolerance_explains_it", lambda e: e.shows_nothing and e.strained, "unknown",
         "the recordings are explained only if a value is far from that of the file: {e.strained}", LOCATED),
    Rule(COMPONENT_DIFFERS, lambda e: e.shows_nothing and e.local_change > e.settings.threshold, "unknown",
         "a component or a channel there differs between trains and impacts (evidence: {e.change_in_words})",
         LOCATED),
    Rule(COMPONENT_UNUSUAL, lambda e: e.shows_nothing and e.local_deviation > e.settings.threshold, "unknown",
         "a component there differs from others of its kind by more than they differ among themselves "
         "(evidence: {e.deviation_in_words})", LOCATED),
    Rule(AMBIGUOUS, lambda e: e.shows_nothing and e.is_ambiguous, "unknown", "{e.ambiguity.words}",
         "decisions/short-wave-corrugation.md"),
    Rule("no_candidate_passes", lambda e: not e.has_leader, "none", "no effect has the evidence that a name needs",
         HOW),
    Rule("weak_and_contradicted", lambda e: e.shows_nothing, "none",
         "only weak evidence for {e.leader.in_words}, which other recordings contradict or do not confirm", ENDS),
    Rule("reserved_not_predicted", lambda e: not e.consistent, "unknown",
         "with {e.leader.in_words}, recordings that took no part in its fit are predicted worse than the others", HOW),
    Rule("residual_has_structure", lambda e: e.structure > e.settings.structure_left and e.residual_excess > 1.0,
         "unknown",
         "beside {e.leader.in_words}, a force that depends freely on motion or load still explains {e.structure:.0%} "
         "of the residual", HOW),
    Rule(LEAVES_FORCE, lambda e: e.left_at_position > max(THRESHOLDS.max_left_force, e.leader.gain), "unknown",
         "with {e.leader.in_words}, the recordings still show a force there that it does not explain, with more "
         "evidence than its own ({e.left_in_words})", LOCATED),
    Rule("value_without_meaning", lambda e: not e.leader.has_meaning, "unknown",
         "{e.leader.in_words} would have a value that is physically impossible", HOW),
    Rule("single_source", lambda e: e.leader.single_source, "unknown",
         "{e.leader.in_words} shows in {e.leader.single_source} alone, and no other recording confirms it", ENDS),
    Rule("condition_contradicts", lambda e: e.contradicted, "unknown",
         "with {e.leader.in_words}, recordings of one condition are predicted worse than without it "
         "(evidence against it: {e.loss_in_words})", ENDS),
    Rule("size_at_limit", lambda e: e.limit_forms, "a_or_b",
         "the size of {e.leader.in_words} is at its limit, where both effects cause the same response", PAIRS),
    Rule("rival_within_margin", lambda e: e.rivals, "a_or_b",
         "the evidence for one effect is hardly larger than for the other", HOW),
    Rule("exempt_from_explaining", lambda e: e.explains_too_little, "named",
         "{e.exemption}; it explains {e.leader.explained:z.0%} of the residual in excess of the intact state", PAIRS),
    Rule("may_be_in_one_type_of_recordings", lambda e: e.special_forms, "named",
         "these recordings do not tell whether it is in hammer tests and passages, or in those of one type alone",
         MISTAKES),
    Rule("passes", _always, "named", "", HOW),
)

SECOND_RULES: tuple[Rule[SecondEvidence], ...] = (
    Rule("excess_of_one_recording", lambda e: e.first.answer == "named" and e.is_excess_of_one_recording, "first",
         "", PAIRS),
    Rule("unnamed_beside_name", lambda e: e.first.answer == "named" and e.second.answer == "unknown", "first",
         "a second effect without a name remains{e.location}{e.alternative}: {e.second.reason}", PAIRS),
    Rule("second_is_no_single_effect", lambda e: not e.second.is_single_effect, "first", "", PAIRS),
    Rule("second_may_be_shape_of_first", lambda e: e.gain < e.shape_error_evidence, "first", "", PAIRS),
    Rule("rivals_stay_a_choice", lambda e: e.is_choice and not e.split_first.is_single_effect, "first", "", PAIRS),
    Rule("second_has_no_derivatives", lambda e: not e.continued.jacobian, "split first", "", ENDS),
    Rule("second_stands", _always, "both", "", PAIRS),
)

PAIR_RULES: tuple[Rule[PairEvidence], ...] = (
    Rule("choice_not_decided", lambda e: e.is_choice and not e.both_stand, "choice", "", PAIRS),
    Rule("first_passes_beside_second", lambda e: e.first_is_unknown and e.first_passes_beside_second, "both again",
         "", PAIRS),
    Rule("second_passes_without_first", lambda e: e.first_is_unknown and e.second_passes_without_first,
         "second without first", "a second effect without a name remains: {e.first.reason}", PAIRS),
    Rule("first_stays_unknown", lambda e: e.first_is_unknown, "unknown first", "", PAIRS),
    Rule("no_pair", lambda e: not e.is_pair, "all", "", PAIRS),
    Rule("second_left_alone_explains_too_little", lambda e: e.first_is_redundant and e.second_explains_too_little,
         "unknown second", "the best candidate effect explains only {e.second_score.explained:z.0%} of the "
         "residual in excess of the intact state", PAIRS),
    Rule("first_adds_too_little", lambda e: e.first_is_redundant, "second", "", PAIRS),
    Rule("second_predicts_reserved_worse", lambda e: e.second_predicts_worse, "first",
         "a second effect is possible: {e.second_text}. With it, held-out recordings are predicted worse", PAIRS),
    Rule("second_does_not_improve_reserved", lambda e: e.second_improves_nothing, "first",
         "a second effect is possible: {e.second_text}. With it, held-out recordings are predicted no better", PAIRS),
    Rule("both_stand", _always, "all", "", PAIRS),
)

NAME_RULES: tuple[Rule[NameEvidence], ...] = (
    Rule("strained_value_remains", lambda e: e.strained, "unknown",
         "{e.score.in_words} leaves values that are far from their files: {e.strained}", LOCATED),
    Rule("local_change_remains", lambda e: e.local_change > e.threshold and not e.score.has_position, "unknown",
         "{e.score.in_words} does not explain why single components differ between trains and impacts", LOCATED),
    Rule("size_known_from_below", lambda e: e.score.is_unbounded, "a_or_b",
         "of the size of {e.score.in_words} only a lower limit can be determined", PAIRS),
    Rule("free_law_predicts_better", lambda e: e.free_share > THRESHOLDS.max_free_law_share, "unknown",
         "{e.score.in_words} misses {e.free_share:.0%} of what a force that depends freely on motion or load explains",
         HOW),
    Rule("reaches_control_level", lambda e: e.leaves_nothing, "A", "", HOW),
    Rule("must_reach_control_level", lambda e: e.score.candidate.naming.must_reach_control_level, "unknown",
         "{e.score.in_words} can imitate many other effects, and with it the residual is still larger than in the "
         "intact state", LOCATED),
    Rule("leaves_some_residual", _always, "B", "", HOW),
)

LIMIT_RULES: tuple[Rule[SearchLimit], ...] = (
    Rule("further_effect_not_sought_to_the_end", lambda e: e.has_verdict, "first",
         "whether there is a second effect was not decided{e.words}",
         "decisions/switch-panels.md"),
    Rule("search_too_long", _always, "unknown",
         "the search was not finished{e.words}", "decisions/switch-panels.md"),
)
UNPROVEN_RULES: tuple[Rule[UnprovenEvidence], ...] = (
    Rule("panel_not_proven", lambda e: e.reservation and e.has_name and not e.names_are_asked, "unknown",
         "{e.names} would explain it. {e.reservation}", "decisions/switch-panels.md"),
    Rule("panel_proven", _always, "", "", "decisions/switch-panels.md"),
)
RESERVED_RULES: tuple[Rule[ReservedEvidence], ...] = (
    Rule("reserved_worse_than_zero", lambda e: e.predicts_nothing, "unknown",
         "the simulation predicts held-out recordings worse than a signal of 0 would (fit {e.fit:.0f} %), also with "
         "the effects that explain the most: a position in the layout, the track file or a vehicle file is wrong, or a "
         "large fault is not known to this program", HOW, cause="all trains"),
    Rule("reserved_predicted_worse", lambda e: e.is_single_name_of_grade_b and e.verification.is_worse, "unknown",
         "with {e.words}, the residual is larger than in the intact state, and held-out recordings are predicted worse",
         ENDS),
    Rule("reserved_fit_falls", lambda e: e.is_single_name and e.falls_clearly, "unknown",
         "with {e.words}, held-out recordings are predicted clearly worse than without it "
         "(evidence against it: {e.loss_in_words})", HOW),
    Rule("reserved_fit_falls_for_little_evidence", lambda e: e.is_single_name and e.has_fallen, "B",
         "with {e.words}, held-out recordings are predicted slightly worse than without it: too little to reject the "
         "name, enough for grade B", HOW),
    Rule("reserved_not_explained",
         lambda e: e.verdict.answer == "none" and e.verification.reserved_excess > THRESHOLDS.max_reserved_excess,
         "unknown", "held-out recordings are predicted worse than in the intact state", HOW),
    Rule("not_contradicted", _always, "", "", HOW),
)
TOLERATED_RULES: tuple[Rule[ToleratedEvidence], ...] = (
    Rule("tolerance_explains_better", lambda e: e.score.gain <= -e.settings.margin, "", "", SURFACES),
    Rule("size_is_not_material", lambda e: not (e.score.is_reportable and e.score.has_meaning), "", "", SURFACES),
    Rule("beyond_tolerance", _always, "named",
         "it is reported for its size; the tolerance of a value of the base model could explain it, too", SURFACES),
)
# fmt: on

RULES = (
    *NUMERICS_RULES,
    *EFFECT_RULES,
    *SECOND_RULES,
    *PAIR_RULES,
    *NAME_RULES,
    *TOLERATED_RULES,
    *LIMIT_RULES,
    *UNPROVEN_RULES,
    *RESERVED_RULES,
)


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
    alike = tuple(s.family for s in evidence.special_forms) if rule.answer == "named" else ()
    probability = calibrate(probabilities, (*names, *alike) or (rule.answer,), certainty, settings)
    grade = ("A" if evidence.residual_excess <= 1.0 else "B") if rule.answer == "named" else ""
    return Verdict(
        rule.answer, names, grade, probability, probabilities, evidence.ranked, rule.reason_for(evidence), rule.cause,
        (rule.name,),
    )  # fmt: skip


def grade_name(
    verdict: Verdict,
    fit: Fit,
    excess: float,
    settings: MismatchSettings,
    free_share: float = 0.0,
    strained: str = "",
    local_change: float = 0.0,
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
    free_share : float
        Share of the gain on held-out recordings that the names miss, see ``free_law_share``.
    strained : str
        Value that no tolerance explains in that fit, in words; "" if there is none.
    local_change : float
        Evidence of ``local_changes`` in that fit. [nats]

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
    evidence = NameEvidence(score, excess, free_share, strained, local_change, settings.threshold)
    rule = first_applicable(NAME_RULES, evidence)
    reason = rule.reason_for(evidence)
    graded = replace(verdict, grade="A" if rule.answer == "A" else "B", scores=(score, *verdict.scores[1:]))
    if rule.answer == "a_or_b":
        graded = graded.as_choice(reason, settings)
    return graded.after(rule), rule, reason


def confirm(
    verdicts: tuple[Verdict, ...], verification: Verification, settings: MismatchSettings
) -> tuple[Verdict, ...]:
    """The verdicts after the test on reserved recordings, by the first of ``RESERVED_RULES`` that applies.

    Parameters
    ----------
    verdicts : tuple of Verdict
        With grades.
    verification : Verification
        Of the last fit.
    settings : MismatchSettings

    Returns
    -------
    tuple of Verdict
        The first is "unknown", and alone, if reserved recordings contradict it, and has grade B if their fit falls
        for little.
    """
    evidence = ReservedEvidence(verdicts, verification, settings)
    rule = first_applicable(RESERVED_RULES, evidence)
    first, *further = verdicts
    if rule.answer == "unknown":
        first, further = first.as_unknown(rule.reason_for(evidence), settings), []
        first = replace(first, cause=rule.cause or first.cause)
    elif rule.answer == "B":
        reasons = (first.reason, rule.reason_for(evidence))
        first = replace(first, grade="B", reason="; ".join(r for r in reasons if r))
    return (first.after(rule), *further)


def unfinished_verdict(limit: SearchLimit, settings: MismatchSettings) -> Verdict:
    """The verdict of a search that was not finished.

    Parameters
    ----------
    limit : SearchLimit
        What the search has cost.
    settings : MismatchSettings

    Returns
    -------
    Verdict
        "unknown", with the reason.
    """
    rule = first_applicable(LIMIT_RULES, limit)
    return Verdict(
        rule.answer, reason=rule.reason_for(limit), probability=settings.certainty(rule.answer), trail=(rule.name,)
    )


def keep_first(verdict: Verdict, limit: SearchLimit) -> Verdict:
    """The verdict on the first effect where the search for a second one was not finished.

    All its rivals were compared before that search began, so it stands, with a reason that says what is open.

    Parameters
    ----------
    verdict : Verdict
        On the first effect.
    limit : SearchLimit
        What the search has cost.

    Returns
    -------
    Verdict
    """
    open_limit = replace(limit, has_verdict=True)
    rule = first_applicable(LIMIT_RULES, open_limit)
    reason = "; ".join(filter(None, [verdict.reason, rule.reason_for(open_limit)]))
    return replace(verdict, reason=reason).after(rule)
