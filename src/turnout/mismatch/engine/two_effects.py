"""Two effects at once: a name that was rejected alone is tested again with a second effect in the model.

The residual of the first effect, or an error in it, may be the second. Alone each explains too little to be named.
"""

from dataclasses import replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.cross_validation import held_out_score
from turnout.mismatch.engine.decision import MAX_LOSS_SHARE, calibrate, judge, swap_with_unknown
from turnout.mismatch.engine.evidence import (
    assess,
    excess_ratio,
    explained_share,
    predicts_reserved,
    residual_structure,
    worst_excess,
)
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.refit import converge
from turnout.mismatch.engine.reserved_data import gain_error, reserved_fit

MAX_RIVALS = 2  # rivals that are refitted beside the second effect
MIN_KEPT_GAIN_SHARE = 0.5  # share of a rival's gain; one that keeps more on top of the leader explains something else
MAX_FIT_LOSS = 3.0  # points of fit on reserved recordings; a larger loss counts


def is_unknown(verdicts):
    """Whether the first verdict is "unknown"."""
    return bool(verdicts) and verdicts[0].answer == "unknown"


def with_residual_reason(first, second):
    """The ``first`` verdict, a name, with the reason of a ``second`` one that got no name.

    The name stays, but the reader must know that a residual remains.
    """
    if first.answer != "named" or second.answer != "unknown":
        return first
    return replace(first, reason=f"something else shows beside it: {second.reason}")


def is_single_effect(verdict):
    """Whether a verdict states one effect: by a name, or by two forms of it that cannot be distinguished."""
    return verdict.answer == "named" or (verdict.answer == "a_or_b" and _independent_rival(verdict) is None)


def is_accepted_pair(verdicts):
    """Whether there are two verdicts, each of which states one effect."""
    return len(verdicts) == 2 and all(is_single_effect(v) for v in verdicts)


def _independent_rival(verdict):
    """Score of the second of two rivals that may both be present. None if one is a form of the other."""
    rival = next((s for s in verdict.scores[1:] if s.family == verdict.names[1]), None)
    return rival if rival is not None and _are_independent(verdict.scores[0], rival) else None


def split_rivals(case, base, verdict, second, settings):
    """The verdict on the first of two rivals if the ``second`` effect, found on top of it, is the other one.

    Their gains alone are similar by chance, and they explain different things. Other scores that keep their gain on top
    of the first are left out as well. ``verdict`` itself if the second effect is another one.
    """
    rival = _independent_rival(verdict)
    if rival is None or second.names[:1] != (rival.family,):
        return verdict
    on_top = {s.candidate.key: s.gain for s in second.scores}
    rivals = [
        s for s in verdict.scores if s is not rival and on_top.get(s.candidate.key, 0.0) < MIN_KEPT_GAIN_SHARE * s.gain
    ]
    retested, _ = assess(case, base, tuple(rivals), settings)
    return retested if retested.answer == "named" else verdict


def retest_with_second(case, base, fit, verdicts, settings):
    """(verdicts, fit) after a second effect was sought on top of a rejected first one.

    Both stand if the second is named, and the first or a close rival passes with the second in the model.
    """
    second_only = _fit_second_only(case, fit, settings) if len(verdicts) > 1 else None
    if second_only is not None and _are_independent(verdicts[0].scores[0], verdicts[1].scores[0]):
        pairs = list(_scores_beside_second(case, base, fit, second_only, verdicts[0].scores, settings))
        pairs.sort(key=lambda s: (not s.is_reportable, -s.gain))
        pair_fit = pairs[0].fit
        consistent = predicts_reserved(case, base, pairs[0], settings)
        excess, residual_excess = worst_excess(case, base, settings), excess_ratio(case, pair_fit, settings)
        verdict = judge(
            pairs,
            excess,
            settings,
            consistent,
            residual_structure(case, pair_fit),
            residual_excess,
            bool(case.disturbed_recordings),
        )
        if verdict.answer in ("named", "a_or_b"):
            return [verdict, *verdicts[1:]], verdict.scores[0].fit
    return verdicts[:1], base


def drop_redundant_first(case, base, fit, verdicts, settings):
    """(verdicts, fit) without a first name that deserves no name beside the second: it had absorbed the second effect.

    Both stay if each deserves one.
    """
    if not is_accepted_pair(verdicts):
        return verdicts, fit
    second_only = _fit_second_only(case, fit, settings)
    second_only = converge(case, second_only, settings) if second_only is not None else None
    first, second = (v.scores[0] for v in verdicts)
    if second_only is None or _evidence_gain(fit, second_only, first.candidate) > settings.threshold:
        return verdicts, fit
    explained = explained_share(case, base, second_only, settings)
    single = replace(
        second,
        fit=second_only,
        gain=_evidence_gain(second_only, base, second.candidate),
        explained=explained,
        unmasked_gain=0.0,
    )
    single_verdict = replace(verdicts[1], scores=(single, *verdicts[1].scores[1:]))
    if single.explains_too_little(worst_excess(case, base, settings), settings) and not single.exemption_reason(
        settings
    ):
        return [
            _as_unknown(single_verdict, f"the best candidate explains {explained:.0%} of the excess", settings)
        ], base
    return [single_verdict], second_only


