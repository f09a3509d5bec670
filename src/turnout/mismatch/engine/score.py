"""A candidate after its joint refit: what it is worth, and what speaks for and against it."""

from dataclasses import dataclass, field

import numpy as np

NO_UPPER_END = 0.5  # of a size; one that errs by more is known from below alone: 95 % reach beyond twice of it


@dataclass(frozen=True)
class Score:
    """A candidate after its joint refit: ``gain`` in held-out log density over the base model less the log of the
    places scanned [nats], ``worst`` the least gain of a fold, ``explained`` share of the excess, ``fit``; ``usual``: of
    a size by which like parts of this very case differ anyway, or not shown by those who would have to; ``alone`` the
    one condition that it hangs on (``alone.hangs_on``)."""

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
        """It is large enough that somebody would act."""
        if self.usual:
            return False
        known, sized = self.candidate.parameters, self.candidate.sized
        size = np.linalg.norm(self.own[0][:sized] - self.candidate.neutral[:sized]) if known else np.inf
        open_by = self.candidate.sure * float(self.own[1][0]) if self.candidate.sure else 0.0
        return size - open_by >= self.candidate.least

    def told_elsewhere(self, settings):
        """Why what is left of the fit is no witness against it, in words, "" where it is one: data that are not those
        of the fit are evidence enough, and it makes the fit worse by no more than a margin, which its own numbers cost;
        or conditions are in which nothing shows that was named before, whose shape may be what is left elsewhere."""
        places = np.log(self.candidate.scanned)
        told = self.candidate.aside - places
        if self.candidate.sounding and told > settings.threshold and self.gain > told - settings.margin:
            return "known by its blows"
        apart = self.apart - places > settings.threshold
        return "seen where the effect named before does not show" if apart else ""

    def faint(self, excess, settings):
        """It explains too little of an ``excess`` over controls to be what makes it."""
        return excess > 1.0 and self.explained < settings.explained

    @property
    def is_open(self):
        """Its size is only known from below, and beyond it is what ``open_as`` names."""
        if not self.candidate.open_as:
            return False
        sizes, errors = self.own
        return bool(errors[0] > NO_UPPER_END * abs(sizes[0] - self.candidate.neutral[0]))

    def is_limit_of(self, other):
        """``other`` is at the bound, within its standard error, where it cannot be told from this at the same place."""
        if getattr(other.candidate, "limit", "") != self.family or other.candidate.where != self.candidate.where:
            return False
        sizes, errors = other.own
        return float(sizes[0] - errors[0]) <= other.candidate.parameters[0].bounds[0]

    def is_plain_form_of(self, other):
        """``other`` at the same place says the same with a parameter more: its size is this one's."""
        family, k = other.candidate.plain or ("", 0)
        if family != self.family or other.candidate.where != self.candidate.where:
            return False
        (mine, error), (others, errors) = self.own, other.own
        return abs(mine[0] - others[k]) <= 2.0 * np.hypot(error[0], errors[k])
