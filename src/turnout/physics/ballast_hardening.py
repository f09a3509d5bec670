"""Ballast that stiffens with deflection."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, SupportMotion, SupportSite
from turnout.physics.requirement import PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import Port, TableLaw

if TYPE_CHECKING:
    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

REFERENCE_DEFLECTION = 1e-3  # m, deflection at which the parameter is the added share of stiffness
DEFLECTIONS = np.linspace(-3e-3, 3e-3, 121)
STARTS = ((2.0,),)  # of the stiffness at 1 mm
HALF_LENGTHS = (1, 2, 4)  # sleepers to either side that harden alike


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
    left_out_negative = (
        "ballast under sleepers {first} to {last} softens by {hardening_size:.2f} at a deflection of 1 mm"
    )
    message = "The ballast about {place} stiffens under load"
    message_negative = "The ballast about {place} softens under load"
    site_check = "Look for fine material or frost in this ballast; compare its settlement under a heavy train"
    effect_type = "port"
    frame = "amplitude"
    requirements = (PASSAGES,)
    site_types = (SupportSite,)
    column_type = "support"
    smallest_reportable = 0.3
    component = "ballast"
    parameters = (
        Parameter("hardening", "-", 0.0, (-0.1, 20.0), "share of stiffness added at 1 mm",
                  "Wu and Thompson 1999, The effects of local preload on the foundation stiffness of railway track"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """Three times as stiff at 1 mm."""
        return cls(19, 21, 3.0)

    @classmethod
    def hypotheses(cls, site: SupportSite) -> Iterator[Hypothesis]:
        """Stretches of several lengths about this support; only trains deflect the ballast enough."""
        return site.stretches(STARTS, HALF_LENGTHS)

    def ports(self, track: Track) -> Sequence[Port]:
        """One port per sleeper."""
        self.check()
        if self.hardening == 0.0 or track.layers == 1:
            return ()
        return tuple(self._port(track.ballast_link(j), j) for j in range(self.first, self.last + 1))

    def _port(self, ballast: Link, j: int) -> Port:
        force = self.hardening * ballast.stiffness * (DEFLECTIONS * (DEFLECTIONS / REFERENCE_DEFLECTION) ** 2)
        law = TableLaw(tuple(DEFLECTIONS), tuple(force), (0.0,) * DEFLECTIONS.size)
        return Port(ballast.ends, law, label=f"hardening under sleeper {j}")

    def pseudo_force(self, motion: SupportMotion) -> tuple[str, np.ndarray]:
        """The cubic spring force on the sleeper."""
        y = motion.sleeper
        return "sleeper", -self.hardening * motion.ballast_stiffness * y * (y / REFERENCE_DEFLECTION) ** 2
