"""Two effects at once: a name that was rejected alone is tested again with a second effect in the model.

The residual of the first effect, or an error in it, may be the second. Alone each explains too little to be named.
"""

from dataclasses import replace

import numpy as np

from turnout.errors import SimulationError
from turnout.mismatch.engine.cross_validation import held_out_score
from turnout.mismatch.engine.decision import TORN, calibrate, judge, withdraw
from turnout.mismatch.engine.evidence import consistent_elsewhere, explained_of, heard, judged, over, structure_left
from turnout.mismatch.engine.map_fit import fit_jointly
from turnout.mismatch.engine.refit import ended
from turnout.mismatch.engine.reserved_data import fit_of_reserved, gain_error

RIVALS = 2  # rivals that are refitted beside the second effect
KEPT = 0.5  # share of a rival's gain; one that keeps more on top of the leader explains something else
COSTLY = 3.0  # points of fit on reserved recordings; a larger loss counts


def refused(verdicts):
    """Whether the first verdict is "unknown"."""
    return bool(verdicts) and verdicts[0].answer == "unknown"


def told_beside(first, second):
    """The ``first`` verdict, a name, with the reason of a ``second`` one that got no name.

    The name stays, but the reader must know that a residual remains.
    """
    if first.answer != "named" or second.answer != "unknown":
        return first
    return replace(first, reason=f"something else shows beside it: {second.reason}")


def of_one_part(verdict):
    """Whether a verdict states one effect: by a name, or by two forms of it that cannot be distinguished."""
    return verdict.answer == "named" or (verdict.answer == "a_or_b" and _other_of(verdict) is None)


def both_stand(verdicts):
    """Whether there are two verdicts, each of which states one effect."""
    return len(verdicts) == 2 and all(of_one_part(v) for v in verdicts)


def _other_of(torn):
    """Score of the second of two rivals that may both be present. None if one is a form of the other."""
    other = next((s for s in torn.scores[1:] if s.family == torn.names[1]), None)
    return other if other is not None and _vouches(torn.scores[0], other) else None


def parted(case, base, torn, second, settings):
    """The verdict on the first of two rivals if the ``second`` effect, found on top of it, is the other one.

    Their gains alone are similar by chance, and they explain different things. Other scores that keep their gain on top
    of the first are left out as well. ``verdict`` itself if the second effect is another one.
    """
    other = _other_of(torn)
    if other is None or second.names[:1] != (other.family,):
        return torn
    on_top = {s.candidate.key: s.gain for s in second.scores}
    rivals = [s for s in torn.scores if s is not other and on_top.get(s.candidate.key, 0.0) < KEPT * s.gain]
    mine, _ = judged(case, base, tuple(rivals), settings)
    return mine if mine.answer == "named" else torn


def reconsidered(case, base, fit, verdicts, settings):
    """(verdicts, fit) after a second effect was sought on top of a rejected first one.

    Both stand if the second is named, and the first or a close rival passes with the second in the model.
    """
    alone = _second_alone(case, fit, settings) if len(verdicts) > 1 else None
    if alone is not None and _vouches(verdicts[0].scores[0], verdicts[1].scores[0]):
        pairs = list(_beside_second(case, base, fit, alone, verdicts[0].scores, settings))
        pairs.sort(key=lambda s: (not s.material, -s.gain))
        best = pairs[0].fit
        consistent = consistent_elsewhere(case, base, pairs[0], settings)
        excess, left = heard(case, base, settings), over(case, best, settings)
        found = judge(pairs, excess, settings, consistent, structure_left(case, best), left, bool(case.disturbed))
        if found.answer in ("named", "a_or_b"):
            return [found, *verdicts[1:]], found.scores[0].fit
    return verdicts[:1], base


def needed(case, base, fit, verdicts, settings):
    """(verdicts, fit) without a first name that deserves no name beside the second: it had absorbed the second effect.

    Both stay if each deserves one.
    """
    if not both_stand(verdicts):
        return verdicts, fit
    alone = _second_alone(case, fit, settings)
    alone = ended(case, alone, settings) if alone is not None else None
    first, second = (v.scores[0] for v in verdicts)
    if alone is None or _gained(fit, alone, first.candidate) > settings.threshold:
        return verdicts, fit
    explained = explained_of(case, base, alone, settings)
    own = replace(second, fit=alone, gain=_gained(alone, base, second.candidate), explained=explained, apart=0.0)
    said = replace(verdicts[1], scores=(own, *verdicts[1].scores[1:]))
    if own.faint(heard(case, base, settings), settings) and not own.told_elsewhere(settings):
        return [_unknown(said, f"the best candidate explains {explained:.0%} of the excess", settings)], base
    return [said], alone