def drop_unpredictive_second(case, fit, verdicts, settings):
    """(verdicts, fit) without a second name with which reserved recordings are predicted worse than by the first alone.

    Worse means by more than ``MAX_FIT_LOSS`` points and the standard error of the difference.
    """
    if not is_accepted_pair(verdicts) or not case.reserved:
        return verdicts, fit
    first, second = verdicts
    first_only = first.scores[0].fit
    if not _predicts_worse(case, first_only, fit):
        return verdicts, fit
    first_only = converge(case, first_only, settings)
    if not _predicts_worse(case, first_only, fit):
        return verdicts, fit
    reason = f"something else shows beside it: {second.names[0]}, which foretells recordings never used worse"
    return [replace(first, reason=reason)], first_only


def _predicts_worse(case, first_only, pair_fit):
    """Whether ``pair_fit`` predicts the reserved recordings worse than ``first_only``."""
    (before, percent_before), (after, percent_after) = (reserved_fit(case, fit) for fit in (first_only, pair_fit))
    is_predicted = before is not None and after is not None
    return is_predicted and percent_before - percent_after > max(MAX_FIT_LOSS, gain_error(case.reserved, before, after))


def _evidence_gain(fit, without, candidate):
    """Evidence for a candidate by the fits with and without it. [nats]"""
    return fit.evidence - without.evidence + candidate.external_evidence - np.log(candidate.n_scanned)


def _are_independent(first, second):
    """Whether two effects confirm one another.

    Two of one family, or of one component, do not: together they can correct nearly any shape. Those of two trains do:
    no recording shows both.
    """
    trains = {s.candidate.where.get("train") for s in (first, second)}
    is_related = first.family == second.family or (
        first.candidate.component and first.candidate.part == second.candidate.part
    )
    return not is_related or (len(trains) == 2 and None not in trains)


def _fit_second_only(case, fit, settings):
    """The fit with the second effect alone, None if it cannot be simulated. The first is worth what the pair gains over
    it.
    """
    second = fit.candidates[1]
    try:
        return fit_jointly(case, (second,), fit.psi[fit.part(second)], fit.values, iterations=settings.iterations)
    except SimulationError:
        return None


def _scores_beside_second(case, base, fit, second_only, scores, settings):
    """The first effect's leader and its close rivals, each with its gain beside the second effect."""
    leader, second = scores[0], fit.candidates[1]
    yield _score_beside_second(case, base, fit, second_only, leader, settings)
    close = leader.gain - max(settings.margin, MAX_LOSS_SHARE * leader.gain)
    for rival in [s for s in scores[1:] if s.gain > max(close, settings.threshold)][:MAX_RIVALS]:
        psi = np.concatenate([rival.fit.psi, fit.psi[fit.part(second)]])
        try:
            pair_fit = fit_jointly(case, (rival.candidate, second), psi, fit.values, iterations=settings.iterations)
        except SimulationError:
            continue
        yield _score_beside_second(case, base, pair_fit, second_only, rival, settings)


def _score_beside_second(case, base, pair_fit, second_only, score, settings):
    """Score of a first effect by the gain of ``pair_fit`` over ``second_only``. Its explained share is that of the
    pair.
    """
    with_first, without_first = held_out_score(case, pair_fit), held_out_score(case, second_only)
    by_condition = {c: with_first[c] - without_first[c] for c in without_first}
    gain = _evidence_gain(pair_fit, second_only, score.candidate)
    explained, worst = explained_share(case, base, pair_fit, settings), min(by_condition.values(), default=0.0)
    return replace(score, gain=gain, fit=pair_fit, explained=explained, worst_gain=worst, by_condition=by_condition)


def reject_unconfirmed(verdict, settings):
    """A name of grade B that predicts reserved recordings worse than no effect: unknown. Others stay."""
    if verdict.answer != "named" or verdict.grade != "B":
        return verdict
    reason = f"{verdict.names[0]} leaves more than sound turnouts do and foretells recordings never used worse"
    return _as_unknown(verdict, reason, settings)


def reject_if_residual_left(base, fit, verdicts, settings):
    """(verdicts, fit), or "unknown" if a name must reach the control level (``Candidate.must_reach_control_level``) and
    the last fit, of grade B, does not.
    """
    named = [v for v in verdicts if v.answer == "named" and v.grade == "B"]
    failing = next((v.names[0] for v in named if v.scores[0].candidate.must_reach_control_level), None)
    if failing is None:
        return verdicts, fit
    reason = f"{failing} would leave nothing, and more is left than in sound turnouts"
    return [_as_unknown(verdicts[0], reason, settings)], base


def reject_if_reserved_unexplained(verdict, settings):
    """Answer "none" while reserved recordings are not predicted as on intact track: unknown. Others stay."""
    if verdict.answer != "none":
        return verdict
    return _as_unknown(verdict, "recordings that were never used are not foretold as in sound turnouts", settings)


def _as_unknown(verdict, reason, settings):
    probabilities = dict(verdict.posterior)
    swap_with_unknown(probabilities)
    probability = calibrate(probabilities, ("unknown",), settings.certainty("unknown"), settings)
    changes = {"answer": "unknown", "names": (), "grade": "", "probability": probability, "posterior": probabilities}
    return replace(verdict, **changes, reason=reason)
