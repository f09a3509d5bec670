"""Decision of a diagnosis: none, named, a or b, unknown or numerics, with its probability and reason."""

from dataclasses import dataclass, field, replace

import numpy as np

# Thresholds of gain. A weaker name that held-out recordings contradict is no evidence of any effect.
WEAK = 2.0
# nats, odds of 20 to 1: lead of the simpler form over one with an extra parameter that has no effect.
EVEN = 3.0
# Share of the gain. A held-out condition that loses more, and more than half a threshold, contradicts the name.
TORN = 0.2
VERDICTS = ("none", "named", "a_or_b", "unknown", "numerics")


@dataclass(frozen=True)
class Verdict:
    """Outcome for one effect.

    ``answer`` of ``ANSWERS``. ``names`` are the families (two for a or b). ``grade`` "A" or "B". ``probability`` of the
    answer. ``posterior`` over families, "none" and "unknown". ``scores`` best of each family. ``reason`` in words.
    ``cause`` is "clock" or "train" if the verdict rests on recordings that were not fitted, else "".
    """

    answer: str
    names: tuple[str, ...] = ()
    grade: str = ""
    probability: float = 0.0
    posterior: dict = field(default_factory=dict)
    scores: tuple = ()
    reason: str = ""
    cause: str = ""


def posterior(scores, excess, settings):
    r"""Probabilities by a softmax of score over temperature, over families, "none" and "unknown".

    Half of the prior is on "none", a tenth on "unknown", the rest is spread over the families. "none" scores 0.
    "unknown" scores an offset plus the largest possible gain of a perfect explanation, limited at the threshold. It
    rises with the share that the best candidate leaves unexplained. ``excess`` is the weighted mean square of the base
    model over the control level; 1 means none.

    >>> from turnout.config.settings.mismatch import MismatchSettings
    >>> p = posterior([], 1.0, MismatchSettings())
    >>> max(p, key=p.get)
    'none'
    """
    best = {}
    for score in scores:
        best[score.family] = max(best.get(score.family, -np.inf), score.gain)
    explained = max((s.explained for s in scores), default=0.0)
    unexplained = 1.0 - min(1.0, max(0.0, explained))
    unknown = settings.unknown_offset
    if excess > 1.0:
        unknown += 2.0 * settings.threshold * np.log(excess) * (0.2 + unexplained) / settings.explained
    top = max([0.0, unknown, *best.values()])
    logits = {"none": 0.0, "unknown": min(unknown, max([0.0, *best.values()]) + settings.threshold), **best}
    prior = {"none": 0.5, "unknown": 0.1, **dict.fromkeys(best, 0.4 / max(1, len(best)))}
    scaled = {n: prior[n] * np.exp(max(-700.0, (v - top) / settings.temperature)) for n, v in logits.items()}
    total = sum(scaled.values())
    return {name: float(v / total) for name, v in scaled.items()}


def withdraw(probabilities):
    """A test beyond the score rejects the best name: swap the probabilities of "unknown" and the likeliest name."""
    top = max(probabilities, key=probabilities.get)
    probabilities[top], probabilities["unknown"] = probabilities["unknown"], probabilities[top]


def calibrate(probabilities, chosen, certainty, settings):
    r"""Probability that the answer ``chosen`` is right, after which ``probabilities`` are scaled to sum to 1.

    .. math:: \mathrm{logit}\,p' = (1 - s)\,\mathrm{logit}\,c + s\,\mathrm{logit}\,p

    with c the share of such answers that were right in opened cases, and s the weight of the softmax p: Platt scaling
    (1999) with an offset per type of answer.

    >>> from turnout.config.settings.mismatch import MismatchSettings
    >>> round(calibrate({"a": 0.5, "none": 0.5}, ("a",), 0.5, MismatchSettings()), 6)
    0.5
    """
    raw = min(1.0 - 1e-3, max(1e-3, sum(probabilities.get(name, 0.0) for name in chosen)))
    odds = (1.0 - settings.softmax_share) * _logit(certainty) + settings.softmax_share * _logit(raw)
    sure = float(1.0 / (1.0 + np.exp(-odds)))
    rest = sum(v for name, v in probabilities.items() if name not in chosen)
    inside = sum(probabilities.get(name, 0.0) for name in chosen)
    for name in probabilities:
        among = name in chosen
        total = inside if among else rest
        if total > 0.0:
            probabilities[name] *= (sure if among else 1.0 - sure) / total
    return sure


def _logit(p):
    return float(np.log(p / (1.0 - p)))


