"""Score of a candidate after its joint refit: its gain, and what supports and contradicts it."""

from dataclasses import dataclass, field

import numpy as np

# Standard error as a share of a size above which only a lower limit is known: 95 % reach beyond twice the size.
NO_UPPER_END = 0.5


@dataclass(frozen=True)
class Score:
    """A candidate after its joint refit.

    ``gain`` in held-out log density over the base model, less the log of the number of sites [nats]. ``worst_gain``
    least gain of a condition. ``explained`` share of the excess. ``is_ordinary``: similar components of this case
    differ by this size anyway, or the required observations do not support it. ``single_witness`` the one condition on
    which it rests (``cross_validation.single_witness``). ``unmasked_gain`` gain of conditions in which no earlier
    effect shows.
    """

    candidate: object
    gain: float
    worst: float
    explained: float
    fit: object
    by_condition: dict = field(default_factory=dict)
    usual: bool = False
    alone: str = ""
    apart: float = 0.0

    @property
    def own(self):
        """(values, standard errors) of its parameters; the first is the size of the effect."""
        mine = self.fit.part(self.candidate)
        return self.fit.psi[mine], self.fit.psi_se[mine]

    @property
    def family(self):
        """Name of the effect."""
        return self.candidate.family

    @property
    def material(self):
        """Whether it is so large that somebody would act."""
        if self.usual:
            return False
        known, sized = self.candidate.parameters, self.candidate.sized
        size = np.linalg.norm(self.own[0][:sized] - self.candidate.neutral[:sized]) if known else np.inf
        open_by = self.candidate.sure * float(self.own[1][0]) if self.candidate.sure else 0.0
        return size - open_by >= self.candidate.least

    def told_elsewhere(self, settings):
        """Reason, in words, why the residual of the fit does not count against it, "" if there is none.

        Either external evidence alone is enough, and the fit becomes worse by no more than a margin. Or conditions
        support it in which no earlier effect shows, whose shape may be the residual elsewhere.
        """
        places = np.log(self.candidate.scanned)
        told = self.candidate.aside - places
        if self.candidate.sounding and told > settings.threshold and self.gain > told - settings.margin:
            return "known by its blows"
        apart = self.apart - places > settings.threshold
        return "seen where the effect named before does not show" if apart else ""

    def faint(self, excess, settings):
        """Whether it explains too little of an ``excess`` over controls to be its cause."""
        return excess > 1.0 and self.explained < settings.explained

    @property
    def is_open(self):
        """Whether only a lower limit of its size is known, and beyond it is its ``unbounded_form``."""
        if not self.candidate.open_as:
            return False
        sizes, errors = self.own
        return bool(errors[0] > NO_UPPER_END * abs(sizes[0] - self.candidate.neutral[0]))

    def is_limit_of(self, other):
        """Whether ``rival`` at the same site is at its bound, within a standard error, where it looks like this one."""
        if getattr(other.candidate, "limit", "") != self.family or other.candidate.where != self.candidate.where:
            return False
        sizes, errors = other.own
        return float(sizes[0] - errors[0]) <= other.candidate.parameters[0].bounds[0]

    def is_plain_form_of(self, other):
        """Whether ``rival`` at the same site is the same effect with one more parameter: the sizes agree."""
        family, k = other.candidate.plain or ("", 0)
        if family != self.family or other.candidate.where != self.candidate.where:
            return False
        (mine, error), (others, errors) = self.own, other.own
        return abs(mine[0] - others[k]) <= 2.0 * np.hypot(error[0], errors[k])
