"""Shear flexibility of the rail that the base model lacks or has wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from turnout.physics.hypothesis import Hypothesis, Masking, TrackSite
from turnout.physics.term import Parameter, PhysicsTerm

if TYPE_CHECKING:
    from turnout.simulate.rail import Rail
    from turnout.simulate.track import Track

STARTS = ((1.5,), (3.5,), (6.0,), (9.0,), (-1.5,))  # 1/GN
MASKING_SD = 0.5  # of the logarithm of the rail's shear stiffness


@dataclass(frozen=True)
class RailShear(PhysicsTerm):
    r"""Shear flexibility added to the rail, :math:`1/(\kappa GA)_{new} = 1/(\kappa GA) + s`.

    Zero is the base model; an Euler-Bernoulli rail has no shear. ``flexibility`` s is that of the running rail,
    in 1/GN. A stretch of another profile changes in the same proportion, as its shear area scales with its area.
    """

    flexibility: float

    name = "rail_shear"
    left_out = "the rail yields in shear by {flexibility:.2f} per giganewton more"
    left_out_negative = "the rail yields in shear by {flexibility_size:.2f} per giganewton less"
    message = "The rail is softer in shear than in the simulation"
    message_negative = "The rail is stiffer in shear than in the simulation"
    site_check = "Check the rail profile in the track file"
    effect_type = "matrix"
    frame = "condition"
    site_types = (TrackSite,)
    column_type = "track"
    smallest_reportable = 0.9
    nonlinear_in_size = True
    prescreen_group = name  # common values of the base model change first to hide it
    parameters = (
        Parameter("flexibility", "-", 0.0, (-3.0, 20.0), "shear flexibility added, in 1/GN",
                  "Timoshenko 1921, On the correction for shear of the differential equation; 60E1 has 4.1 per GN",
                  (2.0, 4.0)),  # 4.1 if the file has no shear, half of this again if it has the right one
    )  # fmt: skip

    @classmethod
    def example(cls) -> Self:
        """Half of the shear flexibility of 60E1 is added."""
        return cls(2.0)

    @classmethod
    def hypotheses(cls, site: TrackSite) -> Iterator[Hypothesis]:
        """More or less shear; the base model may have fitted it as its rail's shear stiffness."""
        file_flexibility = 0.0 if site.rail.beam == "euler" else 1e9 / site.rail.shear_stiffness
        masking = Masking("rail_shear", MASKING_SD, lambda v: file_flexibility * np.expm1(-v))
        yield Hypothesis(STARTS, masking=masking)

    def rail(self, track: Track) -> Track:
        """The track with the added shear flexibility in its rails."""
        self.check()
        if self.flexibility == 0.0:
            return track
        stretches = tuple(replace(s, rail=self._with_shear(s.rail, track.rail)) for s in track.stretches)
        return replace(track, rail=self._with_shear(track.rail, track.rail), stretches=stretches)

    def _with_shear(self, rail: Rail, running: Rail) -> Rail:
        flexibility, running_flexibility = (
            0.0 if r.beam == "euler" else 1.0 / r.shear_stiffness for r in (rail, running)
        )
        share = flexibility / running_flexibility if flexibility and running_flexibility else running.mass / rail.mass
        total = max(flexibility + 1e-9 * self.flexibility * share, 1e-11)
        return replace(rail, shear_stiffness=1.0 / total, beam="timoshenko")
