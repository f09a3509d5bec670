"""Ballast that stiffens with deflection."""

from dataclasses import dataclass

import numpy as np

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import Port, TableLaw

REFERENCE_DEFLECTION = 1e-3  # m, deflection at which the parameter is the added share of stiffness
DEFLECTIONS = np.linspace(-3e-3, 3e-3, 121)


@dataclass(frozen=True)
class BallastHardening(PhysicsTerm):
    r"""Cubic spring under some sleepers, :math:`F = h k_b y (y / 1\,\mathrm{mm})^2`.

    A hammer test with its micrometres does not show it.
    """

    first: int
    last: int
    hardening: float

    name = "ballast_hardening"
    left_out = "ballast under sleepers {first} to {last} stiffens by {hardening:.2f} at a deflection of 1 mm"
    effect_type = "port"
    frame = "amplitude"
    parameters = (
        Parameter("hardening", "-", 0.0, (-0.1, 20.0), "share of stiffness added at 1 mm",
                  "Wu and Thompson 1999, The effects of local preload on the foundation stiffness of railway track"),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """Three times as stiff at 1 mm."""
        return cls(19, 21, 3.0)

    def ports(self, track):
        """One port per sleeper."""
        self.check()
        if self.hardening == 0.0 or track.layers == 1:
            return ()
        return tuple(self._port(track.ballast_link(j), j) for j in range(self.first, self.last + 1))

    def _port(self, ballast, j):
        force = self.hardening * ballast.stiffness * (DEFLECTIONS * (DEFLECTIONS / REFERENCE_DEFLECTION) ** 2)
        law = TableLaw(tuple(DEFLECTIONS), tuple(force), (0.0,) * DEFLECTIONS.size)
        return Port(ballast.ends, law, label=f"hardening under sleeper {j}")
