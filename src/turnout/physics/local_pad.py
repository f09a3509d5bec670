"""A worn, missing or stiff pad on one sleeper."""

from dataclasses import dataclass, replace

from turnout.physics.term import Parameter, PhysicsTerm


@dataclass(frozen=True)
class LocalPad(PhysicsTerm):
    r"""Pad stiffness of one support is :math:`r` times that of the base.

    The damping ratio is constant, so the damper :math:`c = 2 \zeta \sqrt{k m}` scales with :math:`\sqrt{r}`.
    """

    sleeper: int
    factor: float

    name = "local_pad"
    left_out = "the pad on sleeper {sleeper} has {factor:.2f} times its stiffness"
    effect_type = "matrix"
    scales_track = True
    frame = "place"
    parameters = (
        Parameter("factor", "-", 1.0, (0.05, 8.0), "pad stiffness over that of the base model",
                  "Oregui et al. 2016, Sensitivity analysis of railpad parameters on vertical railway track dynamics",
                  (1.0, 1.5)),
    )  # fmt: skip

    @classmethod
    def example(cls):
        """A worn pad with three times the stiffness on sleeper 20."""
        return cls(20, 3.0)

    def links(self, track):
        """Links added to the spring and damper of the pad."""
        self.check()
        springs = [link for link in track.support_links(self.sleeper) if link.tag == "pad"]
        more = self.factor - 1.0
        slower = self.factor**0.5 - 1.0
        return [replace(k, stiffness=more * k.stiffness, damping=slower * k.damping, tag="local_pad") for k in springs]
