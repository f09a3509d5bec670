"""Facts on which the rules of ``decision`` rest: of one effect, of a name and of the reserved recordings.

Those of two effects are in ``second_effect`` and ``two_effects``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.single_source import REPETITION
from turnout.mismatch.engine.thresholds import THRESHOLDS
from turnout.number_text import evidence_in_words

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.ambiguity import Ambiguity
    from turnout.mismatch.engine.score import Score
    from turnout.mismatch.engine.verdict import Verdict
    from turnout.mismatch.engine.verification import Verification


def is_contradicted(worst_gain: float, gain: float, settings: MismatchSettings) -> bool:
    """Whether a held-out condition contradicts a name.

    Parameters
    ----------
    worst_gain : float
        Gain of the condition that gains least. [nats]
    gain : float
        Gain in all. [nats]
    settings : MismatchSettings

    Returns
    -------
    bool
    """
    return worst_gain < -max(THRESHOLDS.contradiction_threshold * settings.threshold, THRESHOLDS.max_loss_share * gain)


def likeliest(scores: Sequence[Score], excess: float, settings: MismatchSettings) -> Score:
    """The likeliest score. If it explains too little, the likeliest that other data support, if any.

    Parameters
    ----------
    scores : sequence of Score
        At least one.
    excess : float
        Weighted mean square of the base model over the control level.
    settings : MismatchSettings

    Returns
    -------
    Score
    """
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
    left_at_position : float
        Evidence that a force acts at the position of the best candidate, beside that candidate. [nats]
    disturbed : bool
        Another source than a train shakes the sensors in some recordings. These are not fitted.
    mismatched_trains : tuple of str
        Trains that do not agree with their vehicle file, so that most of their recordings are not fitted.
    no_train_matches : bool
        Several trains were recorded, and none agrees with its simulation: no recording of a train is fitted.
    strained : str
        Value of the base model that no tolerance explains, in words; "" if there is none.
    local_change : float
        Evidence that a single component has another value under trains than under impacts. [nats]
    local_deviation : float
        Evidence that a single component differs from the others of its kind by more than their scatter. [nats]
    ambiguity : Ambiguity or None
        An effect that the recordings show and that may have several causes.
    """

    scores: Sequence[Score]
    excess: float
    settings: MismatchSettings
    consistent: bool = True
    structure: float = 0.0
    residual_excess: float = 1.0
    left_at_position: float = 0.0
    disturbed: bool = False
    mismatched_trains: tuple[str, ...] = ()
    no_train_matches: bool = False
    strained: str = ""
    local_change: float = 0.0
    local_deviation: float = 0.0
    ambiguity: Ambiguity | None = None

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
        """The likeliest of the passing candidates, or its general form where the recordings cannot tell the two."""
        first = likeliest(self.passing, self.excess, self.settings)
        general = [
            s for s in self.passing if first.is_special_form_of(s) and first.gain - s.gain < self.settings.margin
        ]
        return general[0] if general else first

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
        return bool(self.leader.single_source) or is_contradicted(
            self.leader.worst_gain, self.leader.gain, self.settings
        )

    @cached_property
    def shows_nothing(self) -> bool:
        """Whether no candidate passes, or only a weak one that other conditions contradict, without any excess.

        A name that rests on the repetition of impacts is weak: without it, it has not the evidence that a name needs.
        """
        if not self.has_leader:
            return True
        is_weak = self.leader.gain < THRESHOLDS.weak_gain * self.settings.threshold
        is_weak = is_weak or self.leader.single_source == REPETITION
        return (self.contradicted or not self.consistent) and is_weak and self.excess <= 1.0

    @property
    def is_ambiguous(self) -> bool:
        """Whether the recordings show an effect beyond doubt that may have several causes."""
        return self.ambiguity is not None and self.ambiguity.nats > self.settings.threshold

    @property
    def train_names(self) -> str:
        """Trains that do not agree with their vehicle file, in one string."""
        return ", ".join(self.mismatched_trains)

    @property
    def loss_in_words(self) -> str:
        """Loss of the condition that loses most by the leader."""
        return evidence_in_words(-self.leader.worst_gain)

    @property
    def left_in_words(self) -> str:
        """The evidence ``left_at_position``."""
        return evidence_in_words(self.left_at_position)

    @property
    def change_in_words(self) -> str:
        """The evidence ``local_change``."""
        return evidence_in_words(self.local_change)

    @property
    def deviation_in_words(self) -> str:
        """The evidence ``local_deviation``."""
        return evidence_in_words(self.local_deviation)

    @cached_property
    def limit_forms(self) -> list[Score]:
        """Passing candidates that the leader equals at its limit. Ballast without stiffness is a hanging sleeper."""
        return [s for s in self.passing if s.is_limit_of(self.leader) and s.explained >= self.settings.explained]

    @cached_property
    def special_forms(self) -> list[Score]:
        """Reportable special forms of the leader within its margin: the same fault in recordings of one type."""
        return [s for s in self._within_margin if s.is_special_form_of(self.leader)]

    @cached_property
    def rivals(self) -> list[Score]:
        """Other reportable candidates within the margin of the leader."""
        return [s for s in self._within_margin if not s.is_special_form_of(self.leader)]

    @property
    def _within_margin(self) -> list[Score]:
        return [s for s in self.ranked[1:] if s.is_reportable and self.leader.gain - s.gain < self.settings.margin]

    def names(self, answer: str) -> tuple[str, ...]:
        """Families that an answer names.

        Parameters
        ----------
        answer : str

        Returns
        -------
        tuple of str
            Two for "a_or_b", one for "named", none for others.
        """
        if answer == "a_or_b":
            return self.leader.family, (self.limit_forms or self.rivals)[0].family
        return (self.leader.family,) if answer == "named" else ()


