"""Score of a candidate after its joint refit: its gain, and what supports and contradicts it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from turnout.mismatch.engine.thresholds import THRESHOLDS

if TYPE_CHECKING:
    from turnout.config.settings.mismatch import MismatchSettings
    from turnout.mismatch.engine.candidate import Candidate
    from turnout.mismatch.engine.fit import Fit


@dataclass(frozen=True)
class Score:
    """A candidate after its joint refit.

    ``gain`` in held-out log density over the base model, less the log of the number of sites [nats]. ``worst_gain``
    least gain of a condition. ``explained`` share of the excess. ``is_ordinary``: similar components of this case
    differ by this size anyway, or the required observations do not support it. ``single_source``: the one recording,
    position of impacts or sensor on which it rests, in words (module ``single_source``). ``unmasked_gain`` gain of
    conditions in which no earlier effect shows. ``possible_positions``: first and last position whose evidence is
    hardly smaller [m], None if there is no other.
    """

    candidate: Candidate
    gain: float
    worst_gain: float
    explained: float
    fit: Fit
    by_condition: dict[str, float] = field(default_factory=dict)
    is_ordinary: bool = False
    single_source: str = ""
    unmasked_gain: float = 0.0
    possible_positions: tuple[float, float] | None = None

    @property
    def estimates(self) -> tuple[np.ndarray, np.ndarray]:
        """(values, standard errors) of its parameters; the first is the size of the effect."""
        psi_slice = self.fit.part(self.candidate)
        return self.fit.psi[psi_slice], self.fit.psi_se[psi_slice]

    @property
    def family(self) -> str:
        """Name of the effect."""
        return self.candidate.family

    @property
    def in_words(self) -> str:
        """Effect and site as text, for reasons."""
        return self.candidate.in_words

    @property
    def has_position(self) -> bool:
        """Whether it is at one position, not of the whole track, a train, a wheel or a sensor."""
        return self.candidate.position is not None

    @property
    def is_reportable(self) -> bool:
        """Whether it is so large that somebody would act."""
        if self.is_ordinary:
            return False
        rules, n_size = self.candidate.naming, self.candidate.naming.n_size_parameters
        change = np.array([np.inf])
        if self.candidate.parameters:
            change = self.estimates[0][:n_size] - self.candidate.neutral[:n_size]
        size = float(np.linalg.norm(change))
        uncertainty = rules.min_significance * float(self.estimates[1][0]) if rules.min_significance else 0.0
        return size - uncertainty >= rules.smallest_reportable

    @property
    def has_meaning(self) -> bool:
        """Whether every parameter has a value that is physically possible: finite, and within its bounds.

        A play below 0 is none, for example. A resonance of quality 1.5, the least that it can have, is a filter.
        """
        if not self.candidate.parameters:
            return True
        values, bounds = self.estimates[0], np.array([p.bounds for p in self.candidate.parameters])
        slack = THRESHOLDS.bound_slack * (bounds[:, 1] - bounds[:, 0])
        slack = np.where([p.has_open_ends for p in self.candidate.parameters], -slack, slack)
        return bool(np.all((values >= bounds[:, 0] - slack) & (values <= bounds[:, 1] + slack)))

    def exemption_reason(self, settings: MismatchSettings) -> str:
        """Reason why the residual of the fit does not count against the candidate.

        Either external evidence alone is enough, and the fit becomes worse by no more than a margin. Or conditions
        support it in which no earlier effect shows, whose shape may be the residual elsewhere.

        Parameters
        ----------
        settings : MismatchSettings

        Returns
        -------
        str
            In words, "" if there is none.
        """
        position_cost = np.log(self.candidate.site.n_scanned)
        evidence = self.candidate.naming.external_evidence - position_cost
        if (
            self.candidate.naming.evidence_suffices
            and evidence > settings.threshold
            and self.gain > evidence - settings.margin
        ):
            return "the impacts of its wheels alone are evidence enough"
        is_unmasked = self.unmasked_gain - position_cost > settings.threshold
        return "it is visible in recordings in which the effect named first is not" if is_unmasked else ""

    def explains_too_little(self, excess: float, settings: MismatchSettings) -> bool:
        """Whether it explains too little of an excess over controls to be its cause.

        Parameters
        ----------
        excess : float
            Weighted mean square of the base model over the control level.
        settings : MismatchSettings

        Returns
        -------
        bool
        """
        return excess > 1.0 and self.explained < settings.explained

    @property
    def is_unbounded(self) -> bool:
        """Whether only a lower limit of its size is known, and beyond it is its ``unbounded_form``."""
        if not self.candidate.effect.unbounded_form:
            return False
        sizes, errors = self.estimates
        return bool(errors[0] > THRESHOLDS.max_bounded_error * abs(sizes[0] - self.candidate.neutral[0]))

    def is_limit_of(self, rival: Score) -> bool:
        """Whether a rival at the same site is at its bound, within a standard error, where it looks like this one.

        Parameters
        ----------
        rival : Score

        Returns
        -------
        bool
        """
        if rival.candidate.effect.limit_form != self.family or rival.candidate.where != self.candidate.where:
            return False
        sizes, errors = rival.estimates
        return float(sizes[0] - errors[0]) <= rival.candidate.parameters[0].bounds[0]

    def is_simpler_form_of(self, rival: Score) -> bool:
        """Whether a rival at the same site is the same effect with one more parameter: the sizes agree.

        Parameters
        ----------
        rival : Score

        Returns
        -------
        bool
        """
        family, k = rival.candidate.effect.simpler_form or ("", 0)
        if family != self.family or rival.candidate.where != self.candidate.where:
            return False
        (own_sizes, error), (rival_sizes, errors) = self.estimates, rival.estimates
        return bool(abs(own_sizes[0] - rival_sizes[k]) <= 2.0 * np.hypot(error[0], errors[k]))

    def is_special_form_of(self, other: Score) -> bool:
        """Whether the other one is the same fault at the same site, in recordings of all types.

        Parameters
        ----------
        other : Score

        Returns
        -------
        bool
        """
        return self.candidate.effect.general_form == other.family and self.candidate.where == other.candidate.where

    def is_independent_of(self, rival: Score) -> bool:
        """Whether two effects confirm one another.

        Two of one family, or of one component, do not: together they can correct nearly any shape. Those of two trains
        do: no recording shows both.

        Parameters
        ----------
        rival : Score

        Returns
        -------
        bool
        """
        trains = {s.candidate.where.get("train") for s in (self, rival)}
        is_related = self.family == rival.family or (
            self.candidate.effect.component and self.candidate.part == rival.candidate.part
        )
        return not is_related or (len(trains) == 2 and None not in trains)