def borne_out(case, fit, verdicts, settings):
    """(verdicts, fit) without a second name with which reserved recordings are predicted worse than by the first alone.

    Worse means by more than ``MAX_FIT_LOSS`` points and the standard error of the difference.
    """
    if not both_stand(verdicts) or not case.reserved:
        return verdicts, fit
    first, second = verdicts
    alone = first.scores[0].fit
    if not _costs(case, alone, fit):
        return verdicts, fit
    alone = ended(case, alone, settings)
    if not _costs(case, alone, fit):
        return verdicts, fit
    reason = f"something else shows beside it: {second.names[0]}, which foretells recordings never used worse"
    return [replace(first, reason=reason)], alone


def _costs(case, alone, both):
    """Whether ``pair_fit`` predicts the reserved recordings worse than ``first_only``."""
    (before, one), (after, two) = (fit_of_reserved(case, fit) for fit in (alone, both))
    known = before is not None and after is not None
    return known and one - two > max(COSTLY, gain_error(case.reserved, before, after))


def _gained(fit, without, candidate):
    """Evidence for a candidate by the fits with and without it. [nats]"""
    return fit.evidence - without.evidence + candidate.aside - np.log(candidate.scanned)


def _vouches(first, second):
    """Whether two effects confirm one another.

    Two of one family, or of one component, do not: together they can correct nearly any shape. Those of two trains do:
    no recording shows both.
    """
    trains = {s.candidate.where.get("train") for s in (first, second)}
    alike = first.family == second.family or (first.candidate.kin and first.candidate.part == second.candidate.part)
    return not alike or (len(trains) == 2 and None not in trains)


def _second_alone(case, fit, settings):
    """The fit with the second effect alone, None if it cannot be simulated. The first is worth what the pair gains over
    it.
    """
    second = fit.candidates[1]
    try:
        return fit_jointly(case, (second,), fit.psi[fit.part(second)], fit.values, iterations=settings.iterations)
    except SimulationError:
        return None


def _beside_second(case, base, fit, alone, scores, settings):
    """The first effect's leader and its close rivals, each with its gain beside the second effect."""
    leader, second = scores[0], fit.candidates[1]
    yield _worth(case, base, fit, alone, leader, settings)
    close = leader.gain - max(settings.margin, TORN * leader.gain)
    for rival in [s for s in scores[1:] if s.gain > max(close, settings.threshold)][:RIVALS]:
        psi = np.concatenate([rival.fit.psi, fit.psi[fit.part(second)]])
        try:
            both = fit_jointly(case, (rival.candidate, second), psi, fit.values, iterations=settings.iterations)
        except SimulationError:
            continue
        yield _worth(case, base, both, alone, rival, settings)


def _worth(case, base, both, alone, score, settings):
    """Score of a first effect by the gain of ``pair_fit`` over ``second_only``. Its explained share is that of the
    pair.
    """
    mine, reference = held_out_score(case, both), held_out_score(case, alone)
    by_condition = {c: mine[c] - reference[c] for c in reference}
    gain = _gained(both, alone, score.candidate)
    explained, worst = explained_of(case, base, both, settings), min(by_condition.values(), default=0.0)
    return replace(score, gain=gain, fit=both, explained=explained, worst=worst, by_condition=by_condition)


def unconfirmed(verdict, settings):
    """A name of grade B that predicts reserved recordings worse than no effect: unknown. Others stay."""
    if verdict.answer != "named" or verdict.grade != "B":
        return verdict
    reason = f"{verdict.names[0]} leaves more than sound turnouts do and foretells recordings never used worse"
    return _unknown(verdict, reason, settings)


def finished(base, fit, verdicts, settings):
    """(verdicts, fit), or "unknown" if a name must reach the control level (``Candidate.must_reach_control_level``) and
    the last fit, of grade B, does not.
    """
    named = [v for v in verdicts if v.answer == "named" and v.grade == "B"]
    bent = next((v.names[0] for v in named if v.scores[0].candidate.leaves_nothing), None)
    if bent is None:
        return verdicts, fit
    reason = f"{bent} would leave nothing, and more is left than in sound turnouts"
    return [_unknown(verdicts[0], reason, settings)], base


def unforetold(verdict, settings):
    """Answer "none" while reserved recordings are not predicted as on intact track: unknown. Others stay."""
    if verdict.answer != "none":
        return verdict
    return _unknown(verdict, "recordings that were never used are not foretold as in sound turnouts", settings)


def _unknown(verdict, reason, settings):
    probabilities = dict(verdict.posterior)
    withdraw(probabilities)
    sure = calibrate(probabilities, ("unknown",), settings.certainty("unknown"), settings)
    said = {"answer": "unknown", "names": (), "grade": "", "probability": sure, "posterior": probabilities}
    return replace(verdict, **said, reason=reason)
