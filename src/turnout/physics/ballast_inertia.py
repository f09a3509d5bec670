"""Ballast that moves with the sleepers and radiates into the ground."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from turnout.physics.hypothesis import Hypothesis, TrackSite
from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.links import Link

if TYPE_CHECKING:
    from turnout.simulate.track import Track

SOURCE = "Wolf 1994, Foundation vibration analysis using simple physical models: cones"
STARTS = ((120.0, 0.0),)  # [kg, N s/m]


@dataclass(frozen=True)
class BallastInertia(PhysicsTerm):
    r"""A cone of ground under every sleeper: :math:`\Delta K(\omega) = i\omega c - \omega^2 m`.

    With 3 layers it is under the ballast mass, parallel to the subgrade. A negative c removes at most nine tenths of
    the damper there: a negative damper would add energy.
    """

    mass: float
    damping: float = 0.0

    name = "ballast_inertia"
    left_out = "{mass:.0f} kg of ballast move with every half sleeper and {damping:.0f} N s/m radiate"
    message = "The ballast moves with the sleepers, {mass} of it under each"
    site_check = "Check sleeper mass and ballast depth in the track file"
    effect_type = "matrix"
    frame = "condition"
    site_types = (TrackSite,)
    column_type = "track"
    smallest_reportable = 20.0
    prescreen_group = name  # common values of the base model change first to hide it
    parameters = (
        Parameter("mass", "kg", 0.0, (0.0, 600.0), "ballast that moves with half a sleeper", SOURCE),
        Parameter("damping", "N s/m", 0.0, (-3e4, 3e5), "radiation damping added to that of the base model", SOURCE),
    )

    @classmethod
    def example(cls) -> Self:
        """200 kg and 30 kN s/m."""
        return cls(200.0, 3e4)

    @classmethod
    def hypotheses(cls, site: TrackSite) -> Iterator[Hypothesis]:
        """Some of the ballast moves and does not radiate."""
        yield Hypothesis(STARTS)

    def links(self, track: Track) -> Sequence[Link]:
        """Mass and damper under every sleeper, or every ballast mass."""
        self.check()
        if track.layers == 1 or (self.mass == 0.0 and self.damping == 0.0):
            return []
        lowest = "ballast" if track.layers == 3 else "sleeper"
        base_damping = track.subgrade_damping if track.layers == 3 else track.ballast_damping
        return [
            Link((((lowest, j), 1.0),), damping=max(self.damping, -0.9 * c), mass=self.mass, tag="ballast_inertia")
            for j, c in enumerate(base_damping)
        ]
