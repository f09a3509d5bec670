"""Shear of the rail that the base model lacks or has wrong."""

from dataclasses import dataclass, replace

from turnout.physics.term import Parameter, PhysicsTerm


@dataclass(frozen=True)
class RailShear(PhysicsTerm):
    r"""Shear flexibility added to the rail, :math:`1/(\kappa GA)_{new} = 1/(\kappa GA) + s`.

    Zero is the base model; an Euler-Bernoulli rail has no shear. ``flexibility`` s is that of the running rail,
    in 1/GN. A stretch of another profile changes in the same proportion, as its shear area scales with its area.
    """

    flexibility: float

    name = "rail_shear"
    left_out = "the rail yields in shear by {flexibility:.2f} per giganewton more"
    effect_type = "matrix"
    frame = "condition"
    parameters = (
        Parameter("flexibility", "-", 0.0, (-3.0, 20.0), "shear flexibility added, in 1/GN",
                  "Timoshenko 1921, On the correction for shear of the differential equation; 60E1 has 4.1 per GN",
                  (2.0, 4.0)),  # 4.1 if the file has no shear, half of this again if it has the right one
    )  # fmt: skip

    @classmethod
    def example(cls):
        """Half of the shear flexibility of 60E1 is added."""
        return cls(2.0)

    def rail(self, track):
        """The track with the added shear flexibility in its rails."""
        self.check()
        if self.flexibility == 0.0:
            return track
        stretches = tuple(replace(s, rail=self._with_shear(s.rail, track.rail)) for s in track.stretches)
        return replace(track, rail=self._with_shear(track.rail, track.rail), stretches=stretches)

    def _with_shear(self, rail, running):
        flexibility, running_flexibility = (
            0.0 if r.beam == "euler" else 1.0 / r.shear_stiffness for r in (rail, running)
        )
        share = flexibility / running_flexibility if flexibility and running_flexibility else running.mass / rail.mass
        total = max(flexibility + 1e-9 * self.flexibility * share, 1e-11)
        return replace(rail, shear_stiffness=1.0 / total, beam="timoshenko")
