"""Verdict of a diagnosis on one effect, and the probability of its answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.rule import Rule
    from turnout.mismatch.engine.score import Score

AMBIGUOUS = "recordings_cannot_decide"  # rule
ANSWERS = ("none", "named", "a_or_b", "unknown", "numerics")


@dataclass(frozen=True)
class Verdict:
    """Outcome for one effect.

    ``answer`` of ``ANSWERS``. ``names`` are the families (two for a or b). ``grade`` "A" or "B". ``probability`` of the
    answer. ``posterior`` over families, "none" and "unknown". ``scores`` best of each family. ``reason`` in words.
    ``cause`` is "clock", "train" or "all trains" if the verdict rests on recordings that were not fitted, else "".
    ``trail`` are the names of the rules that applied, in order.
    """

    answer: str
    names: tuple[str, ...] = ()
    grade: str = ""
    probability: float = 0.0
    posterior: dict[str, float] = field(default_factory=dict)
    scores: tuple[Score, ...] = ()
    reason: str = ""
    cause: str = ""
    trail: tuple[str, ...] = ()

    @property
    def independent_rival(self) -> Score | None:
        """Score of the second of two rivals that may both be present. None if one is a form of the other."""
        if self.answer != "a_or_b":
            return None
        rival = next((s for s in self.scores[1:] if s.family == self.names[1]), None)
        return rival if rival is not None and self.scores[0].is_independent_of(rival) else None

    @property
    def names_in_words(self) -> tuple[str, ...]:
        """The names as text, with their sites where a score has them."""
        words = {s.family: s.in_words for s in reversed(self.scores)}
        return tuple(words.get(name, name.replace("_", " ")) for name in self.names)

    @property
    def is_single_effect(self) -> bool:
        """Whether it states one effect: by a name, or by two forms of it that cannot be distinguished."""
        return self.answer == "named" or (self.answer == "a_or_b" and self.independent_rival is None)

    @property
    def is_finished(self) -> bool:
        """Whether the search for the first effect came to its end, so that "unknown" says that something is missing."""
        return "search_too_long" not in self.trail

    @property
    def is_ambiguous(self) -> bool:
        """Whether it states something that the recordings show and cannot tell what it is."""
        return self.answer == "unknown" and AMBIGUOUS in self.trail

    def after(self, rule: Rule) -> Verdict:
        """The verdict with a rule at the end of its trail.

        Parameters
        ----------
        rule : Rule

        Returns
        -------
        Verdict
        """
        return replace(self, trail=(*self.trail, rule.name))

    def as_unknown(self, reason: str, settings: MismatchSettings) -> Verdict:
        """The answer "unknown" in place of this one.

        Parameters
        ----------
        reason : str
            In words.
        settings : MismatchSettings

        Returns
        -------
        Verdict
        """
        probabilities = dict(self.posterior)
        swap_with_unknown(probabilities)
        probability = calibrate(probabilities, ("unknown",), settings.certainty("unknown"), settings)
        changes: dict[str, Any] = {"answer": "unknown", "names": (), "grade": "", "probability": probability}
        return replace(self, **changes, posterior=probabilities, reason=reason)

    def as_choice(self, reason: str, settings: MismatchSettings) -> Verdict:
        """The answer "a or b" in place of a name: it, or the form that looks the same beyond the limit of its size.

        Parameters
        ----------
        reason : str
            In words.
        settings : MismatchSettings

        Returns
        -------
        Verdict
        """
        names, probabilities = (self.names[0], self.scores[0].candidate.effect.unbounded_form), dict(self.posterior)
        probability = calibrate(probabilities, names, settings.certainty("a_or_b"), settings)
        reason = "; ".join(filter(None, [reason, self.reason]))
        changes: dict[str, Any] = {"answer": "a_or_b", "names": names, "grade": "", "probability": probability}
        return replace(self, **changes, posterior=probabilities, reason=reason)


def posterior(scores: Sequence[Score], excess: float, settings: MismatchSettings) -> dict[str, float]:
    r"""Probabilities by a softmax of score over temperature, over families, "none" and "unknown".

    Half of the prior is on "none", a tenth on "unknown", the rest is spread over the families. "none" scores 0.
    "unknown" scores an offset plus the largest possible gain of a perfect explanation, limited at the threshold. It
    rises with the share that the best candidate leaves unexplained.

    Parameters
    ----------
    scores : sequence of Score
        Candidates after their refits.
    excess : float
        Weighted mean square of the base model over the control level; 1 means none.
    settings : MismatchSettings

    Returns
    -------
    dict
        Family, "none" or "unknown" -> probability.

    Examples
    --------
    >>> from turnout.config.settings.mismatch import MismatchSettings
    >>> p = posterior([], 1.0, MismatchSettings())
    >>> max(p, key=p.get)
    'none'
    """
    best_gains: dict[str, float] = {}
    for score in scores:
        best_gains[score.family] = max(best_gains.get(score.family, -np.inf), score.gain)
    explained = max((s.explained for s in scores), default=0.0)
    unexplained = 1.0 - min(1.0, max(0.0, explained))
    unknown = settings.unknown_offset
    if excess > 1.0:
        share = THRESHOLDS.unknown_share + unexplained
        unknown += THRESHOLDS.unknown_slope * settings.threshold * np.log(excess) * share / settings.explained
    top = max([0.0, unknown, *best_gains.values()])
    logits = {"none": 0.0, "unknown": min(unknown, max([0.0, *best_gains.values()]) + settings.threshold), **best_gains}
    prior = {"none": THRESHOLDS.prior_none, "unknown": THRESHOLDS.prior_unknown}
    prior |= dict.fromkeys(best_gains, THRESHOLDS.prior_families / max(1, len(best_gains)))
    exponents = {n: max(-THRESHOLDS.max_exponent, (v - top) / settings.temperature) for n, v in logits.items()}
    scaled = {n: prior[n] * np.exp(v) for n, v in exponents.items()}
    total = sum(scaled.values())
    return {name: float(v / total) for name, v in scaled.items()}


def swap_with_unknown(probabilities: dict[str, float]) -> None:
    """Swap the probabilities of "unknown" and of the likeliest name: a test beyond the score rejects that.

    Parameters
    ----------
    probabilities : dict
        Name -> probability. Changed in place.
    """
    top = max(probabilities, key=lambda name: probabilities[name])
    probabilities[top], probabilities["unknown"] = probabilities["unknown"], probabilities[top]


def calibrate(
    probabilities: dict[str, float], chosen: Sequence[str], certainty: float, settings: MismatchSettings
) -> float:
    r"""Probability that the answer ``chosen`` is right, after which ``probabilities`` are scaled to sum to 1.

    .. math:: \mathrm{logit}\,p' = (1 - s)\,\mathrm{logit}\,c + s\,\mathrm{logit}\,p

    with c the share of such answers that were right in opened cases, and s the weight of the softmax p: Platt scaling
    (1999) with an offset per type of answer.

    Parameters
    ----------
    probabilities : dict
        Name -> probability of the softmax. Changed in place.
    chosen : sequence of str
        Names of the answer.
    certainty : float
        The share c.
    settings : MismatchSettings
        Its ``softmax_share`` is s.

    Returns
    -------
    float
        Calibrated probability.

    Examples
    --------
    >>> from turnout.config.settings.mismatch import MismatchSettings
    >>> round(calibrate({"a": 0.5, "none": 0.5}, ("a",), 0.5, MismatchSettings()), 6)
    0.5
    """
    least = THRESHOLDS.min_probability
    raw = min(1.0 - least, max(least, sum(probabilities.get(name, 0.0) for name in chosen)))
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


def _logit(p: float) -> float:
    return float(np.log(p / (1.0 - p)))
