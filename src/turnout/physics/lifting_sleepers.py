"""Sleepers that the ballast presses but does not pull."""

from dataclasses import dataclass

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import LiftLaw, Port


@dataclass(frozen=True)
class LiftingSleepers(PhysicsTerm):
    r"""Take the pull of the ballast away where a sleeper lifts by more than its dead load W presses it down.

    .. math:: R = \max(0,\, W + k_b y + c_b \dot y) - W, \qquad \text{base: } R = k_b y + c_b \dot y

    y is the sleeper's position below where it rests unloaded, with 3 layers above the ballast's mass. The whole sum
    says whether there is contact: by y alone the damper would hold what leaves. W is what presses the sleeper, its own
    weight and that of a bay of rail: 1.8 kN, which 90 MN/m carry on 20 µm. ``share`` of the pull is taken away, 1: all
    of it. Every sleeper is a port in one system: choose those near the sensors.
    """

    first: int
    last: int
    share: float
    dead_load: float = 1.83e3

    name = "lifting_sleepers"
    left_out = "ballast under sleepers {first} to {last} does not pull when they lift off against {dead_load:.0f} N"
    kind = "port"
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
    def example(cls):
        """Eleven sleepers whose rail, bent upwards, carries most of their weight."""
        return cls(15, 25, 1.0, dead_load=400.0)

    @property
    def withheld(self):
        """Share of the ballast that is missing above where it lifts off."""
        return self.share

    def ports(self, track):
        """One port at each sleeper."""
        self.check()
        if self.share == 0.0:
            return ()
        return tuple(self._port(track, j) for j in range(self.first, self.last + 1))

    def _port(self, track, j):
        ballast = track.ballast_link(j)
        law = LiftLaw(*(self.share * value for value in (ballast.stiffness, ballast.damping, self.dead_load)))
        return Port(ballast.ends, law, label=f"lift of sleeper {j}")
