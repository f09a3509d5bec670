"""Fastenings that do not hold the rail down."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, SupportMotion, SupportSite
from turnout.physics.requirement import IMPACTS, PASSAGES
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import Port, TableLaw

if TYPE_CHECKING:
    from turnout.simulate.links import Link
    from turnout.simulate.track import Track

SOURCE = "Shaw and Holmes 1983, A periodically forced piecewise linear oscillator"
ONSET = 1e-6  # m, deflection over which the damping of the pad is lost
STARTS = ((0.6, 0.0), (0.6, 1.0))  # shares that are lost, of the spring and of the damper
HALF_LENGTHS = (0, 1)  # sleepers to either side whose fastenings are loose alike


@dataclass(frozen=True)
class LooseFastening(PhysicsTerm):
    r"""Remove a share of the pad's reaction while the rail lifts off its seat.

    .. math:: F = -\left( s k_p \min(d, 0) + r c_p \dot d \, [d < 0] \right)

    d is the compression of the pad, from the unloaded state. A pad that is pressed has its stiffness. One that is
    pulled has what the clips give: none without clips (s = 1). Its damper may lose another share r. A hammer impact
    moves the rail up and down, so a hammer test shows the mean of both, and the rail is thrown up. Wheels press it.
    """

    first: int
    last: int
    lost: float
    damper: float = 0.0

    name = "loose_fastening"
    left_out = "fastenings of sleepers {first} to {last} have lost {lost:.2f} of their stiffness in uplift"
    message = "The fastenings at {place} have lost {lost} of their stiffness where the rail lifts"
    site_check = "Look for loose, broken or missing clips on these sleepers"
    separating_test = "hammer tests at this sleeper, and passages of a light train"
    effect_type = "port"
    frame = "place"
    requirements = (PASSAGES, IMPACTS)
    site_types = (SupportSite,)
    column_type = "support"
    smallest_reportable = 0.3
    component = "pad"
    parameters = (
        Parameter("lost", "-", 0.0, (0.0, 1.0), "share of the stiffness that is lost in uplift", SOURCE),
        Parameter("damper", "-", 0.0, (0.0, 1.0), "share of the damping that is lost in uplift", SOURCE),
    )

    @classmethod
    def example(cls) -> Self:
        """Three fastenings with a fifth of their stiffness and half of their damping in uplift."""
        return cls(19, 21, 0.8, 0.5)

    @classmethod
    def hypotheses(cls, site: SupportSite) -> Iterator[Hypothesis]:
        """One fastening, or three; only trains distinguish them from softer pads."""
        return site.stretches(STARTS, HALF_LENGTHS)

    def ports(self, track: Track) -> Sequence[Port]:
        """One port between rail and sleeper at each fastening."""
        self.check()
        if self.lost == self.damper == 0.0 or track.layers == 1:
            return ()
        return tuple(self._port(track.pad_link(j), j) for j in self.supports)

    def _port(self, pad: Link, j: int) -> Port:
        k, c = self.lost * pad.stiffness, self.damper * pad.damping
        law = TableLaw((-ONSET, 0.0, ONSET), (k * ONSET, 0.0, 0.0), (-c, -0.5 * c, 0.0))
        return Port(pad.ends, law, label=f"uplift at support {j}")

    def pseudo_force(self, motion: SupportMotion) -> tuple[str, np.ndarray]:
        """The pull of the pad that is missing."""
        return "pad", self.lost * motion.pad_stiffness * np.minimum(motion.rail - motion.sleeper, 0.0)
