"""A sleeper that hangs above its ballast."""

from dataclasses import dataclass

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import Port, TableLaw

ONSET = 1e-5  # m, deflection over which the ballast damping increases or decreases


@dataclass(frozen=True)
class HangingSleeper(PhysicsTerm):
    r"""Remove the ballast reaction while one sleeper moves within its gap.

    .. math:: F = (1 - s) \left( k_b \, \mathrm{clip}(y, -g, g) + c_b \dot y \, [|y| < g] \right)

    The base simulation has :math:`-k_b y - c_b \dot y` under every sleeper. This force cancels it within the gap,
    except for the share s of the sleeper that is ``seated``: a void grows from a partial one.
    y is the displacement of the sleeper from its unloaded position, with 3 layers relative to the ballast mass. A
    hammer impact moves it by micrometres up and down, so in a hammer test the sleeper is free. A lift by more than the
    gap is as in the base simulation.
    """

    sleeper: int
    gap: float
    seated: float = 0.0

    name = "hanging_sleeper"
    left_out = "sleeper {sleeper} hangs {gap:.4f} m above its ballast"
    effect_type = "port"
    parameters = (
        Parameter(
            "gap",
            unit="m",
            neutral=0.0,
            bounds=(0.0, 5e-3),
            meaning="clearance when unloaded",
            source="Lundqvist and Dahlberg 2005, Load impact on railway track due to unsupported sleepers",
        ),
        Parameter(
            "seated",
            unit="-",
            neutral=0.0,
            bounds=(0.0, 0.95),
            meaning="share of the ballast that bears the unloaded sleeper",
            source="Kaewunruen and Remennikov 2008, Dynamic properties of railway track and its components",
        ),
    )

    @classmethod
    def example(cls):
        """0.3 mm under sleeper 20."""
        return cls(20, 3e-4)

    @property
    def withheld_share(self):
        """Share of the ballast that is missing within the gap."""
        return 1.0 - self.seated

    def ports(self, track):
        """One port at the sleeper; none without a gap."""
        self.check()
        if self.gap == 0.0:
            return ()
        ballast = track.ballast_link(self.sleeper)
        k, c = self.withheld_share * ballast.stiffness, self.withheld_share * ballast.damping
        onset = min(ONSET, 0.5 * self.gap)
        deflections: tuple[float, ...] = (
            -self.gap - onset,
            -self.gap,
            -self.gap + onset,
            self.gap - onset,
            self.gap,
            self.gap + onset,
        )
        withheld_force = tuple(-k * min(max(y, -self.gap), self.gap) for y in deflections)
        if onset == self.gap - onset:  # the two middle points are equal
            deflections, withheld_force = (
                (*deflections[:2], 0.0, *deflections[4:]),
                (*withheld_force[:2], 0.0, *withheld_force[4:]),
            )
        viscous = (0.0, -0.5 * c, *(-c,) * (len(deflections) - 4), -0.5 * c, 0.0)
        law = TableLaw(deflections, withheld_force, viscous)
        return (Port(ballast.ends, law, label=f"gap under sleeper {self.sleeper}"),)
