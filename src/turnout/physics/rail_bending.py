"""A stretch of rail with another bending stiffness and mass: crossing, blade, worn or wrong profile."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

from turnout.physics.term import Parameter, PhysicsTerm
from turnout.simulate.track import RailStretch

if TYPE_CHECKING:
    from turnout.simulate.track import Track


@dataclass(frozen=True)
class RailBending(PhysicsTerm):
    r"""Between two positions the rail has :math:`r\,EI`, and :math:`\sqrt r` times its mass, as profiles scale."""

    start: float
    end: float
    factor: float

    name = "rail_bending"
    left_out = "the rail from {start:.1f} to {end:.1f} m has {factor:.2f} times its bending stiffness"
    message = "The rail at {place} is {factor} times as stiff in bending"
    site_check = "Check the rail profile in the track file"
    effect_type = "matrix"
    frame = "place"
    asked = False
    parameters = (
        Parameter("factor", "-", 1.0, (0.3, 5.0), "bending stiffness over that of the base model",
                  "Esveld 2001, Modern railway track: EI grows about as the square of a profile's mass"),
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """A crossing of twice the stiffness over 4 m."""
        return cls(10.0, 14.0, 2.0)

    def rail(self, track: Track) -> Track:
        """The track with one more stretch."""
        self.check()
        if self.factor == 1.0:
            return track
        base = track.rail_at(0.5 * (self.start + self.end))
        mass = self.factor**0.5
        changed_rail = replace(base, bending_stiffness=self.factor * base.bending_stiffness, mass=mass * base.mass,
                        rotary_inertia=self.factor * base.rotary_inertia)  # fmt: skip
        return replace(track, stretches=(*track.stretches, RailStretch(self.start, self.end, changed_rail)))