def objected(worst, gain, settings):
    """Whether a held-out condition, with gain ``worst_gain``, contradicts a name that gains ``gain`` in all."""
    return worst < -max(0.5 * settings.threshold, TORN * gain)


def leading(scores, excess, settings):
    """The likeliest of ``scores``. If it explains too little, the likeliest that other data support, if any."""
    ranked = sorted(scores, key=lambda s: -s.gain)
    sure = [s for s in ranked if s.told_elsewhere(settings)]
    return sure[0] if sure and ranked[0].faint(excess, settings) else ranked[0]


def opened(verdict, settings):
    """A name whose size has no upper limit becomes "a or b" with its ``unbounded_form``. Others stay.

    Example: a gap that no train closes looks like a sleeper without ballast.
    """
    if verdict.answer != "named" or not verdict.scores[0].is_open:
        return verdict
    names, probabilities = (verdict.names[0], verdict.scores[0].candidate.open_as), dict(verdict.posterior)
    sure = calibrate(probabilities, names, settings.certainty("a_or_b"), settings)
    reason = "; ".join(filter(None, [f"the size of {names[0]} is known from below alone", verdict.reason]))
    return replace(
        verdict, answer="a_or_b", names=names, grade="", probability=sure, posterior=probabilities, reason=reason
    )


def judge(scores, excess, settings, consistent=True, structure=0.0, left=1.0, disturbed=False, foreign=()):
    """Verdict from scored candidates.

    Parameters
    ----------
    scores : list of Score
        Best of each family, any order.
    excess : float
        Weighted mean square of the base model over the control level.
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
    ranked = sorted(scores, key=lambda s: -s.gain)
    probabilities = posterior(scores, excess, settings)

    def verdict(answer, names=(), grade="", reason="", cause=""):
        if answer == "unknown":
            withdraw(probabilities)
        sure = calibrate(probabilities, names or (answer,), settings.certainty(answer, cause == "clock"), settings)
        return Verdict(answer, tuple(names), grade, sure, probabilities, tuple(ranked), reason, cause)

    def no_name(but=""):
        if excess > 1.0:
            return verdict("unknown", reason="above the level of controls, and no candidate helps")
        if disturbed:
            return verdict("unknown", reason="something shakes all sensors while no wheel is near", cause="clock")
        if foreign:
            said = f"most passages of {', '.join(foreign)} do not look like its vehicle file"
            return verdict("unknown", reason=said, cause="train")
        return verdict("none", reason=f"nothing above the thresholds{but}")

    found = [s for s in ranked if s.gain > settings.threshold and s.material]
    if not found:
        return no_name()
    best = leading(found, excess, settings)
    ranked = [best, *(s for s in ranked if s is not best)]
    faint = f"explains {best.explained:.0%} of the excess" if best.faint(excess, settings) else ""
    if faint and not best.told_elsewhere(settings):
        return verdict("unknown", reason=f"the best candidate {faint}")
    if left > settings.leftover:
        return verdict("unknown", reason=f"{best.family} leaves {left:.0f} times the level of controls")
    weak = best.gain < WEAK * settings.threshold
    torn = bool(best.alone) or objected(best.worst, best.gain, settings)
    if (torn or not consistent) and weak and excess <= 1.0:
        return no_name(f" but {best.family}, which does not hold elsewhere")
    if not consistent:
        return verdict("unknown", reason=f"{best.family} does not hold on conditions it was not fitted to")
    if structure > settings.structure_left and left > 1.0:
        return verdict("unknown", reason=f"a free law still explains {structure:.0%} of what {best.family} leaves")
    if best.alone:
        return verdict("unknown", reason=f"{best.family} hangs on {best.alone} alone, which others do not confirm")
    if torn:
        return verdict("unknown", reason=f"{best.family} makes one condition worse by {-best.worst:.0f} nats")
    same = [s for s in found if s.is_limit_of(best) and s.explained >= settings.explained]
    if same:  # ballast without stiffness equals a hanging sleeper
        return verdict("a_or_b", (best.family, same[0].family), reason=f"{best.family} is at its limit")
    rivals = [s for s in ranked if s is not best and s.material and best.gain - s.gain < settings.margin]
    rivals = [s for s in rivals if not (best.is_plain_form_of(s) and best.gain - s.gain > EVEN)]
    if rivals:
        return verdict("a_or_b", (best.family, rivals[0].family), reason="within the margin of each other")
    grade = "A" if left <= 1.0 else "B"
    return verdict("named", (best.family,), grade, faint and f"{best.told_elsewhere(settings)}; it {faint}")