@dataclass(frozen=True)
class ToleratedEvidence:
    """What the name of an effect that the base model tolerates rests on.

    Attributes
    ----------
    score : Score
        Of the fit with the effect in place of the tolerance. Its gain is that over the base fit.
    settings : MismatchSettings
    """

    score: Score
    settings: MismatchSettings


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
    """Facts that decide the grade of a name, all of the last fit.

    Attributes
    ----------
    score : Score
        Of the name.
    excess : float
        Largest excess ratio of the fit.
    free_share : float
        Share of the gain on held-out recordings that unconstrained force laws reach and all names together miss.
    strained : str
        Values that no tolerance explains, in words; "" if there are none.
    local_change : float
        Evidence that single components have another value under trains than under impacts, with all names in the fit.
        The part that errors in the shape of the names may cause is subtracted. [nats]
    threshold : float
        A larger ``local_change`` withdraws a name without a position. [nats]
    """

    score: Score
    excess: float
    free_share: float = 0.0
    strained: str = ""
    local_change: float = 0.0
    threshold: float = 0.0

    @property
    def leaves_nothing(self) -> bool:
        """Whether the residual is at the control level, and free laws explain at most half of what they may."""
        return self.excess <= 1.0 and self.free_share <= 0.5 * THRESHOLDS.max_free_law_share


@dataclass(frozen=True)
class UnprovenEvidence:
    """The verdicts of a diagnosis, and why its kind of diagnosis is not proven: ``reservation``, "" where it is.

    ``names_are_asked``: the setting ``unproven_names``.
    """

    verdicts: tuple[Verdict, ...]
    reservation: str
    names_are_asked: bool = False

    @property
    def has_name(self) -> bool:
        """Whether any verdict has a name, or a choice of names."""
        return any(v.answer in ("named", "a_or_b") for v in self.verdicts)

    @property
    def names(self) -> str:
        """All names in words."""
        return " and ".join(" or ".join(v.names_in_words) for v in self.verdicts if v.names)


@dataclass(frozen=True)
class ReservedEvidence:
    """The verdicts, and how well the last fit predicts the reserved recordings; ``settings`` of the diagnosis."""

    verdicts: tuple[Verdict, ...]
    verification: Verification
    settings: MismatchSettings

    @property
    def predicts_nothing(self) -> bool:
        """Whether a name stands, and the last fit predicts the reserved recordings worse than a signal of 0 would."""
        return any(v.answer in ("named", "a_or_b") for v in self.verdicts) and self.fit < 0.0

    @property
    def fit(self) -> float:
        """Of the reserved recordings by the last fit; nan without any. [%]"""
        return self.verification.before if self.verification.after is None else self.verification.after

    @property
    def has_fallen(self) -> bool:
        """Whether the fit falls by more than is allowed, and by two standard errors."""
        return self.verification.falls_by(self.settings.fall)

    @property
    def falls_clearly(self) -> bool:
        """Whether the fit falls, and contradicts the name by that.

        The evidence lost must be as much as one held-out condition may not lose (``is_contradicted``).
        """
        gain = self.verdict.scores[0].gain if self.verdict.scores else 0.0
        return self.has_fallen and is_contradicted(-self.verification.lost_evidence, gain, self.settings)

    @property
    def loss_in_words(self) -> str:
        """Evidence against the name from reserved recordings."""
        return evidence_in_words(self.verification.lost_evidence)

    @property
    def verdict(self) -> Verdict:
        """Verdict on the first effect."""
        return self.verdicts[0]

    @property
    def words(self) -> str:
        """First name as text, with its site."""
        return self.verdict.names_in_words[0]

    @property
    def is_single_name(self) -> bool:
        """Whether there is one effect alone, with a name of any grade."""
        return len(self.verdicts) == 1 and self.verdict.answer == "named"

    @property
    def is_single_name_of_grade_b(self) -> bool:
        """Whether there is one effect alone, named with grade B."""
        return self.is_single_name and self.verdict.grade == "B"
