"""Sleepers that can lift off the ballast, which takes no tension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import LiftLaw, Port

if TYPE_CHECKING:
    from turnout.simulate.track import Track


@dataclass(frozen=True)
class LiftingSleepers(PhysicsTerm):
    r"""Remove the tension of the ballast where a sleeper lifts off against its dead load W.

    .. math:: R = \max(0,\, W + k_b y + c_b \dot y) - W, \qquad \text{base: } R = k_b y + c_b \dot y

    y is the displacement of the sleeper from its unloaded position, with 3 layers relative to the ballast mass. The sum
    decides on contact: with y alone the damper would hold a sleeper that lifts. W is the weight of the sleeper and of a
    bay of rail: 1.8 kN, 20 µm on 90 MN/m. ``share`` is the part of the tension that is removed, 1: all of it. Every
    sleeper is a port in one system, so choose those near the sensors.
    """

    first: int
    last: int
    share: float
    dead_load: float = 1.83e3

    name = "lifting_sleepers"
    left_out = "ballast under sleepers {first} to {last} does not pull when they lift off against {dead_load:.0f} N"
    message = "The sleepers about {place} lift off their ballast"
    site_check = "Look under these sleepers while a train passes; tamp them"
    effect_type = "port"
    frame = "place"
    asked = False
    parameters = (
        Parameter(
            "share",
            unit="-",
            neutral=0.0,
            bounds=(0.0, 1.0),
            meaning="share of the ballast's pull that is missing",
            source="Nielsen and Igeland 1995, Vertical dynamic interaction between train and track",
        ),
    )

    @classmethod
    def example(cls) -> Self:
        """Eleven sleepers; the rail is bent upwards and carries most of their weight."""
        return cls(15, 25, 1.0, dead_load=400.0)

    @property
    def withheld_share(self) -> float:
        """Share of the ballast that is missing after lift-off."""
        return self.share

    def ports(self, track: Track) -> Sequence[Port]:
        """One port at each sleeper."""
        self.check()
        if self.share == 0.0:
            return ()
        return tuple(self._port(track, j) for j in range(self.first, self.last + 1))

    def _port(self, track: Track, j: int) -> Port:
        ballast = track.ballast_link(j)
        law = LiftLaw(*(self.share * value for value in (ballast.stiffness, ballast.damping, self.dead_load)))
        return Port(ballast.ends, law, label=f"lift of sleeper {j}")
