"""Decision of a diagnosis: none, named, a or b, unknown or numerics, with its probability and reason."""

from dataclasses import dataclass, field, replace

import numpy as np

# Thresholds of gain. A weaker name that held-out recordings contradict is no evidence of any effect.
WEAK_GAIN = 2.0
# nats, odds of 20 to 1: lead of the simpler form over one with an extra parameter that has no effect.
SIMPLER_FORM_LEAD = 3.0
# Share of the gain. A held-out condition that loses more, and more than half a threshold, contradicts the name.
MAX_LOSS_SHARE = 0.2
ANSWERS = ("none", "named", "a_or_b", "unknown", "numerics")


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
    best_gains = {}
    for score in scores:
        best_gains[score.family] = max(best_gains.get(score.family, -np.inf), score.gain)
    explained = max((s.explained for s in scores), default=0.0)
    unexplained = 1.0 - min(1.0, max(0.0, explained))
    unknown = settings.unknown_offset
    if excess > 1.0:
        unknown += 2.0 * settings.threshold * np.log(excess) * (0.2 + unexplained) / settings.explained
    top = max([0.0, unknown, *best_gains.values()])
    logits = {"none": 0.0, "unknown": min(unknown, max([0.0, *best_gains.values()]) + settings.threshold), **best_gains}
    prior = {"none": 0.5, "unknown": 0.1, **dict.fromkeys(best_gains, 0.4 / max(1, len(best_gains)))}
    scaled = {n: prior[n] * np.exp(max(-700.0, (v - top) / settings.temperature)) for n, v in logits.items()}
    total = sum(scaled.values())
    return {name: float(v / total) for name, v in scaled.items()}


def swap_with_unknown(probabilities):
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
    probability = float(1.0 / (1.0 + np.exp(-odds)))
    outside = sum(v for name, v in probabilities.items() if name not in chosen)
    inside = sum(probabilities.get(name, 0.0) for name in chosen)
    for name in probabilities:
        is_chosen = name in chosen
        total = inside if is_chosen else outside
        if total > 0.0:
            probabilities[name] *= (probability if is_chosen else 1.0 - probability) / total
    return probability


def _logit(p):
    return float(np.log(p / (1.0 - p)))


def is_contradicted(worst_gain, gain, settings):
    """Whether a held-out condition, with gain ``worst_gain``, contradicts a name that gains ``gain`` in all."""
    return worst_gain < -max(0.5 * settings.threshold, MAX_LOSS_SHARE * gain)


def likeliest(scores, excess, settings):
    """The likeliest of ``scores``. If it explains too little, the likeliest that other data support, if any."""
    ranked = sorted(scores, key=lambda s: -s.gain)
    supported = [s for s in ranked if s.exemption_reason(settings)]
    return supported[0] if supported and ranked[0].explains_too_little(excess, settings) else ranked[0]


def with_open_size(verdict, settings):
    """A name whose size has no upper limit becomes "a or b" with its ``unbounded_form``. Others stay.

    Example: a gap that no train closes looks like a sleeper without ballast.
    """
    if verdict.answer != "named" or not verdict.scores[0].is_unbounded:
        return verdict
    names, probabilities = (verdict.names[0], verdict.scores[0].candidate.unbounded_form), dict(verdict.posterior)
    probability = calibrate(probabilities, names, settings.certainty("a_or_b"), settings)
    reason = "; ".join(filter(None, [f"the size of {names[0]} is known from below alone", verdict.reason]))
    return replace(
        verdict, answer="a_or_b", names=names, grade="", probability=probability, posterior=probabilities, reason=reason
    )


def judge(
    scores, excess, settings, consistent=True, structure=0.0, residual_excess=1.0, disturbed=False, mismatched_trains=()
):
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
            swap_with_unknown(probabilities)
        probability = calibrate(
            probabilities, names or (answer,), settings.certainty(answer, cause == "clock"), settings
        )
        return Verdict(answer, tuple(names), grade, probability, probabilities, tuple(ranked), reason, cause)

    def no_name(addition=""):
        if excess > 1.0:
            return verdict("unknown", reason="above the level of controls, and no candidate helps")
        if disturbed:
            return verdict("unknown", reason="something shakes all sensors while no wheel is near", cause="clock")
        if mismatched_trains:
            text = f"most passages of {', '.join(mismatched_trains)} do not look like its vehicle file"
            return verdict("unknown", reason=text, cause="train")
        return verdict("none", reason=f"nothing above the thresholds{addition}")

    passing = [s for s in ranked if s.gain > settings.threshold and s.is_reportable]
    if not passing:
        return no_name()
    leader = likeliest(passing, excess, settings)
    ranked = [leader, *(s for s in ranked if s is not leader)]
    weak_explanation = (
        f"explains {leader.explained:.0%} of the excess" if leader.explains_too_little(excess, settings) else ""
    )
    if weak_explanation and not leader.exemption_reason(settings):
        return verdict("unknown", reason=f"the best candidate {weak_explanation}")
    if residual_excess > settings.leftover:
        return verdict("unknown", reason=f"{leader.family} leaves {residual_excess:.0f} times the level of controls")
    is_weak = leader.gain < WEAK_GAIN * settings.threshold
    contradicted = bool(leader.single_witness) or is_contradicted(leader.worst_gain, leader.gain, settings)
    if (contradicted or not consistent) and is_weak and excess <= 1.0:
        return no_name(f" but {leader.family}, which does not hold elsewhere")
    if not consistent:
        return verdict("unknown", reason=f"{leader.family} does not hold on conditions it was not fitted to")
    if structure > settings.structure_left and residual_excess > 1.0:
        return verdict("unknown", reason=f"a free law still explains {structure:.0%} of what {leader.family} leaves")
    if leader.single_witness:
        return verdict(
            "unknown", reason=f"{leader.family} hangs on {leader.single_witness} alone, which others do not confirm"
        )
    if contradicted:
        return verdict("unknown", reason=f"{leader.family} makes one condition worse by {-leader.worst_gain:.0f} nats")
    limit_forms = [s for s in passing if s.is_limit_of(leader) and s.explained >= settings.explained]
    if limit_forms:  # ballast without stiffness equals a hanging sleeper
        return verdict("a_or_b", (leader.family, limit_forms[0].family), reason=f"{leader.family} is at its limit")
    rivals = [s for s in ranked if s is not leader and s.is_reportable and leader.gain - s.gain < settings.margin]
    rivals = [s for s in rivals if not (leader.is_simpler_form_of(s) and leader.gain - s.gain > SIMPLER_FORM_LEAD)]
    if rivals:
        return verdict("a_or_b", (leader.family, rivals[0].family), reason="within the margin of each other")
    grade = "A" if residual_excess <= 1.0 else "B"
    return verdict(
        "named",
        (leader.family,),
        grade,
        weak_explanation and f"{leader.exemption_reason(settings)}; it {weak_explanation}",
    )
