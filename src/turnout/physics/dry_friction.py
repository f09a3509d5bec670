"""Dry friction in a fastening, baseplate or fishplate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, SupportMotion, SupportSite
from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import FrictionLaw, Port

if TYPE_CHECKING:
    from turnout.simulate.track import Track

SLIP_RATE = 2e-3  # m/s, slip rate over which the force changes sign
STARTS = ((1500.0,),)  # N


@dataclass(frozen=True)
class DryFriction(PhysicsTerm):
    r"""Force between rail and sleeper against their relative velocity, :math:`F = F_0 \tanh(\dot d / v_0)`."""

    support: int
    limit: float

    name = "dry_friction"
    left_out = "dry friction of {limit:.0f} N between rail and sleeper {support}"
    message = "A joint at {place} has dry friction of up to {limit}"
    site_check = "Look for a loose clip or a worn baseplate on this sleeper"
    effect_type = "port"
    frame = "amplitude"
    requirements = (PASSAGES,)
    site_types = (SupportSite,)
    column_type = "support"
    smallest_reportable = 500.0
    required_data_type = "passage"  # for impacts of one force friction is a damper
    parameters = (
        Parameter("limit", "N", 0.0, (0.0, 2e4), "force at which the joint slips",
                  "Marino and Cicirello 2020, Experimental investigation of a single-degree-of-freedom system with "
                  "Coulomb friction"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """1 kN at support 20."""
        return cls(20, 1000.0)

    @classmethod
    def hypotheses(cls, site: SupportSite) -> Iterator[Hypothesis]:
        """Friction at this support; only trains distinguish it from damping."""
        if site.has_passages:
            yield Hypothesis(STARTS, {"support": site.support}, site.where, site.n_sites)

    def ports(self, track: Track) -> Sequence[Port]:
        """One port between rail and sleeper."""
        self.check()
        if self.limit == 0.0 or track.layers == 1:
            return ()
        ends = ((("rail", self.support), 1.0), (("sleeper", self.support), -1.0))
        return (Port(ends, FrictionLaw(self.limit, SLIP_RATE), label=f"friction at support {self.support}"),)

    def pseudo_force(self, motion: SupportMotion) -> tuple[str, np.ndarray]:
        """The friction force at the relative velocity of rail and sleeper in the base simulation."""
        deflection = motion.rail - motion.sleeper
        return "pad", -self.limit * np.tanh(np.gradient(deflection) * motion.rate / SLIP_RATE)
