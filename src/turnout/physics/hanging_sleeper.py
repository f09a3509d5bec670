"""A sleeper that hangs above its ballast."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, SupportMotion, SupportSite
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.force_laws import Port, TableLaw

if TYPE_CHECKING:
    from turnout.simulate.track import Track

ONSET = 1e-5  # m, deflection over which the ballast damping increases or decreases
GAP_STARTS = (1.3e-4, 3e-4, 7e-4, 1.6e-3)  # m; a train closes the first at once and the last never
BEARING_SHARES = (0.0, 0.4)  # share of the ballast that still bears


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
    message = "The sleeper at {place} hangs {gap} above its ballast"
    message_unbounded = "The sleeper at {place} hangs above its ballast, and no train here closes the gap"
    site_check = "Look under this sleeper while a train passes; tamp it"
    separating_test = "passages of a lighter and a heavier train, and a hammer test on this sleeper"
    effect_type = "port"
    frame = "place"
    site_types = (SupportSite,)
    column_type = "support"
    smallest_reportable = 5e-5
    component = "ballast"
    prescreen_group = "ballast"
    simpler_form = ("local_ballast", 1)
    unbounded_form = "local_ballast"
    start_from_base = False
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
            meaning="share of the ballast that carries the unloaded sleeper",
            source="Kaewunruen and Remennikov 2008, Dynamic properties of railway track and its components",
        ),
    )

    @classmethod
    def example(cls) -> Self:
        """0.3 mm under sleeper 20."""
        return cls(20, 3e-4)

    @classmethod
    def hypotheses(cls, site: SupportSite) -> Iterator[Hypothesis]:
        """A gap of several widths under this sleeper, free or partly seated."""
        starts = tuple((gap, share) for share in BEARING_SHARES for gap in GAP_STARTS)
        yield Hypothesis(starts, {"sleeper": site.support}, site.where, site.n_sites)

    @property
    def withheld_share(self) -> float:
        """Share of the ballast that is missing within the gap."""
        return 1.0 - self.seated

    def ports(self, track: Track) -> Sequence[Port]:
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

    def pseudo_force(self, motion: SupportMotion) -> tuple[str, np.ndarray]:
        """The ballast reaction that is missing within the gap."""
        inside = np.clip(motion.sleeper, -self.gap, self.gap)
        return "sleeper", self.withheld_share * motion.ballast_stiffness * inside
