"""Dry friction in a fastening, baseplate or fishplate."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import FrictionLaw, Port

SLIP_RATE = 2e-3  # m/s, slip rate over which the force changes sign


@dataclass(frozen=True)
class DryFriction(PhysicsTerm):
    r"""Force between rail and sleeper against their relative velocity, :math:`F = F_0 \tanh(\dot d / v_0)`."""

    support: int
    limit: float

    name = "dry_friction"
    left_out = "dry friction of {limit:.0f} N between rail and sleeper {support}"
    effect_type = "port"
    frame = "amplitude"
    parameters = (
        Parameter("limit", "N", 0.0, (0.0, 2e4), "force at which the joint slips",
                  "Marino and Cicirello 2020, Experimental investigation of a single-degree-of-freedom system with "
                  "Coulomb friction"),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """1 kN at support 20."""
        return cls(20, 1000.0)

    def ports(self, track):
        """One port between rail and sleeper."""
        self.check()
        if self.limit == 0.0 or track.layers == 1:
            return ()
        ends = ((("rail", self.support), 1.0), (("sleeper", self.support), -1.0))
        return (Port(ends, FrictionLaw(self.limit, SLIP_RATE), label=f"friction at support {self.support}"),)

    def damping_at(self, velocity_amplitude):
        r"""Equivalent viscous damping of slip at an amplitude V well above v0, :math:`4 F_0 / (\pi V)` [N s/m]."""
        return 4.0 * self.limit / (np.pi * velocity_amplitude)
